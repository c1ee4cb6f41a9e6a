"""Mode shapes in parallel projection: of the baseline, and of two states."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from daq import FloatArray
from monitor.results.state_comparison import StateComparison
from monitor.results.windows import ReferenceResult
from monitor.views.report.structure_figure import Frame
from monitor.views.report.svg import FAINT, INK, SENSOR, SOFT, bare, mode_colour, new_figure

_COLUMNS = 4
_SWAY = 0.14  # of the structure's size: the largest displacement
_ROOM = 0.02  # of its size, for the markers of sensors


def shapes_figure(reference: ReferenceResult) -> Figure | None:
    """Return one picture a mode: at rest, and displaced; None without displacements."""
    modes = [mode for mode in reference.modes if mode.displacement]
    if not modes:
        return None
    frame = Frame(reference)
    moved = [_SWAY * frame.geometry.size * np.array(mode.displacement, float) for mode in modes]
    figure, grid = _grid(frame, len(modes), moved)
    for axes, mode, motion in zip(grid, modes, moved, strict=False):
        _shape(axes, frame, mode.id, motion, f"Mode {mode.id}, {mode.frequency:.4g} Hz")
    return figure


def states_figure(reference: ReferenceResult, states: StateComparison) -> Figure | None:
    """Return one picture a mode: at rest, displaced now, and before (dashed); None without shapes at these nodes."""
    shapes = [one for one in states.shapes if one.now_moved.shape == (len(reference.nodes), 3)]
    if not shapes:
        return None
    frame = Frame(reference)
    sway = _SWAY * frame.geometry.size
    every = [sway * moved for one in shapes for moved in (one.before_moved, one.now_moved)]
    figure, grid = _grid(frame, len(shapes), every)
    for number, (axes, one) in enumerate(zip(grid, shapes, strict=False), 1):
        title = f"{number}: {one.frequency_before:.4g} -> {one.frequency:.4g} Hz"
        _shape(axes, frame, number, sway * one.now_moved, title)
        for strip in frame.geometry.strips(sway * one.before_moved):
            axes.plot(*frame.flat(strip).T, color=INK, linewidth=0.9, linestyle=(0, (4, 3)), zorder=2.5)
    return figure


def _grid(frame: Frame, n: int, moved: Sequence[FloatArray]) -> tuple[Figure, list[Axes]]:
    """Return a figure with n pictures in rows, with room for all displaced structures (n_nodes, 3)."""
    nodes, size = frame.geometry.nodes, frame.geometry.size
    points = frame.flat(np.concatenate([nodes, *(nodes + motion for motion in moved)]))
    low, high = points.min(0) - _ROOM * size, points.max(0) + _ROOM * size
    tall = float(np.clip(2.5 * (high - low)[1] / (high - low)[0], 1.2, 3.0))
    rows = math.ceil(n / _COLUMNS)
    figure = new_figure(10.0, (tall + 0.3) * rows)
    grid = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axes in grid:
        bare(axes)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    return figure, list(grid)


def _shape(axes: Axes, frame: Frame, number: int, moved: FloatArray, title: str) -> None:
    geometry = frame.geometry
    for rest, strip in zip(geometry.strips(), geometry.strips(moved), strict=True):
        axes.plot(*frame.flat(rest).T, color=FAINT, linewidth=1.5, zorder=1)
        axes.plot(*frame.flat(strip).T, color=mode_colour(number), linewidth=2, solid_capstyle="round", zorder=2)
    feet = frame.flat(geometry.nodes[geometry.held])
    axes.plot(*feet.T, linestyle="none", marker="^", markersize=5, color=SOFT, zorder=2)
    places = np.array([place for place, _ in frame.reference.sensors.values()]).reshape(-1, 3)
    nodes = np.unique(np.argmin(np.linalg.norm(geometry.nodes - places[:, None], axis=2), axis=1))
    axes.plot(*frame.flat(geometry.nodes[nodes] + moved[nodes]).T, "o", markersize=3.5, color=SENSOR, zorder=3)
    axes.set_title(title, fontsize=8.5)
