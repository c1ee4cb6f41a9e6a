"""Measured mode shapes on a structure: the deformed line at its extreme position over the line at rest."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from daq import FloatArray
from monitor.views.animation.drawing import Drawing, Motion
from monitor.views.geometry import screen
from monitor.views.plots.identification import LINE, STABLE
from oma import ModalEstimate
from updater.validation import ModelModes

_COLUMNS = 4
_WIDTH = 3.6  # inches of a picture
_ROOM = 0.06  # of the structure's size, around it
_TRIAD = 0.12  # of its size: arrows of the directions
_REST, _SUPPORT = "#c3cad3", "#2e7d32"
_ARROW = {"arrowstyle": "->", "color": LINE, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}


def plot_deformed_shapes(estimate: ModalEstimate, compared: ModelModes) -> Figure:
    """Draw all measured shapes, expanded to the nodes of the model.

    Parameters
    ----------
    estimate : measured modes
    compared : modes of the model that were compared with them
    """
    drawing = Drawing(estimate, Motion.of_model(estimate, compared))
    paper = np.column_stack(screen(drawing.towards))
    rest = drawing.points @ paper
    moved = [rest + extreme @ paper for extreme in map(_extreme, drawing.motion)]
    every = np.concatenate([rest, *moved])
    room = _ROOM * drawing.size
    low, high = every.min(0) - [room + 1.4 * _TRIAD * drawing.size, room], every.max(0) + room
    rows = -(-len(moved) // _COLUMNS)
    columns = min(_COLUMNS, len(moved))
    tall = float(np.clip(_WIDTH * (high - low)[1] / (high - low)[0], 1.5, 4.5))
    figure = Figure(figsize=(_WIDTH * columns, (tall + 0.5) * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    held = [support.at for support in compared.structure.support]
    feet = np.array(held, float).reshape(-1, 3) @ paper
    for axes in grid:
        axes.set_axis_off()
    for k, (axes, points) in enumerate(zip(grid, moved, strict=False)):
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_aspect("equal")
        axes.add_collection(LineCollection([rest[[a, b]] for a, b in drawing.spans], colors=_REST, linewidths=1.5))
        axes.add_collection(LineCollection([points[[a, b]] for a, b in drawing.ribs], colors=STABLE, linewidths=0.8))
        axes.add_collection(LineCollection([points[[a, b]] for a, b in drawing.spans], colors=STABLE, linewidths=2.0))
        axes.plot(*points[drawing.sensors].T, "o", markersize=4, color=LINE)
        axes.plot(*feet.T, "^", markersize=7, color=_SUPPORT)
        axes.set_title(drawing.labels[k], fontsize=9)
    _directions(grid[0], low + room + [0.3 * _TRIAD * drawing.size, 0.0], _TRIAD * drawing.size * paper)
    return figure


def _extreme(motion: FloatArray) -> FloatArray:
    """Return complex motions (n, 3) at the phase of their largest component."""
    largest = motion.ravel()[np.argmax(np.abs(motion))]
    return np.real(motion * np.conj(largest) / max(abs(largest), 1e-300))


def _directions(axes: Axes, origin: FloatArray, arms: FloatArray) -> None:
    """Draw the directions of the global axes (3, 2) at a point (2,)."""
    for name, arm in zip("xyz", arms, strict=True):
        (x, y), (tip_x, tip_y), (text_x, text_y) = (origin + share * arm for share in (0.0, 1.0, 1.25))
        axes.annotate("", (tip_x, tip_y), (x, y), arrowprops=_ARROW)
        axes.text(text_x, text_y, name, fontsize=8, color=LINE, ha="center", va="center")
