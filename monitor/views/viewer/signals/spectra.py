"""Spectra of the channels over the last seconds, with the frequencies of the modes."""

import numpy as np
import rerun as rr
from scipy.signal import welch

from daq import FloatArray, Recording
from monitor.results.windows import ReferenceResult
from monitor.views.member_axis import ticks
from monitor.views.palette import SENSOR, TEXT, mode_colour
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


def draw_channel_spectra(recording: rr.RecordingStream, signals: Recording, reference: ReferenceResult | None) -> None:
    """Draw the spectral density of each channel, one panel per channel, all with the same axes."""
    frequency, level = channel_spectra(signals)
    modes = reference.modes if reference else []
    end = min(frequency[-1], _ABOVE * max((m.frequency for m in modes), default=frequency[-1]))
    modes = [m for m in modes if m.frequency <= end]
    inside = (frequency > 0) & (frequency <= end)
    frequency, level = frequency[inside], level[inside][:, :_MAX_CHANNELS]
    high = 10 * np.ceil(level.max() / 10)
    low = max(10 * np.floor(np.quantile(level, 0.01) / 10), high - 10 * _DECADES)
    names = [channel.name for channel in signals.channels]
    for number in range(level.shape[1]):
        row, column = divmod(number, _COLUMNS)
        left, top = column * (_WIDTH + _ACROSS), row * (_HEIGHT + _DOWN)
        axes = Axes(left=left, top=top, width=_WIDTH, height=_HEIGHT, x_range=(0.0, float(end)), y_range=(low, high))
        path = f"/channel_spectra/{number}"
        is_last = number + _COLUMNS >= level.shape[1]
        x = {float(f): f"{f:g} Hz" if is_last else "" for f in ticks(0.0, float(end), 4)}
        axes.grid(recording, path, x, {float(v): f"{v:g} dB" for v in ticks(low, high, 2)}, room=11.0)
        curve = axes.runs(frequency, np.maximum(level[:, number], low))
        thin = rr.Radius.ui_points(0.8)
        recording.log(
            f"{path}/curve", rr.LineStrips2D(curve, colors=[SENSOR], radii=thin, draw_order=10.0), static=True
        )
        lines = [[[float(axes.x(m.frequency)), top], [float(axes.x(m.frequency)), top + _HEIGHT]] for m in modes]
        marks = rr.LineStrips2D(lines, colors=[(*mode_colour(m.id), 130) for m in modes], radii=thin, draw_order=5.0)
        recording.log(f"{path}/modes", marks, static=True)
        text(recording, f"{path}/name", [[left + _WIDTH / 2, top - 6.0]], [names[number]], [TEXT])


def channel_spectra(signals: Recording) -> tuple[FloatArray, FloatArray]:
    """Return frequencies (n,) [Hz] and densities (n, n_channels) [dB re (m/s2)2/Hz]; gaps count as zero."""
    offset = np.nansum(signals.data, axis=0) / np.maximum(np.isfinite(signals.data).sum(axis=0), 1)
    data = np.nan_to_num(signals.data - offset)
    segment = min(len(data), round(_SEGMENT_SECONDS * signals.rate))
    frequency, density = welch(data, signals.rate, nperseg=segment, axis=0)
    return frequency, 10 * np.log10(np.maximum(density, 1e-30))
