"""Identified modes drawn: the spectrum with the stabilization diagram, and the shapes at the channels."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from daq import Recording
from oma import Identification, IdentificationError, ModalEstimate, singular_values

_SHAPES = 6  # modes whose shapes are drawn
_SEGMENTS = 8  # of a spectrum, at least: fewer scatter too much
_LARGEST_FFT = 1 << 14
_MARGIN = 1.15  # of the highest mode: where the picture ends
_LINE, _STABLE, _POLE, _MODE, _TONE = "#37474f", "#1565c0", "#cfd8dc", "#c62828", "#ef6c00"


def draw_modes(path: Path, recording: Recording, found: Identification, estimate: ModalEstimate) -> None:
    """Write a PNG.

    Parameters
    ----------
    path : of the picture
    recording, found : a window and what was identified from it: spectrum and poles
    estimate : the modes to mark, of this window or of many
    """
    n = min(_SHAPES, estimate.n_modes)
    figure = Figure(figsize=(14, 9), layout="constrained")
    grid = figure.add_gridspec(2, n, height_ratios=(1.7, 1))
    diagram = figure.add_subplot(grid[0, :])
    spectrum = diagram.twinx()
    diagram.set(zorder=spectrum.get_zorder() + 1, frame_on=False)  # poles before lines
    highest = _MARGIN * float(estimate.frequency[-1])
    _draw_poles(diagram, found, highest)
    _draw_spectrum(spectrum, recording, highest)
    _mark(diagram, found, estimate, highest)
    shapes = [figure.add_subplot(grid[1, k]) for k in range(n)]
    for k, axes in enumerate(shapes):
        axes.sharey(shapes[0])
        _draw_shape(axes, estimate, k)
    figure.savefig(path, dpi=110)


def _draw_poles(axes: Axes, found: Identification, highest: float) -> None:
    poles = found.poles
    for stable, colour, label in ((False, _POLE, "pole"), (True, _STABLE, "pole that the next order repeats")):
        chosen = poles.stable == stable
        axes.plot(poles.frequency[chosen], poles.order[chosen], ".", color=colour, markersize=4, label=label)
    axes.set(xlabel="frequency [Hz]", ylabel="model order", ylim=(0, poles.order.max() * 1.15), xlim=(0, highest))


def _draw_spectrum(axes: Axes, recording: Recording, highest: float) -> None:
    """Draw the first three singular values of the spectral matrix, where the recording is long enough for them."""
    n_fft = min(_LARGEST_FFT, 1 << max(6, int(np.log2(len(recording.data) / _SEGMENTS))))
    try:
        frequency, values = singular_values(recording, n_fft)
    except IdentificationError:
        return
    shown = np.flatnonzero((frequency > 0) & (frequency <= highest))
    level = 10 * np.log10(np.maximum(values[shown, :3], 1e-30))
    for k, line in enumerate(level.T):
        axes.plot(frequency[shown], line, color=_LINE, linewidth=1.2 - 0.3 * k, alpha=1 - 0.3 * k)
    axes.set_ylabel("singular values [dB re (m/s²)²/Hz]")


def _mark(axes: Axes, found: Identification, estimate: ModalEstimate, highest: float) -> None:
    """Mark modes, numbered, and tones; the numbers of neighbours stand at different heights."""
    raised = False
    for k, frequency in enumerate(estimate.frequency):
        near = k > 0 and frequency - estimate.frequency[k - 1] < 0.015 * highest
        raised = near and not raised
        axes.axvline(frequency, color=_MODE, linewidth=0.8, label="mode" if k == 0 else None)
        axes.annotate(
            str(k + 1), (frequency, 1), xycoords=("data", "axes fraction"), xytext=(0, 12 if raised else 3),
            textcoords="offset points", ha="center", color=_MODE, fontsize=9,
        )  # fmt: skip
    for k, tone in enumerate(found.harmonics):
        axes.axvline(tone, color=_TONE, linewidth=0.8, linestyle="--", label="tone" if k == 0 else None)
    axes.legend(loc="lower right", fontsize=8, framealpha=0.9)


def _draw_shape(axes: Axes, estimate: ModalEstimate, k: int) -> None:
    place = np.arange(len(estimate.channels))
    axes.bar(place, estimate.shape[k].real, yerr=2 * estimate.shape_std[k], color=_STABLE, ecolor=_LINE, capsize=2)
    axes.axhline(0, color=_LINE, linewidth=0.6)
    axes.set_xticks(place, estimate.channels, rotation=90, fontsize=7)
    axes.tick_params(axis="y", labelsize=7)
    axes.set_title(
        f"{k + 1}: {estimate.frequency[k]:.3f} ± {estimate.frequency_std[k]:.3f} Hz\n"
        f"{100 * estimate.damping[k]:.2f} ± {100 * estimate.damping_std[k]:.2f} %",
        fontsize=9,
    )
