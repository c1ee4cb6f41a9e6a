"""A structure drawn: members, supports, joints, bodies, sensors, and its first modes."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from daq import FloatArray
from monitor.sight import Sight

_COLUMNS = 3  # of modes
_MEMBER, _STILL, _SENSOR, _SUPPORT, _BODY, _JOINT = "#37474f", "#b0bec5", "#1565c0", "#2e7d32", "#c62828", "#ef6c00"
_SWAY = 0.12  # largest displacement drawn, as a share of the structure's size
_LABELS = 30  # sensors up to which each has its name


def draw_structure(sight: Sight, path: Path, n_modes: int = 6) -> None:
    """Write a PNG: the structure at the left, its first modes at the right."""
    n = min(n_modes, len(sight.modes.frequency))
    rows = -(-n // _COLUMNS)
    figure = Figure(figsize=(15, 7.5), layout="constrained")
    left, right = np.ravel(np.asarray(figure.subfigures(1, 2, width_ratios=(1, 1.25)), object))
    _draw_parts(_axes(left.add_subplot(projection="3d"), sight, 0.92), sight)
    left.suptitle(sight.model.structure.name, fontsize=13)
    for k in range(n):
        axes = _axes(right.add_subplot(rows, _COLUMNS, k + 1, projection="3d"), sight, 1.2)
        axes.set_axis_off()
        _draw_mode(axes, sight, k)
    figure.savefig(path, dpi=110)


def _axes(axes: Axes3D, sight: Sight, zoom: float) -> Axes3D:
    """Give all three axes the same scale."""
    low, high = sight.model.nodes.min(axis=0), sight.model.nodes.max(axis=0)
    margin = 1.3 * _SWAY * _size(sight)
    low, high = low - margin, high + margin
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_xlabel("x [m]", labelpad=8)
    axes.set_ylabel("y [m]", labelpad=8)
    axes.set_zlabel("z [m]", labelpad=4)
    axes.set_box_aspect(high - low, zoom=zoom)
    axes.tick_params(labelsize=7)
    axes.view_init(elev=18, azim=-55)
    axes.locator_params(nbins=4)
    return axes


def _size(sight: Sight) -> float:
    return float(np.ptp(sight.model.nodes, axis=0).max())


def _lines(axes: Axes3D, nodes: FloatArray, spans: list[tuple[int, int]], colour: str, width: float) -> None:
    axes.add_collection3d(Line3DCollection([nodes[[a, b]] for a, b in spans], colors=colour, linewidths=width))


def _draw_parts(axes: Axes3D, sight: Sight) -> None:
    structure, size = sight.model.structure, _size(sight)
    _lines(axes, sight.model.nodes, sight.model.spans, _MEMBER, 2.5)
    for label, colour, marker, places in (
        ("support", _SUPPORT, "^", [s.at for s in structure.support]),
        ("joint", _JOINT, "o", [j.at for j in structure.joint]),
        ("body", _BODY, "s", [tuple(np.add(b.at, b.offset)) for b in structure.body]),
    ):
        if places:
            x, y, z = np.array(places, float).T
            axes.scatter(x, y, z, c=colour, marker=marker, s=90, label=label, depthshade=False)
    if structure.sensor:
        at = np.array([s.at for s in structure.sensor])
        way = np.array([np.asarray(s.direction) / np.linalg.norm(s.direction) for s in structure.sensor])
        tip = at + 0.07 * size * way
        axes.quiver(*at.T, *(tip - at).T, color=_SENSOR, linewidth=1.5, arrow_length_ratio=0.35, label="sensor")
        for sensor, place in zip(structure.sensor[:_LABELS], at + 0.09 * size * way, strict=False):
            axes.text(*place, sensor.channel, fontsize=7, color=_SENSOR)
    axes.legend(loc="upper left", fontsize=8)


def _draw_mode(axes: Axes3D, sight: Sight, k: int) -> None:
    nodes, spans = sight.model.nodes, sight.model.spans
    _lines(axes, nodes, spans, _STILL, 1.0)
    _lines(axes, nodes + _SWAY * _size(sight) * sight.motion[k], spans, _MEMBER, 2.0)
    colour = "black" if sight.is_seen(k) else _BODY
    note = "" if sight.is_seen(k) else "\nno sensor sees it"
    axes.set_title(f"{k + 1}: {sight.modes.frequency[k]:.2f} Hz{note}", fontsize=10, color=colour, pad=-4)
