"""Mode shapes before and after a change, at the channels."""

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.results.state_comparison import ModeShapes, StateComparison
from monitor.views.palette import DIM, GREY, OK, SENSOR, TEXT
from monitor.views.viewer.primitives import bars, text
from oma import mac_matrix

_COLUMN, _ROW = 100.0, 24.0  # of a mode, and of a channel
_NAMES, _HEAD = 130.0, 58.0  # room for the names of channels at the left, and for those of modes at the top
_LONGEST, _BAR, _POINT = 42.0, 4.0, 2.2


def shapes_bounds(states: StateComparison) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the bounds of the drawing, x and y."""
    return (-_NAMES, _COLUMN * len(states.shapes)), (-_HEAD, _ROW * len(states.channels) + 4.0)


def draw_state_shapes(recording: rr.RecordingStream, states: StateComparison) -> None:
    """Draw a column per mode: bars before, points now, and marks with the causes."""
    n = len(states.channels)
    y: FloatArray = _ROW * (np.arange(float(n)) + 0.5)
    rows = [[-_NAMES / 2, at - 9.0] for at in y.tolist()]
    text(recording, "/state_shapes/channels", rows, states.channels, [GREY])
    middles = _COLUMN * (np.arange(len(states.shapes)) + 0.5)
    for name, top, label in (("modes", -_HEAD + 2.0, _frequencies), ("mac", -_HEAD + 24.0, _macs)):
        heads = [[x, top] for x in middles.tolist()]
        colour = TEXT if name == "modes" else GREY
        text(recording, f"/state_shapes/{name}", heads, [label(mode) for mode in states.shapes], [colour])
    zeros = [[[x, 0.0], [x, _ROW * n]] for x in middles.tolist()]
    recording.log("/state_shapes/zero", rr.LineStrips2D(zeros, colors=[DIM], draw_order=1.0), static=True)
    before = [
        (x, x + _LONGEST * value, at)
        for x, mode in zip(middles.tolist(), states.shapes, strict=True)
        for at, value in zip(y.tolist(), mode.before.tolist(), strict=True)
    ]
    bars(recording, "/state_shapes/before", before, _BAR, [GREY] * len(before))
    found = [(x, mode.with_causes) for x, mode in zip(middles, states.shapes, strict=True)]
    places = [place for x, shape in found if shape is not None for place in _places(x, shape, y).tolist()]
    ticks = [[[a, b - 1.8 * _BAR], [a, b + 1.8 * _BAR]] for a, b in places]
    causes = rr.LineStrips2D(ticks, colors=[OK], radii=rr.Radius.ui_points(1.4), draw_order=15.0)
    recording.log("/state_shapes/with_causes", causes, static=True)
    points = [_places(x, mode.now, y) for x, mode in zip(middles, states.shapes, strict=True)]
    now = rr.Points2D(np.concatenate(points), colors=[SENSOR], radii=_POINT, draw_order=20.0)
    recording.log("/state_shapes/now", now, static=True)


def _places(x: float, shape: FloatArray, y: FloatArray) -> FloatArray:
    """Return the ends (n_channels, 2) of the bars of a shape."""
    return np.column_stack([x + _LONGEST * shape, y])


def _frequencies(mode: ModeShapes) -> str:
    return f"{mode.frequency_before:#.4g} -> {mode.frequency:#.4g} Hz"


def _macs(mode: ModeShapes) -> str:
    """Return the MAC of the measured shape with that before, and with the one with the causes."""
    others = [mode.before] if mode.with_causes is None else [mode.before, mode.with_causes]
    return "MAC " + " -> ".join(f"{float(mac_matrix(shape[None], mode.now[None])[0, 0]):.4f}" for shape in others)
