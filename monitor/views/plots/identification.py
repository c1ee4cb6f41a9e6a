"""Diagrams of an identification: spectrum, stabilization, damping, MAC, complexity, tracks."""

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import MaxNLocator

from daq import FloatArray, IndexArray, Recording
from oma import (
    Identification,
    IdentificationError,
    LongTermTracker,
    ModalEstimate,
    mac_matrix,
    mpc,
    mpd,
    singular_values,
)
from oma.selection import Stabilization

LINE, STABLE, POLE, MODE, TONE = "#37474f", "#1565c0", "#cfd8dc", "#c62828", "#ef6c00"
_SEGMENTS = 8  # of a spectrum, at least: fewer scatter too much
_LARGEST_FFT = 1 << 14
_MARGIN = 1.15  # of the highest mode: where pictures end
_DYNAMIC = 100.0  # dB: below is the rounding of single precision
_QUIET, _ROOM = 0.02, 6.0  # share of the width that does not set the height of a spectrum, and dB above and below
_WRITTEN = 16  # modes up to which a MAC matrix has its numbers
_CELL, _BARE_CELL = 0.56, 0.26  # width of an entry of the matrix with and without its number [in]
_LEGEND = 24  # channels up to which arrows are explained


def highest_shown(estimate: ModalEstimate) -> float:
    """Return where pictures over frequency end [Hz]."""
    return _MARGIN * float(estimate.frequency[-1])


def draw_poles(axes: Axes, poles: Stabilization, highest: float) -> None:
    """Draw the stabilization diagram."""
    peaks = bool(np.any(poles.order == 1))  # no model has one pole: these are numbers of singular values
    repeated = "peak" if peaks else "pole that the next order repeats"
    order = "number of the singular value" if peaks else "model order"
    for stable, colour, label in ((False, POLE, "pole"), (True, STABLE, repeated)):
        chosen = poles.stable == stable
        if np.any(chosen) or not peaks:
            axes.plot(poles.frequency[chosen], poles.order[chosen], ".", color=colour, markersize=4, label=label)
    axes.set(xlabel="frequency [Hz]", ylabel=order, ylim=(0, poles.order.max() * 1.15), xlim=(0, highest))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))


def draw_spectrum(axes: Axes, recording: Recording, highest: float, n_lines: int = 3) -> None:
    """Draw the first singular values of the spectral matrix, where the recording is long enough for them."""
    n_fft = min(_LARGEST_FFT, 1 << max(6, int(np.log2(len(recording.data) / _SEGMENTS))))
    try:
        frequency, values = singular_values(recording, n_fft)
    except IdentificationError:
        return
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


def mark_modes(axes: Axes, estimate: ModalEstimate, tones: FloatArray, highest: float) -> None:
    """Mark modes, numbered, and tones; the numbers of neighbours are at different heights."""
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


def plot_stabilization(
    found: Identification, recording: Recording | None = None, estimate: ModalEstimate | None = None
) -> Figure:
    """Draw the stabilization diagram: poles over frequency by model order, and the damping of the stable ones.

    Parameters
    ----------
    found : with the poles, as of `oma.identify_all`
    recording : whose spectrum is drawn behind the poles. Default: no spectrum
    estimate : modes to mark. Default: those of `found`
    """
    estimate = found.estimate if estimate is None else estimate
    figure = Figure(figsize=(14, 9), layout="constrained")
    upper, lower = np.ravel(figure.subplots(2, 1, height_ratios=(2, 1), sharex=True))
    highest = highest_shown(estimate)
    draw_poles(upper, found.poles, highest)
    if recording is not None:
        draw_spectrum_behind(upper, recording, highest)
    mark_modes(upper, estimate, found.harmonics, highest)
    upper.set_xlabel("")
    draw_damping(lower, found.poles, estimate)
    return figure


def draw_spectrum_behind(axes: Axes, recording: Recording, highest: float) -> None:
    """Draw the spectrum behind what the axes show, on a scale of its own at the right."""
    behind = axes.twinx()
    axes.set(zorder=behind.get_zorder() + 1, frame_on=False)
    draw_spectrum(behind, recording, highest)


def draw_damping(axes: Axes, poles: Stabilization, estimate: ModalEstimate) -> None:
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


