"""Animated mode shapes as a GIF."""

import math
from pathlib import Path

import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from daq import FloatArray
from monitor.views.animation.drawing import Drawing
from monitor.views.geometry import screen

_COLUMNS = 4
_WIDTH, _TITLE = 3.2, 0.45  # inches: of a picture, height of its title
_MIN_HEIGHT, _MAX_HEIGHT = 1.6, 4.8  # inches
_FRAMES = 24  # of a cycle
_PER_SECOND = 12
_DPI = 80
_ROOM = 0.02  # of the structure's size, for the markers of sensors
_REST, _MEMBER, _RIB, _SENSOR = "#b0bec5", "#2f6fcc", "#9dbbe6", "#1d2733"


def write_gif(path: Path, drawing: Drawing) -> None:
    """Write one cycle that repeats for ever, seen from one side.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    flat = np.column_stack(screen(drawing.towards))
    figure, axes = _grid(drawing, flat)
    pictures = [_Picture(axes[k], drawing, k, flat) for k in range(len(axes))]
    writer = PillowWriter(fps=_PER_SECOND)
    with writer.saving(figure, str(path), _DPI):
        for phase in np.arange(_FRAMES) / _FRAMES:
            for picture in pictures:
                picture.move(complex(np.exp(2j * np.pi * phase)))
            writer.grab_frame()


def _grid(drawing: Drawing, flat: FloatArray) -> tuple[Figure, list[Axes]]:
    """Return a figure with one picture per mode, all of one scale that holds the largest motions."""
    rest, reach = drawing.points @ flat, np.abs(drawing.motion @ flat).max(0) + _ROOM * drawing.size
    low, high = (rest - reach).min(0), (rest + reach).max(0)
    width, height = np.maximum(high - low, 0.02 * drawing.size)
    tall = min(_MAX_HEIGHT, max(_MIN_HEIGHT, _WIDTH * height / width))
    n = len(drawing.labels)
    columns = min(_COLUMNS, n)
    rows = math.ceil(n / columns)
    figure = Figure(figsize=(_WIDTH * columns, (tall + _TITLE) * rows))
    figure.subplots_adjust(0.01, 0.01, 0.99, 1 - _TITLE / figure.get_figheight(), 0.04, _TITLE / tall)
    found = [figure.add_subplot(rows, columns, k + 1) for k in range(n)]
    for axes, label in zip(found, drawing.labels, strict=True):
        axes.set_axis_off()
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set_title(label, fontsize=9, pad=3)
    return figure, found


class _Picture:
    """One mode in its axes; `flat` (3, 2) are the directions right and up."""

    def __init__(self, axes: Axes, drawing: Drawing, mode: int, flat: FloatArray) -> None:
        self._rest, self._motion = drawing.points @ flat, drawing.motion[mode] @ flat
        self._spans, self._ribs = np.array(drawing.spans), np.array(drawing.ribs, int).reshape(-1, 2)
        self._sensors = drawing.sensors
        axes.add_collection(LineCollection(list(self._rest[self._spans]), colors=_REST, linewidths=1.0))
        self._moving = [
            LineCollection([], colors=_RIB, linewidths=1.0),
            LineCollection([], colors=_MEMBER, linewidths=2.2, capstyle="round"),
        ]
        for lines in self._moving:
            axes.add_collection(lines)
        (self._dots,) = axes.plot([], [], "o", markersize=4, color=_SENSOR)

    def move(self, turn: complex) -> None:
        """Show the motion at a phase, exp(i phase)."""
        now = self._rest + (self._motion * turn).real
        for lines, pairs in zip(self._moving, (self._ribs, self._spans), strict=True):
            lines.set_segments(list(now[pairs]))
        self._dots.set_data(*now[self._sensors].T)
