"""Diagrams of an identification: spectrum, stabilization, damping, MAC, complexity, tracks."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import MaxNLocator

from daq import BoolArray, ComplexArray, FloatArray, IndexArray
from oma.mac import mac_matrix, mpc, mpd

LINE, STABLE, POLE, MODE, TONE = "#37474f", "#1565c0", "#cfd8dc", "#c62828", "#ef6c00"
_MARGIN = 1.15  # of the highest mode: where pictures end
_DYNAMIC = 100.0  # dB: below is the rounding of single precision
_QUIET, _ROOM = 0.02, 6.0  # share of the width that does not set the height of a spectrum, and dB above and below
_WRITTEN = 16  # modes up to which a MAC matrix has its numbers
_CELL, _BARE_CELL = 0.56, 0.26  # width of an entry of the matrix with and without its number [in]
_LEGEND = 24  # channels up to which arrows are explained


class Modes(Protocol):
    """Modes as they are drawn; `oma.Modes` has these fields."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Names, in the order of the columns of `shape`."""

    @property
    def n_modes(self) -> int:
        """Number of modes."""

    @property
    def frequency(self) -> FloatArray:
        """Natural frequencies (n_modes,) [Hz], ascending."""

    @property
    def frequency_std(self) -> FloatArray:
        """Standard deviations of the frequencies (n_modes,) [Hz]."""

    @property
    def damping(self) -> FloatArray:
        """Ratios of critical damping (n_modes,) [-]."""

    @property
    def damping_std(self) -> FloatArray:
        """Standard deviations of the damping ratios (n_modes,) [-]."""

    @property
    def shape(self) -> ComplexArray:
        """Shapes (n_modes, n_channels) [-], unit norm."""

    @property
    def shape_std(self) -> FloatArray:
        """Standard deviations of the shapes' real parts (n_modes, n_channels) [-]."""


class Poles(Protocol):
    """Poles of all model orders as they are drawn; `oma.Stabilization` has these fields."""

    @property
    def frequency(self) -> FloatArray:
        """Frequencies (n_poles,) [Hz]."""

    @property
    def damping(self) -> FloatArray:
        """Damping ratios (n_poles,) [-]."""

    @property
    def order(self) -> IndexArray:
        """Model orders (n_poles,) [-]."""

    @property
    def stable(self) -> BoolArray:
        """Poles that the next order shows too (n_poles,)."""


def highest_shown(estimate: Modes) -> float:
    """Return where pictures over frequency end [Hz]."""
    return _MARGIN * float(estimate.frequency[-1])


def draw_poles(axes: Axes, poles: Poles, highest: float) -> None:
    """Draw poles over frequency by model order; `highest` is the end of the frequency axis [Hz]."""
    peaks = bool(np.any(poles.order == 1))  # no model has one pole: these are numbers of singular values
    repeated = "peak" if peaks else "pole that the next order repeats"
    order = "number of the singular value" if peaks else "model order"
    for stable, colour, label in ((False, POLE, "pole"), (True, STABLE, repeated)):
        chosen = poles.stable == stable
        if np.any(chosen) or not peaks:
            axes.plot(poles.frequency[chosen], poles.order[chosen], ".", color=colour, markersize=4, label=label)
    axes.set(xlabel="frequency [Hz]", ylabel=order, ylim=(0, poles.order.max() * 1.15), xlim=(0, highest))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))


