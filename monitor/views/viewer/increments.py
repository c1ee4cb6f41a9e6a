"""The one-step update's increments: on the structure and along the members, a picture a direction."""

import itertools
import textwrap
from collections.abc import Sequence

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.results.run_results import RunResults, thin
from monitor.results.windows import MassIncrements
from monitor.text.causes import place_text
from monitor.views.geometry import Geometry
from monitor.views.member_axis import Unrolled, ticks
from monitor.views.palette import ALARM, DIM, GREY, REGION, SENSOR, TEXT, signed_heat
from monitor.views.viewer.components import write_increments
from monitor.views.viewer.primitives import Axes, at, once, readable_ticks, text
from monitor.views.viewer.scene import SIDE, TUBE, supports

DIRECTIONS = ("x", "y", "z")
BOUNDS = ((-24.0, 236.0), (-32.0, 142.0))  # of the drawing, x and y
_WIDTH, _HEIGHT, _BETWEEN = 200.0, 34.0, 12.0
LABEL = 0.2  # of the structure's size, from a flagged node up to its label
_PALE = 0.25  # share of the level whose colour a member has where its increment is not significant
_LABEL_WIDTH = 28  # characters
_NAME_ROWS, _ROW_HEIGHT = 3, 8.5  # of the names of members
_CHARACTER = 2.7  # width of a character in the drawing, at its usual size on a screen
_BAR, _BAR_STEPS = 212.0, 24  # place of the colour bar, and number of its colours
_ROOM = 1.15  # of the largest increment: half the height of a panel
Row = tuple[float | None, float | None, float | None]


