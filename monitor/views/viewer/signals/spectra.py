"""Spectra of the channels over the last seconds, with the frequencies of the modes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import scipy  # its parts at their first use

from daq import FloatArray, Recording
from monitor.results.windows import ReferenceResult
from monitor.views.member_axis import ticks
from monitor.views.palette import SENSOR, TEXT, Colour, mode_colour
from monitor.views.viewer.primitives import Axes, text

_COLUMNS = 2
_MAX_CHANNELS = 24  # that are drawn
_WIDTH, _HEIGHT = 100.0, 22.0
_ACROSS, _DOWN = 26.0, 10.0  # room between panels
_SEGMENT_SECONDS = 4.0  # of the averaged periodograms
_ABOVE = 1.12  # of the highest mode: end of the frequency axis
_DECADES = 6.0  # of power that are drawn at most


def spectra_bounds(n_channels: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the bounds of the drawing, x and y."""
    shown = min(n_channels, _MAX_CHANNELS)
    rows = -(-shown // _COLUMNS)
    across = min(shown, _COLUMNS) * (_WIDTH + _ACROSS)
    return (-_ACROSS, across - _ACROSS + 8.0), (-_DOWN, rows * (_HEIGHT + _DOWN))


@dataclass(frozen=True, eq=False, kw_only=True)
class Curves:
    """Spectra of channels in one colour."""

    frequency: FloatArray  #: (n,) [Hz]
    level: FloatArray  #: (n, n_channels) [dB re (m/s2)2/Hz]
    colour: Colour


def draw_channel_spectra(recording: rr.RecordingStream, signals: Recording, reference: ReferenceResult | None) -> None:
    """Draw the spectral density of each channel, with the modes of the baseline."""
    frequency, level = channel_spectra(signals)
    names = [channel.name for channel in signals.channels]
    marks = [(mode.frequency, mode_colour(mode.id)) for mode in (reference.modes if reference else [])]
    curves = Curves(frequency=frequency, level=level, colour=SENSOR)
    draw_spectra_panels(recording, "/channel_spectra", names, [curves], marks)


def draw_spectra_panels(
    recording: rr.RecordingStream,
    base: str,
    names: Sequence[str],
    curves: Sequence[Curves],
    marks: Sequence[tuple[float, Colour]],
) -> None:
    """Draw one panel per channel, all with the same axes.

    Parameters
    ----------
    base : entity of the drawing
    names : of the channels
    curves : of these channels, the last in front
    marks : frequencies [Hz] and colours of lines; the axis ends a little above the highest one
    """
    last = min(float(one.frequency[-1]) for one in curves)
    end = min(last, _ABOVE * max((frequency for frequency, _ in marks), default=last))
    marks = [mark for mark in marks if mark[0] <= end]
    inside = [(one.frequency > 0) & (one.frequency <= end) for one in curves]
    levels = np.concatenate([one.level[shown].ravel() for one, shown in zip(curves, inside, strict=True)])
    high = 10 * np.ceil(levels.max() / 10)
    low = max(10 * np.floor(np.quantile(levels, 0.01) / 10), high - 10 * _DECADES)
    n_panels = min(len(names), _MAX_CHANNELS)
    for number in range(n_panels):
        row, column = divmod(number, _COLUMNS)
        left, top = column * (_WIDTH + _ACROSS), row * (_HEIGHT + _DOWN)
        axes = Axes(left=left, top=top, width=_WIDTH, height=_HEIGHT, x_range=(0.0, end), y_range=(low, high))
        path = f"{base}/{number}"
        is_last = number + _COLUMNS >= n_panels
        x = {float(f): f"{f:g} Hz" if is_last else "" for f in ticks(0.0, end, 4)}
        axes.grid(recording, path, x, {float(v): f"{v:g} dB" for v in ticks(low, high, 2)}, room=11.0)
        runs, colours = [], []
        for one, shown in zip(curves, inside, strict=True):
            found = axes.runs(one.frequency[shown], np.maximum(one.level[shown, number], low))
            runs += found
            colours += [one.colour] * len(found)
        thin = rr.Radius.ui_points(0.8)
        curve = rr.LineStrips2D(runs, colors=colours, radii=thin, draw_order=10.0)
        recording.log(f"{path}/curve", curve, static=True)
        lines = [[[float(axes.x(f)), top], [float(axes.x(f)), top + _HEIGHT]] for f, _ in marks]
        pale = [(*colour, 130) for _, colour in marks]
        recording.log(f"{path}/modes", rr.LineStrips2D(lines, colors=pale, radii=thin, draw_order=5.0), static=True)
        text(recording, f"{path}/name", [[left + _WIDTH / 2, top - 6.0]], [names[number]], [TEXT])


def channel_spectra(signals: Recording) -> tuple[FloatArray, FloatArray]:
    """Return frequencies (n,) [Hz] and densities (n, n_channels) [dB re (m/s2)2/Hz]; gaps count as zero."""
    offset = np.nansum(signals.data, axis=0) / np.maximum(np.isfinite(signals.data).sum(axis=0), 1)
    data = np.nan_to_num(signals.data - offset)
    segment = min(len(data), round(_SEGMENT_SECONDS * signals.rate))
    frequency, density = scipy.signal.welch(data, signals.rate, nperseg=segment, axis=0)
    return frequency, 10 * np.log10(np.maximum(density, 1e-30))
