"""A structure drawn: members, supports, joints, bodies, sensors, and its first modes."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.axes3d import Axes3D

from monitor.views.plots.axes3d import SWAY, frame_axes, lines, size
from monitor.views.plots.mass_map import draw_map
from updater.planning import ModeVisibility, Plan
from updater.quantities import Vector
from updater.structure import Structure, Support

_COLUMNS = 3  # of modes
_MOTIONS = 6  # that a support can hold
_MEMBER, _STILL, _SENSOR, _SUPPORT, _BODY, _JOINT = "#37474f", "#b0bec5", "#1565c0", "#2e7d32", "#6d4c41", "#ef6c00"
_SEGMENT, _NOT_MEASURED = "#8e24aa", "#c62828"
_LEAST_HEIGHT, _MODE_HEIGHT, _MAP_HEIGHT = 7.5, 2.5, 7.0  # inches
_UPRIGHT = 0.7  # sine of the slope from which a member is upright
_LABELS = 30  # sensors up to which each has its name


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
        tip = at + 0.07 * extent * way
        axes.quiver(*at.T, *(tip - at).T, color=_SENSOR, linewidth=1.5, arrow_length_ratio=0.35, label="sensor")
        _label_sensors(axes, structure, extent)
    for support in structure.support[:_LABELS]:
        x, y, z = support.at
        axes.text(x, y, z - 0.06 * extent, _held(support), fontsize=7, color=_SUPPORT, ha="center", va="top")
    if axes.get_legend_handles_labels()[0]:  # a model without sensors has nothing to name
        axes.legend(loc="upper left", fontsize=8)


def _label_sensors(axes: Axes3D, structure: Structure, extent: float) -> None:
    """Write the channels of each place once: beside an upright member, below another."""
    channels: dict[Vector, list[str]] = {}
    for sensor in structure.corrected_sensors[:_LABELS]:
        channels.setdefault(sensor.at, []).append(sensor.channel)
    for (x, y, z), names in channels.items():
        members = (m for m in structure.member if m.passes((x, y, z)))
        if any(abs(m.end[2] - m.start[2]) > _UPRIGHT * m.length for m in members):
            text = "\n" + "\n".join(f"    {name}" for name in names)
            axes.text(x, y, z, text, fontsize=7, color=_SENSOR, va="top", ha="left")
        else:
            axes.text(x, y, z - 0.03 * extent, "\n".join(names), fontsize=7, color=_SENSOR, va="top", ha="center")


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
