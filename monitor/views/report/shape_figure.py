"""Mode shapes of the baseline in parallel projection."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from daq import FloatArray
from monitor.results.windows import ReferenceMode, ReferenceResult
from monitor.views.report.structure_figure import Frame
from monitor.views.report.svg import FAINT, SENSOR, bare, mode_colour, new_figure

_COLUMNS = 4
_SWAY = 0.14  # of the structure's size: the largest displacement
_ROOM = 0.02  # of its size, for the markers of sensors


def shapes_figure(reference: ReferenceResult) -> Figure | None:
    """Return one picture a mode: at rest, and displaced; None without displacements."""
    modes = [mode for mode in reference.modes if mode.displacement]
    if not modes:
        return None
    frame, rows = Frame(reference), math.ceil(len(modes) / _COLUMNS)
    nodes, size = frame.geometry.nodes, frame.geometry.size
    moved = [_SWAY * size * np.array(mode.displacement, float) for mode in modes]
    points = frame.flat(np.concatenate([nodes, *(nodes + motion for motion in moved)]))
    low, high = points.min(0) - _ROOM * size, points.max(0) + _ROOM * size
    tall = float(np.clip(2.5 * (high - low)[1] / (high - low)[0], 1.2, 3.0))
    figure = new_figure(10.0, (tall + 0.3) * rows)
    grid = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axes in grid:
        bare(axes)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    for axes, mode, motion in zip(grid, modes, moved, strict=False):
        _shape(axes, frame, mode, motion)
    return figure


def _shape(axes: Axes, frame: Frame, mode: ReferenceMode, moved: FloatArray) -> None:
    geometry = frame.geometry
    for rest, strip in zip(geometry.strips(), geometry.strips(moved), strict=True):
        axes.plot(*frame.flat(rest).T, color=FAINT, linewidth=1.5, zorder=1)
        axes.plot(*frame.flat(strip).T, color=mode_colour(mode.id), linewidth=2, solid_capstyle="round", zorder=2)
    places = np.array([place for place, _ in frame.reference.sensors.values()]).reshape(-1, 3)
    nodes = np.unique(np.argmin(np.linalg.norm(geometry.nodes - places[:, None], axis=2), axis=1))
    axes.plot(*frame.flat(geometry.nodes[nodes] + moved[nodes]).T, "o", markersize=3.5, color=SENSOR, zorder=3)
    axes.set_title(f"Mode {mode.id}, {mode.frequency:.4g} Hz", fontsize=8.5)