def draw_increments(recording: rr.RecordingStream, run_results: RunResults, *, static: bool = True) -> None:
    """Draw the detections of the one-step update per window; axes for ever, or for now if not `static`."""
    found = thin([(w.end, w.increments) for w in run_results.windows if w.increments])
    if run_results.reference is None or not found:
        return
    geometry = Geometry(run_results.reference)
    unrolled = Unrolled((m, run_results.reference.nodes[n]) for m, nodes in geometry.lines.items() for n in nodes)
    scale, unit = run_results.mass_unit
    largest = scale * max(float(np.nanmax(np.abs(numbers(i.normalised)), initial=0.0)) for _, i in found) or 1.0
    panels = [_panel(unrolled, row, largest) for row in range(len(DIRECTIONS))]
    _frames(recording, unrolled, panels, unit, static=static)
    _colour_bar(recording, panels, largest, unit, static=static)
    for direction in DIRECTIONS:
        once(recording, f"/increments/{direction}", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        supports(recording, f"/increments/{direction}", geometry)
    for time, increments in found:
        at(recording, time)
        for column, direction in enumerate(DIRECTIONS):
            _scene(recording, geometry, increments, column, scale, largest)
            _curves(recording, geometry, unrolled, panels[column], increments, f"/increment_curves/{direction}", scale)
            write_increments(recording, column, f"/increment_curves/{direction}", increments)


def numbers(rows: Sequence[Row]) -> FloatArray:
    """Return rows as (n_nodes, 3), not-a-number where there is none."""
    return np.array([[np.nan if v is None else v for v in row] for row in rows], float).reshape(-1, 3)


def _scene(
    recording: rr.RecordingStream,
    geometry: Geometry,
    increments: MassIncrements,
    column: int,
    scale: float,
    largest: float,
) -> None:
    """Draw the members, red where mass was added, blue where removed, flagged nodes, and the place of the change."""
    base, values = f"/increments/{DIRECTIONS[column]}", scale * numbers(increments.normalised)[:, column]
    pairs = [pair for nodes in geometry.lines.values() for pair in itertools.pairwise(nodes)]
    flagged = [f for f in increments.flagged if f.direction == DIRECTIONS[column]]
    is_flagged = np.isin(np.arange(len(values)), [f.node for f in flagged])
    level = np.array([np.mean(values[list(pair)]) for pair in pairs]) / largest
    sharp = np.array([is_flagged[list(pair)].any() for pair in pairs])
    colours = signed_heat(np.where(sharp, level, _PALE * level))
    segments = [geometry.nodes[list(pair)] for pair in pairs]
    tube = TUBE * geometry.size
    members = rr.LineStrips3D(segments, colors=colours, radii=np.where(sharp, 1.6, 0.8) * tube)
    recording.log(f"{base}/members", members)
    places = geometry.nodes[[f.node for f in flagged]].reshape(-1, 3) + 2.2 * tube * geometry.side(*SIDE)
    recording.log(f"{base}/flagged", rr.Points3D(places, radii=0.7 * tube, colors=[REGION]))
    named = increments.place if flagged else None
    top = geometry.nodes[np.argmax(geometry.nodes[:, 2])]
    under = np.array(named.position if named and named.located else top)
    above = (under + np.array([0, 0, LABEL * geometry.size]))[None] if named else np.empty((0, 3))
    labels = [textwrap.fill(place_text(named), _LABEL_WIDTH)] if named else []
    label = rr.Points3D(above, radii=0.0, colors=[TEXT], labels=labels, show_labels=True)
    recording.log(f"{base}/flagged/names", label)
    region = [[part.start, part.end] for part in named.region] if named and named.fits else []
    recording.log(f"{base}/flagged/region", rr.LineStrips3D(region, colors=[REGION], radii=2.0 * tube))


def _panel(unrolled: Unrolled, row: int, largest: float) -> Axes:
    span = (-_ROOM * largest, _ROOM * largest)
    top = row * (_HEIGHT + _BETWEEN)
    return Axes(left=0.0, top=top, width=_WIDTH, height=_HEIGHT, x_range=(0.0, unrolled.total), y_range=span)


def _frames(recording: rr.RecordingStream, unrolled: Unrolled, panels: list[Axes], unit: str, *, static: bool) -> None:
    x = readable_ticks(panels[-1], unrolled.ticks(), _CHARACTER)
    for direction, panel in zip(DIRECTIONS, panels, strict=True):
        below = x if direction == DIRECTIONS[-1] else dict.fromkeys(x, "")
        levels = {float(v): f"{v:g} {unit}" for v in ticks(*panel.y_range, 4)}
        panel.grid(recording, f"/increment_curves/{direction}", below, levels, room=11.0, static=static)
        text(recording, f"/increment_curves/{direction}/name", [[6.0, panel.top + 1.0]], [direction], [TEXT])
    names = unrolled.names(_CHARACTER * unrolled.total / _WIDTH, _NAME_ROWS)
    places = [[float(panels[0].x(middle)), -9.0 - _ROW_HEIGHT * row] for _, middle, row in names]
    text(recording, "/increment_curves/members", places, [name for name, _, _ in names], [GREY])


def _colour_bar(recording: rr.RecordingStream, panels: list[Axes], largest: float, unit: str, *, static: bool) -> None:
    """Draw the colours of the members, from the largest removed to the largest added mass."""
    top, bottom = panels[0].top, panels[-1].top + panels[-1].height
    edge = np.linspace(bottom, top, _BAR_STEPS + 1)
    strips = [[[_BAR, low], [_BAR, high]] for low, high in itertools.pairwise(edge.tolist())]
    colours = signed_heat(np.linspace(-1.0, 1.0, _BAR_STEPS))
    bar = rr.LineStrips2D(strips, colors=colours, radii=2.5, draw_order=10.0)
    recording.log("/increment_curves/colours", bar, static=static)
    levels = {top: f"+{largest:.3g} {unit}", (top + bottom) / 2: "0", bottom: f"-{largest:.3g} {unit}"}
    places = [[_BAR + 12.0, y - 4.0] for y in levels]
    text(recording, "/increment_curves/colours/ticks", places, [*levels.values()], [GREY], static=static)


def _curves(
    recording: rr.RecordingStream,
    geometry: Geometry,
    unrolled: Unrolled,
    panel: Axes,
    increments: MassIncrements,
    path: str,
    scale: float,
) -> None:
    """Draw normalised and raw increments, and the limits of undisturbed windows."""
    column = DIRECTIONS.index(path[-1])
    limit = increments.z_limit * numbers(increments.normalised_std)[:, column]
    normalised, raw = numbers(increments.normalised)[:, column], np.array(increments.increment)[:, column]
    for name, values, colour, radius in (
        ("normalised", normalised, SENSOR, 1.5),
        ("raw", raw, GREY, 0.9),
        ("over", limit, DIM, 0.8),
        ("under", -limit, DIM, 0.8),
    ):
        strips = _strips(geometry, unrolled, panel, scale * values)
        lines = rr.LineStrips2D(strips, colors=[colour], radii=rr.Radius.ui_points(radius), draw_order=10.0)
        recording.log(f"{path}/{name}", lines)
    flagged = [f.node for f in increments.flagged if f.direction == DIRECTIONS[column]]
    dots = _dots(geometry, unrolled, panel, scale * normalised, flagged)
    points = rr.Points2D(dots, colors=[ALARM], radii=rr.Radius.ui_points(3.0), draw_order=20.0)
    recording.log(f"{path}/flagged", points)


def _strips(geometry: Geometry, unrolled: Unrolled, panel: Axes, values: FloatArray) -> list[FloatArray]:
    """Return the stretches of a curve over the members where there are values inside the panel."""
    strips: list[FloatArray] = []
    for member, nodes in geometry.lines.items():
        known = nodes[np.isfinite(values[nodes])]
        if len(known) > 1:
            strips += panel.runs(unrolled.along(member, geometry.nodes[known]), values[known])
    return strips


def _dots(
    geometry: Geometry, unrolled: Unrolled, panel: Axes, values: FloatArray, flagged: list[int]
) -> list[FloatArray]:
    return [
        panel.curve(unrolled.along(member, geometry.nodes[[node]]), values[[node]])[0]
        for member, nodes in geometry.lines.items()
        for node in flagged
        if node in nodes and np.isfinite(values[node])
    ]