def draw_spectrum(axes: Axes, frequency: FloatArray, values: FloatArray, highest: float, n_lines: int = 3) -> None:
    """Draw the first singular values of a spectral matrix.

    Parameters
    ----------
    axes : to draw on
    frequency, values : (n_lines,) [Hz], and (n_lines, n_channels) singular values [(m/s2)2/Hz]
    highest : end of the axis [Hz]
    n_lines : number of singular values to draw
    """
    shown = np.flatnonzero((frequency > 0) & (frequency <= highest))
    level = 10 * np.log10(np.maximum(values[shown, :n_lines], 1e-30))
    for k, line in enumerate(level.T):
        axes.plot(
            frequency[shown], line, color=LINE, linewidth=max(1.2 - 0.3 * k, 0.5), alpha=max(1 - 0.25 * k, 0.25),
            label="singular values" if k == 0 else None,
        )  # fmt: skip
    lively = level[frequency[shown] > _QUIET * highest]  # drift would press the rest together
    axes.set_ylim(max(np.quantile(lively, 0.01), lively.max() - _DYNAMIC) - _ROOM, lively.max() + _ROOM)
    axes.set_ylabel("singular values [dB re (m/s²)²/Hz]")


def draw_spectrum_behind(axes: Axes, spectrum: tuple[FloatArray, FloatArray], highest: float) -> None:
    """Draw a spectrum behind the content of the axes, with its own scale at the right; arguments of `draw_spectrum`."""
    behind = axes.twinx()
    axes.set(zorder=behind.get_zorder() + 1, frame_on=False)
    draw_spectrum(behind, *spectrum, highest)


def mark_modes(axes: Axes, estimate: Modes, tones: FloatArray, highest: float) -> None:
    """Mark the modes with their numbers, and tones (n_tones,) [Hz]; `highest` is the end of the frequency axis [Hz]."""
    raised = False
    for k, frequency in enumerate(estimate.frequency):
        near = k > 0 and frequency - estimate.frequency[k - 1] < 0.015 * highest
        raised = near and not raised
        axes.axvline(frequency, color=MODE, linewidth=0.8, label="mode" if k == 0 else None)
        axes.annotate(
            str(k + 1), (frequency, 1), xycoords=("data", "axes fraction"), xytext=(0, 12 if raised else 3),
            textcoords="offset points", ha="center", color=MODE, fontsize=9,
        )  # fmt: skip
    for k, tone in enumerate(tones):
        axes.axvline(tone, color=TONE, linewidth=0.8, linestyle="--", label="tone" if k == 0 else None)
    axes.legend(loc="lower right", fontsize=8, framealpha=0.9)


def stabilization_figure(
    poles: Poles, estimate: Modes, tones: FloatArray, spectrum: tuple[FloatArray, FloatArray] | None = None
) -> Figure:
    """Draw the stabilization diagram: poles over frequency by model order, and the damping of the stable ones.

    Parameters
    ----------
    poles, estimate : poles of all orders, and the modes to mark
    tones : (n_tones,) frequencies of tones to mark [Hz]
    spectrum : as for `draw_spectrum`, drawn behind the poles. Default: none
    """
    figure = Figure(figsize=(14, 9), layout="constrained")
    upper, lower = np.ravel(figure.subplots(2, 1, height_ratios=(2, 1), sharex=True))
    highest = highest_shown(estimate)
    draw_poles(upper, poles, highest)
    if spectrum is not None:
        draw_spectrum_behind(upper, spectrum, highest)
    mark_modes(upper, estimate, tones, highest)
    upper.set_xlabel("")
    draw_damping(lower, poles, estimate)
    return figure


def draw_damping(axes: Axes, poles: Poles, estimate: Modes) -> None:
    """Draw damping over frequency: stable poles, and the modes with two standard deviations each way."""
    stable = poles.stable
    axes.plot(poles.frequency[stable], 100 * poles.damping[stable], ".", color=STABLE, markersize=3, alpha=0.4)
    axes.errorbar(
        estimate.frequency, 100 * estimate.damping, 200 * estimate.damping_std, 2 * estimate.frequency_std,
        fmt="o", color=MODE, markersize=4, capsize=3, linewidth=1, label="mode ± two standard deviations",
    )  # fmt: skip
    top = 100 * float((estimate.damping + 3 * estimate.damping_std).max())
    axes.set(xlabel="frequency [Hz]", ylabel="damping [%]", ylim=(0, 1.2 * top))
    axes.grid(alpha=0.3)
    axes.legend(loc="upper right", fontsize=8)