def plot_spectrum(
    recording: Recording, found: Identification | None = None, estimate: ModalEstimate | None = None
) -> Figure:
    """Draw the singular values of the spectral matrix.

    Parameters
    ----------
    recording : Recording
    found : whose modes and tones are marked. Default: nothing is marked, up to half the rate
    estimate : modes to mark. Default: those of `found`
    """
    if estimate is None and found is not None:
        estimate = found.estimate
    highest = recording.rate / 2 if estimate is None else highest_shown(estimate)
    figure = Figure(figsize=(14, 6.5), layout="constrained")
    axes = figure.add_subplot()
    draw_spectrum(axes, recording, highest, len(recording.channels))
    if estimate is not None:
        mark_modes(axes, estimate, found.harmonics if found else np.empty(0), highest)
    axes.set(xlabel="frequency [Hz]", xlim=(0, highest))
    axes.grid(alpha=0.3)
    return figure


def plot_mac(a: ModalEstimate, b: ModalEstimate | None = None) -> Figure:
    """Draw the MAC of the modes of an estimate with those of another one.

    Parameters
    ----------
    a, b : of the same channels; `b` is `a` by default

    Raises
    ------
    ValueError
        If the channels differ.
    """
    b = a if b is None else b
    if a.channels != b.channels:
        raise ValueError(f"b: expected the channels {', '.join(a.channels)}, found {', '.join(b.channels)}")
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


def mac_figure(estimate: ModalEstimate, model: tuple[FloatArray, FloatArray] | None = None) -> Figure:
    """Draw the MAC of the modes with each other, and with a model's if there is one.

    Parameters
    ----------
    estimate : ModalEstimate
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


def complexity_figure(estimate: ModalEstimate) -> Figure:
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


def _draw_compass(axes: PolarAxes, estimate: ModalEstimate, k: int) -> None:
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


def plot_tracks(estimates: Sequence[ModalEstimate]) -> Figure:
    """Draw the frequencies of all windows over time, one colour per identity; rare ones are grey."""
    figure = Figure(figsize=(14, 7), layout="constrained")
    axes = figure.add_subplot()
    ordered = sorted(estimates, key=lambda e: e.start)
    unit, name = _unit_of_time(ordered[-1].end - ordered[0].start)
    time, frequency, identity = _followed(ordered, unit)
    axes.set(xlabel=f"time [{name}]", ylabel="frequency [Hz]")
    axes.set_xlim(0, (ordered[-1].end - ordered[0].start) / unit)
    known = [i for i in np.unique(identity) if np.count_nonzero(identity == i) >= LongTermTracker().confirm]
    strange = ~np.isin(identity, known)
    axes.plot(time[strange], frequency[strange], ".", color=POLE, markersize=5)
    for i in sorted(known, key=lambda i: float(np.median(frequency[identity == i]))):
        here = identity == i
        share = np.count_nonzero(here) / len(ordered)
        label = f"{np.median(frequency[here]):.3f} Hz, in {share:.0%} of the windows"
        axes.plot(time[here], frequency[here], ".-", markersize=5, linewidth=0.7, label=label)
    axes.legend(loc="upper left", bbox_to_anchor=(1.005, 1), fontsize=8, reverse=True, title=f"{len(ordered)} windows")
    axes.grid(alpha=0.3)
    return figure


def _unit_of_time(span: int) -> tuple[float, str]:
    """Return a unit [ns] for a span [ns], and its name."""
    return next(
        (u, name)
        for u, name in ((8.64e13, "d"), (3.6e12, "h"), (6e10, "min"), (1e9, "s"))
        if span >= 2 * u or name == "s"
    )


def _followed(ordered: Sequence[ModalEstimate], unit: float) -> tuple[FloatArray, FloatArray, IndexArray]:
    """Return time since the first window's start, frequency [Hz] and identity of each mode of each window."""
    tracks, identity = None, []
    for estimate in ordered:
        followed = LongTermTracker().follow(tracks, estimate)
        tracks = followed.tracks
        identity.append(followed.identity)
    middle = [np.full(e.n_modes, ((e.start + e.end) / 2 - ordered[0].start) / unit) for e in ordered]
    return np.concatenate(middle), np.concatenate([e.frequency for e in ordered]), np.concatenate(identity)
