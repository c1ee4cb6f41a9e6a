"""Figures of channels and devices: RMS and temperature over time, and a table of the last seconds."""

from collections.abc import Iterable, Sequence

import numpy as np
import rerun as rr

from daq import Recording
from monitor.results.innovations import ModeInnovations
from monitor.results.residuals import ChannelResiduals
from monitor.results.run_results import RunResults
from monitor.views.palette import ALARM, WARN, Colour, mode_colour
from monitor.views.viewer.primitives import ends, legend, line, rule, times


def channels_with_rms(run_results: RunResults) -> list[str]:
    """Return the channels whose RMS is known in a window."""
    return list(dict.fromkeys(name for window in run_results.windows for name in window.rms))


def draw_rms(recording: rr.RecordingStream, run_results: RunResults) -> None:
    """Draw the RMS of each channel, window by window [m/s2], and the names in their colours."""
    names = channels_with_rms(run_results)
    if names:
        legend(recording, "/channels/legend", names, [mode_colour(number) for number, _ in enumerate(names, 1)])
    for number, name in enumerate(names, 1):
        values = [window.rms.get(name, np.nan) for window in run_results.windows]
        path = rr.new_entity_path(["channels", "rms", name])
        line(recording, path, name, mode_colour(number), ends(run_results.windows), values)


def draw_temperatures(recording: rr.RecordingStream, run_results: RunResults) -> None:
    """Draw the temperatures of the site and of devices [degC], and the names in their colours."""
    if run_results.temperatures:
        name_thermometers(recording, list(run_results.temperatures))
    for number, (name, (at, values)) in enumerate(run_results.temperatures.items()):
        draw_temperature(recording, name, number, at, values)


def draw_temperature(
    recording: rr.RecordingStream, name: str, number: int, at: Sequence[int], values: Sequence[float]
) -> None:
    """Draw temperatures [degC] over their times [ns UTC]; the number of the thermometer gives the colour."""
    path = rr.new_entity_path(["channels", "temperature", name])
    line(recording, path, name, _thermometer_colour(number), times(at), values)


def name_thermometers(recording: rr.RecordingStream, names: Sequence[str], *, static: bool = True) -> None:
    """Write the names of thermometers in their colours."""
    colours = [_thermometer_colour(number) for number in range(len(names))]
    legend(recording, "/channels/thermometers", names, colours, static=static)


def _thermometer_colour(number: int) -> Colour:
    return mode_colour(number) if number else WARN


def draw_residuals(recording: rr.RecordingStream, residuals: ChannelResiduals) -> None:
    """Draw the residual of each channel against its prediction from the others, and the limit [standard deviations]."""
    numbered = enumerate(residuals.deviation.items(), 1)
    _draw_block(recording, "residuals", residuals, [(number, *one) for number, one in numbered])


def draw_innovations(recording: rr.RecordingStream, innovations: ModeInnovations) -> None:
    """Draw the innovations about each mode, and the limit [standard deviations]."""
    modes = zip(innovations.mode, innovations.deviation, strict=True)
    found = [(number, f"mode {number}", deviation) for number, deviation in modes]
    _draw_block(recording, "innovations", innovations, found)


def clear_innovations(recording: rr.RecordingStream) -> None:
    """End the series of the modes, at the time that is set."""
    recording.log("/channels/innovations", rr.Clear(recursive=True))


def _draw_block(
    recording: rr.RecordingStream,
    kind: str,
    block: ChannelResiduals | ModeInnovations,
    deviations: Iterable[tuple[int, str, float]],
) -> None:
    """Draw the deviations of a block, each with its number, which gives the colour, and its name; and the limit."""
    for number, name, deviation in deviations:
        path = rr.new_entity_path(["channels", kind, name])
        line(recording, path, name, mode_colour(number), times([block.time]), [deviation])
    path = rr.new_entity_path(["channels", kind, "limit"])
    begin = block.time - round(block.seconds * 1e9)
    rule(recording, path, "limit", ALARM, (begin, block.time), block.limit)


def write_channels(recording: rr.RecordingStream, signals: Recording) -> None:
    """Write the table of offset, RMS, peak and gaps of the last seconds."""
    recording.log("/channels/table", rr.TextDocument(channels_card(signals), media_type="text/markdown"), static=True)


def channels_card(signals: Recording) -> str:
    """Return offset, RMS and peak about the offset [mm/s2], and the share of missing scans, of each channel.

    Where no channel has a value at the beginning or at the end, nothing is missing: filters have no output there.
    """
    lines = ["| channel | offset mm/s² | RMS | peak | missing % |", "|:--|---:|---:|---:|---:|"]
    there = np.flatnonzero(~np.isnan(signals.data).all(axis=1))
    within = slice(there[0], there[-1] + 1) if len(there) else slice(None)
    for number, channel in enumerate(signals.channels):
        data = 1000 * signals.data[within, number]
        missing = float(np.mean(np.isnan(data)))
        if missing == 1:
            lines.append(f"| {channel.name} | | | | 100.0 |")
            continue
        offset = float(np.nanmean(data))
        rms, peak = float(np.nanstd(data)), float(np.nanmax(np.abs(data - offset)))
        cells = (text.rstrip(".") for text in (f"{offset:+#.3g}", f"{rms:#.3g}", f"{peak:#.3g}"))
        lines.append(f"| {channel.name} | {' | '.join(cells)} | {100 * missing:.1f} |")
    return "\n".join(lines)