def spectrum_figure(
    spectrum: tuple[FloatArray, FloatArray] | None, highest: float, estimate: Modes | None, tones: FloatArray
) -> Figure:
    """Draw all singular values of a spectral matrix.

    Parameters
    ----------
    spectrum : as for `draw_spectrum`; None for a recording that is too short for one
    highest : end of the axis [Hz]
    estimate, tones : modes and (n_tones,) frequencies of tones [Hz] to mark; nothing is marked without modes
    """
    figure = Figure(figsize=(14, 6.5), layout="constrained")
    axes = figure.add_subplot()
    if spectrum is not None:
        draw_spectrum(axes, *spectrum, highest, n_lines=spectrum[1].shape[1])
    if estimate is not None:
        mark_modes(axes, estimate, tones, highest)
    axes.set(xlabel="frequency [Hz]", xlim=(0, highest))
    axes.grid(alpha=0.3)
    return figure


def mac_figure(a: Modes, b: Modes) -> Figure:
    """Draw the MAC of the modes of one estimate with those of another one of the same channels."""
    figure = Figure(figsize=(8, 7), layout="constrained")
    axes = figure.add_subplot()
    _draw_matrix(
        axes,
        mac_matrix(a.shape, b.shape),
        _names(a.frequency),
        _names(b.frequency),
        written=max(a.n_modes, b.n_modes) <= _WRITTEN,
    )
    axes.set(xlabel="mode [Hz]", ylabel="mode [Hz]")
    figure.colorbar(axes.images[0], ax=axes, shrink=0.7, label="MAC")
    return figure


def mac_with_model_figure(estimate: Modes, model: tuple[FloatArray, FloatArray] | None = None) -> Figure:
    """Draw the MAC of the modes with each other, and with a model's if there is one.

    Parameters
    ----------
    estimate : Modes
    model : (n,) frequencies [Hz] and (n, n_channels) shapes at the same channels, optional
    """
    widths = [estimate.n_modes, *([len(model[0])] if model else [])]
    written = max(widths) <= _WRITTEN
    cell = _CELL if written else _BARE_CELL
    size = (max(8.0, cell * sum(widths) + 2.5 * len(widths)), max(5.0, cell * estimate.n_modes + 2.0))
    figure = Figure(figsize=size, layout="constrained")
    panels = np.ravel(np.asarray(figure.subplots(1, len(widths), squeeze=False, width_ratios=widths), object))
    names = _names(estimate.frequency)
    _draw_matrix(panels[0], mac_matrix(estimate.shape, estimate.shape), names, names, written=written)
    panels[0].set(title="MAC of the modes with each other", xlabel="mode [Hz]", ylabel="mode [Hz]")
    if model:
        frequency, shape = model
        _draw_matrix(panels[1], mac_matrix(estimate.shape, shape), names, _names(frequency), written=written)
        panels[1].set(title="MAC with the model's modes", xlabel="model [Hz]", ylabel="mode [Hz]")
    figure.colorbar(panels[-1].images[0], ax=panels.tolist(), shrink=0.7, label="MAC")
    return figure


def _names(frequency: FloatArray) -> list[str]:
    return [f"{k + 1}: {f:.2f}" for k, f in enumerate(frequency)]


def _draw_matrix(axes: Axes, matrix: FloatArray, rows: Sequence[str], columns: Sequence[str], *, written: bool) -> None:
    axes.imshow(matrix, cmap="Blues", vmin=0, vmax=1)
    axes.set_xticks(np.arange(len(columns)), columns, rotation=90, fontsize=8)
    axes.set_yticks(np.arange(len(rows)), rows, fontsize=8)
    if not written:
        return
    for (i, k), value in np.ndenumerate(matrix):
        axes.text(k, i, f"{value:.2f}", ha="center", va="center", fontsize=8, color="white" if value > 0.6 else LINE)


