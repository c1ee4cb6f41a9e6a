"""Map of the smallest detectable mass on the structure and along its members."""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, to_rgba
from matplotlib.figure import SubFigure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from daq import FloatArray
from monitor.text.quantities import duration_words, mass_words
from monitor.views.member_axis import Unrolled
from monitor.views.plots.axes3d import frame_axes, size
from updater.planning import DetectabilityStudy, ModeVisibility, Plan, heaviest
from updater.quantities import Vector

_COLOURS = "viridis_r"
_BLIND, _LINE, _NAME, _FAINT = "#c62828", "#1565c0", "#37474f", "#cfd8dc"
_NAMED = 8  # members up to which each has its name at the curves
_USUAL, _BEYOND_USUAL = 0.9, 5.0  # share of the places, and times their most, that colours and curves reach up to
_SUBS = (1.0, 2.0, 5.0)
_TIMES = (10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 10800, 21600, 43200, 86400)  # s


def draw_map(figure: SubFigure, sight: ModeVisibility, outlook: DetectabilityStudy, planned: Plan | None) -> None:
    """Draw the smallest detectable masses on the structure and along the members, below them the target's records."""
    left, right = np.ravel(np.asarray(figure.subfigures(1, 2, width_ratios=(1, 1.25)), object))
    limits = _limits(sight, outlook)
    _coloured(left, sight, outlook, limits)
    unrolled = Unrolled(_places(outlook))
    curves = right.subplots(2 if planned else 1, 1, sharex=True, squeeze=False)[:, 0]
    _weakest(curves[0], sight, outlook, unrolled, limits)
    if planned:
        _records(curves[1], planned, unrolled)
    n = len(unrolled.length)
    label = "distance from each member's start [m]" if n <= _NAMED else f"{n} members, one after another"
    curves[-1].set_xlabel(label)


def _limits(sight: ModeVisibility, outlook: DetectabilityStudy) -> tuple[float, float]:
    """Return the masses between which colours and curves extend: next to a foot the smallest mass is unbounded."""
    top = heaviest(outlook)
    seen = sight.weakest[np.isfinite(sight.weakest)]  # without motion by any mode there is no limit
    most = min(_BEYOND_USUAL * float(np.quantile(seen, _USUAL)), top)
    return min(float(sight.weakest.min()), 0.5 * most), most


def _coloured(
    figure: SubFigure, sight: ModeVisibility, outlook: DetectabilityStudy, limits: tuple[float, float]
) -> None:
    axes = figure.add_subplot(projection="3d")
    frame_axes(axes, sight.model, 0.92)
    scale = ScalarMappable(LogNorm(*limits), _COLOURS)
    pairs = np.flatnonzero(outlook.member[1:] == outlook.member[:-1])
    mass = np.maximum(sight.weakest[pairs], sight.weakest[pairs + 1])
    colours = scale.to_rgba(np.minimum(mass, limits[1]))
    colours[mass > heaviest(outlook)] = to_rgba(_BLIND)
    segments = [outlook.point[[k, k + 1]] for k in pairs]
    axes.add_collection3d(Line3DCollection(segments, colors=colours, linewidths=_width(outlook, 7.0), capstyle="butt"))
    _extremes(axes, sight, outlook)
    more = "max" if mass.max() > limits[1] else "neither"
    bar = figure.colorbar(scale, ax=axes, shrink=0.7, pad=0.1, ticks=LogLocator(subs=_SUBS), extend=more)
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda mass, _: mass_words(mass)))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    figure.suptitle("Smallest detectable mass", fontsize=12)


def _width(outlook: DetectabilityStudy, width: float) -> float:
    """Return how wide lines are drawn: thinner where there are many members."""
    return width if outlook.member.max() < _NAMED else 0.45 * width


