"""A structure drawn: members, supports, joints, bodies, sensors, first modes, and the smallest detectable mass."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, to_rgba
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from daq import FloatArray
from monitor.text.quantities import duration_words, mass_words
from monitor.views.member_axis import Unrolled
from updater import Model
from updater.planning import DetectabilityStudy, ModeVisibility, Plan, heaviest
from updater.quantities import Vector
from updater.structure import Structure, Support

_COLUMNS = 3  # of modes
_MOTIONS = 6  # that a support can hold
_MEMBER, _STILL, _SENSOR, _SUPPORT, _BODY, _JOINT = "#37474f", "#b0bec5", "#1565c0", "#2e7d32", "#6d4c41", "#ef6c00"
_SEGMENT, _NOT_MEASURED = "#8e24aa", "#c62828"
_LEAST_HEIGHT, _MODE_HEIGHT, _MAP_HEIGHT = 7.5, 2.5, 7.0  # inches
_UPRIGHT = 0.7  # sine of the slope from which a member is upright
_LABELS = 30  # sensors up to which each has its name
_COLOURS = "viridis_r"
_BLIND, _LINE, _NAME, _FAINT = "#c62828", "#1565c0", "#37474f", "#cfd8dc"
_BACKGROUND = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}  # of a text over coloured lines
_NAMED = 8  # members up to which each has its name at the curves
_USUAL, _BEYOND_USUAL = 0.9, 5.0  # share of the places, and times their most, that colours and curves reach up to
_SUBS = (1.0, 2.0, 5.0)
_TIMES = (10, 20, 60, 120, 300, 600, 1200, 3600, 7200, 21600, 86400)  # s; further apart than their labels are high
_TICKS = 4  # along the longest side
_ARROW = 0.07  # length of a sensor's arrow, as a share of the structure's size
SWAY = 0.12  #: largest displacement drawn, as a share of the structure's size


def draw_structure(sight: ModeVisibility, path: Path, planned: Plan | None = None, n_modes: int = 12) -> None:
    """Write a PNG: the structure at the left, its first modes at the right; below them the detectability of a mass."""
    n = min(n_modes, len(sight.modes.frequency))
    rows = -(-n // _COLUMNS)
    tall = max(_LEAST_HEIGHT, _MODE_HEIGHT * rows)
    figure = Figure(figsize=(15, tall + (_MAP_HEIGHT if sight.outlook else 0.0)), layout="constrained")
    upper = figure
    if sight.outlook:
        parts = figure.subfigures(2, 1, height_ratios=(tall, _MAP_HEIGHT))
        upper, lower = np.ravel(np.asarray(parts, object))
        draw_map(lower, sight, sight.outlook, planned)
    left, right = np.ravel(np.asarray(upper.subfigures(1, 2, width_ratios=(1, 1.25)), object))
    _draw_parts(frame_axes(left.add_subplot(projection="3d"), sight.model, 0.92), sight)
    left.suptitle(sight.model.structure.name, fontsize=13)
    for k in range(n):
        axes = frame_axes(right.add_subplot(rows, _COLUMNS, k + 1, projection="3d"), sight.model, 1.25)
        axes.set_axis_off()
        _draw_mode(axes, sight, k)
    figure.savefig(path, dpi=110)


def _draw_parts(axes: Axes3D, sight: ModeVisibility) -> None:
    structure, extent = sight.model.structure, size(sight.model)
    lines(axes, sight.model.nodes, sight.model.spans, _MEMBER, 2.5)
    segments = [(m, ends) for m in structure.member for *ends, _ in structure.segments_of(m)]
    for number, (member, ends) in enumerate(segments):
        x, y, z = member.point(np.array(ends)).T
        axes.plot(x, y, z, color=_SEGMENT, linewidth=7, solid_capstyle="butt", label="" if number else "segment")
    for label, colour, marker, places in (
        ("support", _SUPPORT, "^", [s.at for s in structure.support]),
        ("joint", _JOINT, "o", [j.at for j in structure.joint]),
        ("body", _BODY, "s", [tuple(np.add(b.at, b.offset)) for b in structure.body]),
        ("oscillator", _BODY, "D", [o.at for o in structure.oscillator]),
    ):
        if places:
            x, y, z = np.array(places, float).T
            axes.scatter(x, y, z, c=colour, marker=marker, s=90, label=label, depthshade=False)
    if structure.sensor:
        at = np.array([s.at for s in structure.sensor])
        way = np.array([np.asarray(s.direction) / np.linalg.norm(s.direction) for s in structure.sensor])
        tip = at + _ARROW * extent * way
        axes.quiver(*at.T, *(tip - at).T, color=_SENSOR, linewidth=1.5, arrow_length_ratio=0.35, label="sensor")
        _label_sensors(axes, structure, extent)
    for support in structure.support[:_LABELS]:
        x, y, z = support.at
        axes.text(x, y, z - 0.06 * extent, _held(support), fontsize=7, color=_SUPPORT, ha="center", va="top")
    if axes.get_legend_handles_labels()[0]:  # a model without sensors has nothing to name
        axes.legend(loc="upper left", fontsize=8)


def _label_sensors(axes: Axes3D, structure: Structure, extent: float) -> None:
    """Write the channels of each place once: to the right of an upright member, above the arrows of another."""
    channels: dict[Vector, list[str]] = {}
    for sensor in structure.corrected_sensors[:_LABELS]:
        channels.setdefault(sensor.at, []).append(sensor.channel)
    for (x, y, z), names in channels.items():
        members = (m for m in structure.member if m.passes((x, y, z)))
        if any(abs(m.end[2] - m.start[2]) > _UPRIGHT * m.length for m in members):
            text = "\n" + "\n".join(f"    {name}" for name in names)
            axes.text(x, y, z, text, fontsize=7, color=_SENSOR, va="top", ha="left")
        else:
            above = z + (_ARROW + 0.02) * extent
            axes.text(x, y, above, "\n".join(names), fontsize=7, color=_SENSOR, va="bottom", ha="center")


def _held(support: Support) -> str:
    """Return which motions a support restrains, and which have springs."""
    fixed = "fixed" if len(support.fixed) == _MOTIONS else " ".join(support.fixed)
    springs = " ".join(support.stiffness)
    return "\n".join(part for part in (fixed, f"springs {springs}" if springs else "") if part)


def _draw_mode(axes: Axes3D, sight: ModeVisibility, k: int) -> None:
    nodes, spans = sight.model.nodes, sight.model.spans
    lines(axes, nodes, spans, _STILL, 1.0)
    lines(axes, nodes + SWAY * size(sight.model) * sight.motion[k], spans, _MEMBER, 2.0)
    colour = "black" if sight.is_seen(k) else _NOT_MEASURED
    note = "" if sight.is_seen(k) else "\nnot measured by any sensor"
    axes.set_title(f"{k + 1}: {sight.modes.frequency[k]:.2f} Hz{note}", fontsize=10, color=colour, pad=-4)


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
            text = mass_words(float(sight.weakest[least]))
            axes.text(x, y, z, text, fontsize=9, color=_NAME, ha="center", bbox=_BACKGROUND)


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


def size(model: Model) -> float:
    """Return the structure's largest extent [m]."""
    return float(np.ptp(model.nodes, axis=0).max())


def frame_axes(axes: Axes3D, model: Model, zoom: float) -> Axes3D:
    """Give all three axes the same scale, with room for the motion."""
    low, high = model.nodes.min(axis=0), model.nodes.max(axis=0)
    margin = 1.3 * SWAY * size(model)
    low, high = low - margin, high + margin
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_xlabel("x [m]", labelpad=8)
    axes.set_ylabel("y [m]", labelpad=8)
    axes.set_zlabel("z [m]", labelpad=4)
    axes.set_box_aspect(high - low, zoom=zoom)
    axes.tick_params(labelsize=7)
    axes.view_init(elev=18, azim=-55)
    for axis, extent in zip((axes.xaxis, axes.yaxis, axes.zaxis), high - low, strict=True):
        axis.set_major_locator(MaxNLocator(max(1, round(_TICKS * extent / (high - low).max()))))
    return axes


def lines(axes: Axes3D, nodes: FloatArray, spans: list[tuple[int, int]], colour: str, width: float) -> None:
    """Draw the elements between nodes (n_nodes, 3)."""
    axes.add_collection3d(Line3DCollection([nodes[[a, b]] for a, b in spans], colors=colour, linewidths=width))
