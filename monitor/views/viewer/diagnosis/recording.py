"""Diagnosis in the viewer: residual forces and causes on the structure, modes, sensors, signals."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import rerun as rr

from daq import FloatArray, Recording
from daq.notebook import rounded_text
from monitor.results.comparison import BalanceResult, DiagnosisAnswer, DiscrepancyResult
from monitor.results.state_comparison import StateComparison
from monitor.results.windows import ReferenceResult
from monitor.views.geometry import Geometry
from monitor.views.palette import GREY, SENSOR, STEEL, TEXT, Colour, signed_heat
from monitor.views.viewer.cards import diagnosis_card
from monitor.views.viewer.diagnosis.bars import draw_named_bars
from monitor.views.viewer.diagnosis.evidence import draw_evidence
from monitor.views.viewer.diagnosis.layout import (
    SECONDS_TIMELINE,
    diagnosis_layout,
    missed_bars,
    offset_bars,
    residual_bars,
)
from monitor.views.viewer.diagnosis.shapes import draw_state_shapes
from monitor.views.viewer.modes.mac_matrix import draw_mac
from monitor.views.viewer.primitives import once, recording_file
from monitor.views.viewer.scene import TUBE, draw_causes, sensors, supports
from monitor.views.viewer.signals.spectra import Curves, channel_spectra, draw_spectra_panels

_MARKDOWN = "text/markdown"


def write_diagnosis(
    path: Path,
    diagnosis: DiagnosisAnswer,
    found: DiscrepancyResult,
    reference: ReferenceResult,
    states: StateComparison | None = None,
) -> None:
    """Write a self-contained .rrd file of a diagnosis, with its views laid out.

    Parameters
    ----------
    path : of the new file; it appears when it is whole
    diagnosis : to draw
    found : comparison of measured and simulated modes, of the same structure
    reference : with the structure's geometry
    states : shapes and signals before and after; None: no shapes were measured

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    layout = diagnosis_layout(diagnosis, found, reference, states)
    with recording_file(path, f"diagnosis-{path.stem}", layout) as recording:
        recording.send_recording_name("diagnosis")
        _card(recording, "/diagnosis", diagnosis_card(diagnosis))
        _card(recording, "/modes", modes_card(found))
        draw_evidence(recording, diagnosis)
        mac = np.array([[np.nan if value is None else value for value in row] for row in found.mac], float)
        names = ([f"{frequency:#.4g}" for frequency in frequencies] for frequencies in (found.rows, found.columns))
        draw_mac(recording, "/mac", mac, *names)
        draw_named_bars(recording, "/offsets", offset_bars(found))
        if found.sensors:
            draw_named_bars(recording, "/sensors/residual", residual_bars(found))
            if missed := missed_bars(found):
                draw_named_bars(recording, "/sensors/missed", missed)
        if states:
            _states(recording, states)
        _structure(recording, diagnosis, found, reference)
        _signals(recording, found)


def _card(recording: rr.RecordingStream, path: str, words: str) -> None:
    recording.log(path, rr.TextDocument(words, media_type=_MARKDOWN), static=True)


def _states(recording: rr.RecordingStream, states: StateComparison) -> None:
    """Draw shapes and spectra before and after."""
    if states.shapes:
        draw_state_shapes(recording, states)
    if states.signals:
        names = [channel.name for channel in states.signals.channels]
        both = [(states.signals_before, GREY), (states.signals, SENSOR)]
        curves = [_curves(signals, names, colour) for signals, colour in both if signals]
        marks = [(mode.frequency_before, GREY) for mode in states.shapes]
        marks += [(mode.frequency, SENSOR) for mode in states.shapes]
        draw_spectra_panels(recording, "/state_spectra", names, curves, marks)


def _curves(signals: Recording, names: Sequence[str], colour: Colour) -> Curves:
    """Return the spectra of channels in the order of names; one that is missing is at the floor."""
    frequency, level = channel_spectra(signals)
    own = [channel.name for channel in signals.channels]
    columns = [level[:, own.index(name)] if name in own else np.full(len(level), level.min()) for name in names]
    return Curves(frequency=frequency, level=np.column_stack(columns), colour=colour)


def modes_card(found: DiscrepancyResult) -> str:
    """Return the table of the modes before and now, or of the model and measured, with digits by their deviations."""
    first = "before Hz | now Hz | change %" if found.measured_before else "model Hz | measured Hz | off by %"
    lines = [f"| {first} | σ | MAC | with causes % |", "|---:|---:|---:|---:|---:|---:|"]
    for m in found.modes:
        std = m.std_percent or 0.0
        off = "" if m.off_percent is None else rounded_text(m.off_percent, std, sign=True)
        sigmas = "" if m.off_percent is None or not m.std_percent else f"{m.off_percent / m.std_percent:+.1f}"
        hertz = 0.01 * std * (m.measured or 0.0)
        simulated = "none" if m.simulated is None else rounded_text(m.simulated, hertz)
        measured = "not identified" if m.measured is None else rounded_text(m.measured, hertz)
        mac = "" if m.mac is None else f"{m.mac:.4f}"
        after = "" if m.off_percent_after is None else rounded_text(m.off_percent_after, std, sign=True)
        lines.append(f"| {simulated} | {measured} | {off} | {sigmas} | {mac} | {after} |")
    return "\n".join(lines)


def _structure(
    recording: rr.RecordingStream, diagnosis: DiagnosisAnswer, found: DiscrepancyResult, reference: ReferenceResult
) -> None:
    """Draw members coloured by the residual forces, sensors, and the causes at their places."""
    geometry = Geometry(reference)
    recording.log("/structure", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    supports(recording, "/structure", geometry)
    sensors(recording, reference, geometry)
    pairs = [(int(a), int(b)) for nodes in geometry.lines.values() for a, b in pairwise(nodes)]
    segments = [geometry.nodes[list(pair)] for pair in pairs]
    values = reading_of(found.balance, len(geometry.nodes))
    largest = float(np.nanmax(np.abs(values), initial=0.0)) or 1.0
    level = np.array([np.mean(values[list(pair)]) for pair in pairs]) / largest
    colours = signed_heat(level) if found.balance else [STEEL]
    members = rr.LineStrips3D(segments, colors=colours, radii=1.4 * TUBE * geometry.size)
    recording.log("/structure/members", members, static=True)
    draw_causes(recording, geometry, diagnosis.causes, reference, static=True)


def reading_of(balance: BalanceResult | None, n_nodes: int) -> FloatArray:
    """Return the better interpretation of the residual forces at each node (n_nodes,), NaN where unknown."""
    if balance is None or len(balance.loss) != n_nodes:
        return np.full(n_nodes, np.nan)
    values = balance.added if balance.log_odds > 0 else balance.loss
    return np.array([np.nan if v is None else v for v in values])


def _signals(recording: rr.RecordingStream, found: DiscrepancyResult) -> None:
    for signal in found.signals:
        seconds = signal.step * np.arange(len(signal.measured))
        column = rr.TimeColumn(SECONDS_TIMELINE, duration=seconds)
        for name, values, colour in (("measured", signal.measured, TEXT), ("predicted", signal.predicted, SENSOR)):
            path = f"/signals/{signal.channel}/{name}"
            once(recording, path, rr.SeriesLines(colors=[colour], names=[name], widths=[1.4]))
            recording.send_columns(path, [column], rr.Scalars.columns(scalars=list(values)))