def complexity_figure(estimate: Modes) -> Figure:
    """Draw each mode's components as arrows in the complex plane: a real shape is a straight line."""
    columns = min(4, estimate.n_modes)
    rows = -(-estimate.n_modes // columns)
    figure = Figure(figsize=(3.4 * columns + 2, 3.7 * rows), layout="constrained")
    for k in range(estimate.n_modes):
        axes = figure.add_subplot(rows, columns, k + 1, projection="polar")
        assert isinstance(axes, PolarAxes)
        _draw_compass(axes, estimate, k)
    if len(estimate.channels) <= _LEGEND:
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper", fontsize=8)
    return figure


def _draw_compass(axes: PolarAxes, estimate: Modes, k: int) -> None:
    shape = estimate.shape[k] / np.abs(estimate.shape[k]).max()
    colours = colormaps["tab20" if len(shape) > 10 else "tab10"](np.arange(len(shape)) % 20)
    for z, colour, channel in zip(shape, colours, estimate.channels, strict=True):
        angle, size = float(np.angle(z)), float(np.abs(z))
        axes.plot([angle, angle], [0, size], color=colour, linewidth=1.6, label=channel)
        axes.plot(angle, size, "o", color=colour, markersize=4)
    axes.set_ylim(0, 1.05)
    axes.set_yticks([0.5, 1.0], ["", ""])
    axes.set_xticks(np.arange(8) * np.pi / 4)
    axes.tick_params(labelsize=7, pad=-2)
    quality = f"MPC {float(mpc(estimate.shape[k])):.3f}, MPD {np.degrees(float(mpd(estimate.shape[k]))):.1f}°"
    axes.set_title(f"{k + 1}: {estimate.frequency[k]:.3f} Hz\n{quality}", fontsize=9)


def tracks_figure(
    time: FloatArray, frequency: FloatArray, identity: IndexArray, span: int, n_windows: int, confirm: int
) -> Figure:
    """Draw the frequencies of windows over time, one colour per identity; rare ones are grey.

    Parameters
    ----------
    time : (n,) middle of the window of each mode, since the start of the first window [ns]
    frequency : (n,) [Hz]
    identity : (n,) number of the mode over time
    span : from the start of the first window to the end of the last one [ns]
    n_windows : number of windows
    confirm : number of windows from which on an identity is not rare
    """
    unit, name = _unit_of_time(span)
    figure = Figure(figsize=(14, 7), layout="constrained")
    axes = figure.add_subplot()
    axes.set(xlabel=f"time [{name}]", ylabel="frequency [Hz]", xlim=(0, span / unit))
    known = [i for i in np.unique(identity) if np.count_nonzero(identity == i) >= confirm]
    strange = ~np.isin(identity, known)
    axes.plot(time[strange] / unit, frequency[strange], ".", color=POLE, markersize=5)
    for i in sorted(known, key=lambda i: float(np.median(frequency[identity == i]))):
        here = identity == i
        share = np.count_nonzero(here) / n_windows
        label = f"{np.median(frequency[here]):.3f} Hz, in {share:.0%} of the windows"
        axes.plot(time[here] / unit, frequency[here], ".-", markersize=5, linewidth=0.7, label=label)
    axes.legend(loc="upper left", bbox_to_anchor=(1.005, 1), fontsize=8, reverse=True, title=f"{n_windows} windows")
    axes.grid(alpha=0.3)
    return figure


def _unit_of_time(span: int) -> tuple[float, str]:
    """Return a unit [ns] for a span [ns], and its name."""
    return next(
        (u, name)
        for u, name in ((8.64e13, "d"), (3.6e12, "h"), (6e10, "min"), (1e9, "s"))
        if span >= 2 * u or name == "s"
    )