def _extremes(axes: Axes3D, sight: ModeVisibility, outlook: DetectabilityStudy) -> None:
    """Name the least of each member's masses."""
    for m in np.unique(outlook.member):
        here = np.flatnonzero(outlook.member == m)
        least = here[np.argmin(sight.weakest[here])]
        if len(np.unique(outlook.member)) <= _NAMED and np.isfinite(sight.weakest[least]):
            x, y, z = outlook.point[least] + [0, 0, 0.05 * size(sight.model)]
            axes.text(x, y, z, mass_words(float(sight.weakest[least])), fontsize=9, color=_NAME, ha="center")


def _places(outlook: DetectabilityStudy) -> Iterator[tuple[str, Vector]]:
    names = [member.name for member in outlook.reference.structure.member]
    for m, (x, y, z) in zip(outlook.member, outlook.point.tolist(), strict=True):
        yield names[m], (x, y, z)


def _weakest(
    axes: Axes, sight: ModeVisibility, outlook: DetectabilityStudy, unrolled: Unrolled, limits: tuple[float, float]
) -> None:
    """Draw the smallest detectable mass along the members, red on the axis where it exceeds the heaviest."""
    x, top = _along(outlook, unrolled), heaviest(outlook)
    for m in np.unique(outlook.member):
        here = outlook.member == m
        blind = sight.weakest[here] > top
        axes.plot(x[here], np.where(blind, np.nan, sight.weakest[here]), color=_LINE, linewidth=_width(outlook, 1.8))
        axes.plot(x[here], np.where(blind, limits[1], np.nan), color=_BLIND, linewidth=4, solid_capstyle="butt")
    axes.set(yscale="log", ylim=(0.8 * limits[0], 1.15 * limits[1]), ylabel="mass")
    axes.yaxis.set_major_locator(LogLocator(subs=_SUBS))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda mass, _: mass_words(mass)))
    record = outlook.record
    axes.set_title(
        f"{duration_words(record.seconds)} before and after, damping {100 * record.damping:g} %, "
        f"{len(outlook.frequency)} modes up to {record.highest:g} Hz; red: over {mass_words(top)}",
        fontsize=10,
    )
    _members(axes, unrolled)


def _records(axes: Axes, planned: Plan, unrolled: Unrolled) -> None:
    """Draw how long records must be for the target, red at the top where a day's do not suffice."""
    places, target = planned.present.places, planned.target
    seconds, longest = planned.present.seconds, float(planned.records[-1])
    x = _along(planned.outlook, unrolled)[places]
    found = np.isfinite(seconds)
    axes.plot(x[found], seconds[found], "o", color=_LINE, markersize=5)
    axes.plot(x[~found], np.full((~found).sum(), longest), "x", color=_BLIND, markersize=7)
    axes.set(yscale="log", ylim=(0.8 * float(planned.records[0]), 1.3 * longest), ylabel="record needed")
    axes.yaxis.set_major_locator(FixedLocator(_TIMES))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: duration_words(value)))
    axes.set_title(
        f"{mass_words(target.mass)} within {1000 * target.within:g} mm in {100 * target.chance:g} of 100 cases; "
        f"red: not even with {duration_words(longest)}",
        fontsize=10,
    )
    _members(axes, unrolled)


def _along(outlook: DetectabilityStudy, unrolled: Unrolled) -> FloatArray:
    return np.array([float(unrolled.along(name, np.array(at))) for name, at in _places(outlook)])


def _members(axes: Axes, unrolled: Unrolled) -> None:
    """Separate the members on the line."""
    axes.yaxis.set_minor_locator(NullLocator())
    axes.grid(axis="y", color=_FAINT, linewidth=0.6)
    if len(unrolled.length) > _NAMED:
        axes.set_xticks([])
        return
    places, labels = zip(*unrolled.ticks(), strict=True)
    axes.set_xticks(places, labels, fontsize=8)
    for name, length in unrolled.length.items():
        start = unrolled.offset[name]
        axes.axvspan(start, start + length, color=_FAINT, alpha=0.3, linewidth=0)
        middle = start + length / 2
        axes.text(middle, 0.97, name, transform=axes.get_xaxis_transform(), ha="center", va="top", fontsize=9)
