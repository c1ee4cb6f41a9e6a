"""Drawings of a diagnosis with axes of their own: evidence, MAC, frequencies, sensors."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.results.comparison import DiscrepancyResult
from monitor.text.quantities import plain
from monitor.views.member_axis import ticks
from monitor.views.palette import ALARM, DIM, FAINT, GREY, OK, SENSOR, TEXT, Colour
from monitor.views.viewer.primitives import Axes, text
from updater import Diagnosis

_WIDTH, _HEIGHT = 200.0, 110.0
BOUNDS = ((-40.0, 214.0), (-16.0, 132.0))  # of the drawings, x and y
_MOST = 11  # refused causes that are drawn, the nearest
_LEAST_EVIDENCE = 1.0  # of log evidence, from which the scale is logarithmic


def _panel(x_range: tuple[float, float], y_range: tuple[float, float]) -> Axes:
    return Axes(left=0.0, top=0.0, width=_WIDTH, height=_HEIGHT, x_range=x_range, y_range=y_range)


def draw_evidence(recording: rr.RecordingStream, diagnosis: Diagnosis) -> None:
    """Draw a bar a cause: how much less likely than the best explanation, on a logarithmic scale of log evidence."""
    accepted = " + ".join(dict.fromkeys(plain(c.cause) for c in diagnosis.causes))
    bars = [(accepted, 0.0)] if accepted else []
    bars += sorted(((plain(r.cause), -r.log_evidence) for r in diagnosis.rejected), key=lambda bar: bar[1])[:_MOST]
    if not bars:
        return
    far = np.log10(np.maximum([v for _, v in bars], _LEAST_EVIDENCE))
    most = max(1.0, float(np.ceil(far.max())))
    panel = _panel((0.0, most), (len(bars) - 0.4, -0.6))
    panel.grid(recording, "/evidence", {float(p): f"{10**p:g}" for p in range(int(most) + 1)}, {}, room=0.0)
    level: FloatArray = np.arange(float(len(bars)))
    _bars(recording, "/evidence/bars", panel, level, far, DIM)
    colours = [OK if accepted and i == 0 else TEXT for i in range(len(bars))]
    places = [[-20.0, float(panel.y(y)) - 4.0] for y in level]
    text(recording, "/evidence/names", places, [name for name, _ in bars], colours)


def _bars(
    recording: rr.RecordingStream, path: str, panel: Axes, level: FloatArray, value: FloatArray, colour: Colour
) -> None:
    """Draw bars from the left edge to values (n,) at levels (n,)."""
    half = 0.24 * abs(float(panel.y(1.0) - panel.y(0.0)))
    ends = np.maximum(panel.x(value) - half, panel.left + half)  # a strip's ends are round
    strips = [[[panel.left + half, y], [x, y]] for x, y in zip(ends.tolist(), panel.y(level).tolist(), strict=True)]
    recording.log(path, rr.LineStrips2D(strips, colors=[colour], radii=half, draw_order=1.0), static=True)


def draw_mac(recording: rr.RecordingStream, found: DiscrepancyResult) -> None:
    """Draw the MAC as a field of squares, values in them."""
    n_rows, n_columns = len(found.rows), len(found.columns)
    if not n_rows or not n_columns:
        return
    panel = _panel((0.0, float(n_columns)), (float(n_rows), 0.0))
    cells = [(i, k, 0.0 if v is None else v) for i, row in enumerate(found.mac) for k, v in enumerate(row)]
    value = np.array([v for _, _, v in cells])
    half = 0.48 * np.array([_WIDTH / n_columns, _HEIGHT / n_rows])
    at = np.array([[float(panel.x(k + 0.5)), float(panel.y(i + 0.5))] for i, k, _ in cells])
    low, high = np.array(FAINT, float), np.array(SENSOR, float)
    colours = (low + (high - low) * value[:, None]).astype(np.uint8)
    strips = [[[x - half[0] + half[1], y], [x + half[0] - half[1], y]] for x, y in at]
    recording.log("/mac/cells", rr.LineStrips2D(strips, colors=colours, radii=half[1], draw_order=1.0), static=True)
    written = [i for i, v in enumerate(value) if v >= 0.05]
    places = [[at[i][0], at[i][1] - 4.0] for i in written]
    text(recording, "/mac/values", places, [f"{value[i]:.3f}" for i in written], [TEXT])
    rows = [[-14.0, float(panel.y(i + 0.5)) - 4.0] for i in range(n_rows)]
    columns = [[float(panel.x(k + 0.5)), _HEIGHT + 1.0] for k in range(n_columns)]
    names = [f"{f:.4g} Hz" for f in (*found.rows, *found.columns)]
    text(recording, "/mac/names", [*rows, *columns], names, [GREY])


def draw_offsets(recording: rr.RecordingStream, found: DiscrepancyResult) -> None:
    """Draw each pair's frequency off the model in per cent: red without, green with the causes."""
    pairs = [m for m in found.modes if m.off_percent is not None]
    if not pairs:
        return
    before = np.array([m.off_percent for m in pairs], float)
    after = _column([m.off_percent_after for m in pairs])
    both = np.concatenate([before, after[np.isfinite(after)], [0.0]])
    room = 0.1 * float(np.ptp(both)) or 0.1
    panel = _panel((-0.5, len(pairs) - 0.5), (float(both.min()) - room, float(both.max()) + room))
    levels = {float(v): f"{v:g} %" for v in ticks(*panel.y_range, 5)}
    panel.grid(recording, "/offsets", {float(i): f"{m.measured:.4g}" for i, m in enumerate(pairs)}, levels, room=12.0)
    number: FloatArray = np.arange(float(len(pairs)))
    _dots(recording, "/offsets/without", panel.curve(number, before), ALARM)
    _dots(recording, "/offsets/with", panel.curve(number, after)[np.isfinite(after)], OK)


def _dots(recording: rr.RecordingStream, path: str, at: FloatArray, colour: Colour) -> None:
    dots = rr.Points2D(at, colors=[colour], radii=rr.Radius.ui_points(5.0), draw_order=20.0)
    recording.log(path, dots, static=True)


def _column(values: Sequence[float | None]) -> FloatArray:
    return np.array([np.nan if v is None else v for v in values], float)


def draw_sensors(recording: rr.RecordingStream, found: DiscrepancyResult) -> None:
    """Draw each sensor's residual in per cent over what noise leaves: red without, green with the causes."""
    if not found.sensors:
        return
    before = 100 * np.array([s.residual for s in found.sensors])
    after = 100 * _column([s.residual_after for s in found.sensors])
    noise = 100 * np.array([s.noise for s in found.sensors])
    most = 1.1 * max(float(before.max()), float(noise.max()), float(np.nanmax(after, initial=0.0)))
    panel = _panel((0.0, most), (len(before) - 0.4, -0.6))
    panel.grid(recording, "/sensors", {float(v): f"{v:g} %" for v in ticks(0.0, most, 6)}, {}, room=0.0)
    level: FloatArray = np.arange(float(len(before)))
    _bars(recording, "/sensors/noise", panel, level, noise, DIM)
    _dots(recording, "/sensors/without", panel.curve(before, level), ALARM)
    _dots(recording, "/sensors/with", panel.curve(after, level)[np.isfinite(after)], OK)
    places = [[-20.0, float(panel.y(y)) - 4.0] for y in level]
    text(recording, "/sensors/names", places, [s.channel for s in found.sensors], [TEXT])
