"""Mode shapes: bars, one per channel, or arrows at the sensors of a structure."""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from daq import FloatArray
from daq.notebook import number_text
from oma.plots.diagrams import LINE, STABLE, Modes

_BARS_IN_ROW = 6  # shapes in a row below the diagram
_MAX_SHAPES = 24  # modes whose shapes are drawn below the diagram
_COLUMNS = 4
_NAMES = 20  # of channels, below a shape
_SWAY = 0.2  # of the structure's size: the longest arrow

Vector = tuple[float, float, float]


class Skeleton(Protocol):
    """Structure that shapes are drawn on; `updater.Structure` is one."""

    @property
    def axis_lines(self) -> FloatArray:
        """Ends (n_lines, 2, 3) of the straight lines to draw [m]."""

    @property
    def measuring_axes(self) -> Mapping[str, tuple[Vector, Vector]]:
        """Channel -> position of its sensor [m], and its direction, of any length."""


def figure_of_modes(estimate: Modes) -> tuple[Figure, Axes]:
    """Return a figure of the shapes as bars, and the axes above them, for a diagram."""
    n = min(_MAX_SHAPES, estimate.n_modes)
    columns = min(_BARS_IN_ROW, n)
    rows = -(-n // columns)
    figure = Figure(figsize=(14, 5.7 + 3.3 * rows), layout="constrained")
    grid = figure.add_gridspec(1 + rows, columns, height_ratios=(1.7, *[1.0] * rows))
    diagram = figure.add_subplot(grid[0, :])
    if n < estimate.n_modes:
        diagram.set_title(f"shapes of modes 1 to {n} of {estimate.n_modes} below")
    shapes = [figure.add_subplot(grid[1 + k // columns, k % columns]) for k in range(n)]
    for k, axes in enumerate(shapes):
        axes.sharey(shapes[0])
        _draw_bars(axes, estimate, k)
    return figure, diagram


def shapes_figure(estimate: Modes, skeleton: Skeleton | None = None) -> Figure:
    """Draw all mode shapes: as arrows at the sensors of a structure; without one as bars, one per channel."""
    columns = min(_COLUMNS, estimate.n_modes)
    rows = -(-estimate.n_modes // columns)
    figure = Figure(figsize=(3.6 * columns, (4.0 if skeleton else 3.2) * rows), layout="constrained")
    highest = 1.1 * float(np.abs(estimate.shape.real).max())
    for k in range(estimate.n_modes):
        if skeleton:
            axes = figure.add_subplot(rows, columns, k + 1, projection="3d")
            assert isinstance(axes, Axes3D)
            _draw_arrows(axes, estimate, k, skeleton)
        else:
            bars = figure.add_subplot(rows, columns, k + 1)
            _draw_bars(bars, estimate, k)
            bars.set_ylim(-highest, highest)
    return figure


def _draw_bars(axes: Axes, estimate: Modes, k: int) -> None:
    """Draw one shape as bars, with two standard deviations each way."""
    place = np.arange(len(estimate.channels))
    axes.bar(place, estimate.shape[k].real, yerr=2 * estimate.shape_std[k], color=STABLE, ecolor=LINE, capsize=2)
    axes.axhline(0, color=LINE, linewidth=0.6)
    named = place[:: -(-len(place) // _NAMES)]
    axes.set_xticks(named, [estimate.channels[i] for i in named], rotation=90, fontsize=7)
    axes.tick_params(axis="y", labelsize=7)
    axes.set_title(_title(estimate, k), fontsize=9)


def _title(estimate: Modes, k: int) -> str:
    return (
        f"{k + 1}: {number_text(estimate.frequency[k], estimate.frequency_std[k])} Hz\n"
        f"{number_text(100 * estimate.damping[k], 100 * estimate.damping_std[k])} %"
    )


def _draw_arrows(axes: Axes3D, estimate: Modes, k: int, skeleton: Skeleton) -> None:
    """Draw the lines, and at each place with sensors how it moves."""
    axes.add_collection3d(Line3DCollection(list(skeleton.axis_lines), colors=LINE, linewidths=1.0, alpha=0.6))
    motion: dict[Vector, FloatArray] = {}
    for channel, (at, direction) in skeleton.measuring_axes.items():
        if channel in estimate.channels:
            way = np.array(direction) / np.linalg.norm(direction)
            value = estimate.shape[k, estimate.channels.index(channel)].real
            motion[at] = motion.get(at, np.zeros(3)) + value * way
    points = np.concatenate([skeleton.axis_lines.reshape(-1, 3), np.array(list(motion))])
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max()) or 1.0
    longest = max(float(np.linalg.norm(m)) for m in motion.values()) or 1.0
    for at, moved in motion.items():
        axes.quiver(*at, *(_SWAY * size / longest * moved), color=STABLE, linewidth=1.8, arrow_length_ratio=0.3)
    margin = 1.2 * _SWAY * size
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
    axes.set_zlim(low[2], high[2] + margin)
    axes.set_box_aspect((*(high - low + 2 * margin)[:2], (high - low)[2] + margin), zoom=1.2)
    axes.view_init(elev=18, azim=-55)
    axes.set_axis_off()
    axes.set_title(_title(estimate, k), fontsize=9)
