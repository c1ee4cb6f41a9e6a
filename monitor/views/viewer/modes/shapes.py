"""Mode shapes: a still picture on the timeline of the run, a moving one on a timeline of its own."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.results.run_results import find_mode
from monitor.results.windows import ModeResult, ReferenceMode, ReferenceResult, WindowResult
from monitor.views.geometry import RIB, RIBS_APART, Geometry, ribs, screen
from monitor.views.palette import GREY, TEXT, mode_colour
from monitor.views.viewer.modes.bars import draw_bars, draw_window_bars
from monitor.views.viewer.primitives import PHASE, at, once
from monitor.views.viewer.scene import TUBE, plates

SIDE = (32.0, 28.0)  # degrees: azimuth and elevation of the viewer
_SWING = 0.12  # of the structure's size, largest displacement: more, and a beam that bends towards the eye folds
_LABEL_ROOM = 0.2  # of its size, under all shapes
_HINT = (
    "Thick line: baseline{}. White points: sensors in the last window, scaled to the baseline; away from the line, the "
    "shape has changed. **Motion:** choose the timeline `phase` at the bottom left, then play."
)
_RIBS = ", with ribs across members that show torsion"
_LINES = ", zero in directions that are not measured; the lines join the sensors"
_FRAMES = 48
_SECONDS = 2.0  # of one cycle
_RIB_RADIUS = -1.0  # below zero: in points of the screen
_GHOSTS = (-1.0, -0.5, 0.5)


def draw_mode_shapes(recording: rr.RecordingStream, reference: ReferenceResult, time: int) -> None:
    """Draw each mode of the reference: rest, both extremes from a time on [ns UTC], and the motion."""
    geometry = Geometry(reference)
    hint = _HINT.format(_RIBS if reference.has_model else _LINES)
    once(recording, "/modes/hint", rr.TextDocument(hint, media_type="text/markdown"))
    under = _below(geometry, seen(geometry, reference.modes), -0.7 * _LABEL_ROOM)
    for mode in reference.modes:
        base = f"/modes/mode_{mode.id}"
        recording.log(base, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        _still(recording, base, geometry, mode)
        name = rr.Points3D(
            [under], radii=0.0, colors=[mode_colour(mode.id)], labels=[mode_label(mode)], show_labels=True
        )
        recording.log(f"{base}/name", name, static=True)
        at(recording, time)
        swing = _swing(geometry, mode)
        line = rr.LineStrips3D(geometry.strips(swing), colors=[mode_colour(mode.id)], radii=0.9 * TUBE * geometry.size)
        recording.log(f"{base}/shape", line)
        colour = (*mode_colour(mode.id), 140)
        (turned,) = ribs_of(geometry, mode, [1.0])
        recording.log(f"{base}/ribs", rr.LineStrips3D(turned, colors=[colour], radii=_RIB_RADIUS))
        _motion(recording, base, geometry, mode)


def draw_measured_shapes(
    recording: rr.RecordingStream, reference: ReferenceResult, windows: Sequence[WindowResult]
) -> None:
    """Draw the shapes of windows at the sensors, scaled to those of the baseline."""
    geometry = Geometry(reference)
    under = _below(geometry, seen(geometry, reference.modes), -0.25 * _LABEL_ROOM)
    for window in windows:
        at(recording, window.end)
        for mode in reference.modes:
            found = find_mode(window, mode.id)
            places, mac = _measured(geometry, reference, mode, window, found) if found else ([], 0.0)
            points = rr.Points3D(places, radii=1.4 * TUBE * geometry.size, colors=[TEXT])
            recording.log(f"/modes/mode_{mode.id}/sensors", points)
            text = "now: not identified"
            if found:
                text = f"now: {found.frequency:.2f} Hz, {100 * found.damping:.2f} %\nMAC {mac:.3f}"
            label = rr.Points3D([under], radii=0.0, colors=[TEXT], labels=[text], show_labels=True)
            recording.log(f"/modes/mode_{mode.id}/now", label)


def _measured(
    geometry: Geometry, reference: ReferenceResult, mode: ReferenceMode, window: WindowResult, found: ModeResult
) -> tuple[list[FloatArray], float]:
    """Return the places of the sensors, and the MAC with the baseline; directions that are not measured follow it."""
    values = {c: v for c, v in zip(window.channels, found.shape, strict=True) if c in reference.sensors}
    if not values:
        return [], 0.0
    nodes, ways = _at_sensors(geometry, reference, list(values))
    displacement = np.array(mode.displacement, float)
    base, now = np.sum(displacement[nodes] * ways, axis=1), np.array(list(values.values()))
    product, length = float(now @ base), max(float(now @ now), 1e-300)
    changed = {node: displacement[node].copy() for node in nodes}
    for node, way, change in zip(nodes, ways, product / length * now - base, strict=True):
        changed[node] += change * way
    places = [geometry.nodes[node] + _SWING * geometry.size * moved for node, moved in changed.items()]
    return places, product**2 / (length * max(float(base @ base), 1e-300))


def _at_sensors(geometry: Geometry, reference: ReferenceResult, channels: list[str]) -> tuple[list[int], FloatArray]:
    """Return the node nearest to each channel's sensor, and its direction (n, 3)."""
    nodes = _nearest(geometry, np.array([reference.sensors[c][0] for c in channels]))
    ways = np.array([reference.sensors[c][1] for c in channels], float)
    return nodes, ways / np.linalg.norm(ways, axis=1, keepdims=True)


def shapes_at_sensors(geometry: Geometry, reference: ReferenceResult, channels: list[str]) -> FloatArray:
    """Return the baseline's shapes (n_modes, n_channels) at channels of sensors."""
    nodes, ways = _at_sensors(geometry, reference, channels)
    displacement = np.array([mode.displacement for mode in reference.modes], float).reshape(-1, len(geometry.nodes), 3)
    return np.asarray(np.sum(displacement[:, nodes] * ways, axis=2))


def ribs_of(geometry: Geometry, mode: ReferenceMode, shares: Sequence[float]) -> list[list[FloatArray]]:
    """Return lines across the members at each of some shares of the motion; none without rotations."""
    if not mode.rotation:
        return [[] for _ in shares]
    spans = [(int(a), int(b)) for nodes in geometry.lines.values() for a, b in pairwise(nodes)]
    nodes, ways = ribs(geometry.nodes, spans, geometry.side(*SIDE), RIBS_APART * geometry.size)
    rest, swing = geometry.nodes[nodes], _swing(geometry, mode)[nodes]
    turn = np.cross(_SWING * geometry.size * np.array(mode.rotation, float)[nodes], ways)
    both = []
    for share in shares:
        centre, arms = rest + share * swing, RIB * geometry.size * (ways + share * turn)
        both.append(list(np.stack([centre - arms, centre + arms], axis=1)))
    return both


def seen(geometry: Geometry, modes: Sequence[ReferenceMode]) -> FloatArray:
    """Return the points (n, 3) that a picture of any of the modes must show, room for the label among them."""
    swings = [sign * _swing(geometry, mode) for mode in modes for sign in (-1, 1)]
    moved = np.concatenate([geometry.nodes + swing for swing in swings])
    return np.concatenate([moved, [_below(geometry, moved, _LABEL_ROOM)]])


def _below(geometry: Geometry, points: FloatArray, share: float) -> FloatArray:
    """Return the place (3,) under the middle of a picture that shows points (n, 3), by a share of the size."""
    right, up = screen(geometry.side(*SIDE))
    across = points @ right
    middle = (across.min() + across.max()) / 2
    lowest = (points @ up).min() - share * geometry.size
    towards = geometry.side(*SIDE)
    return np.asarray(middle * right + lowest * up + (geometry.centre @ towards) * towards)


def mode_label(mode: ReferenceMode) -> str:
    """Return number, natural frequency and damping ratio."""
    return f"mode {mode.id}: {mode.frequency:.2f} Hz, {100 * mode.damping:.2f} %"


def _swing(geometry: Geometry, mode: ReferenceMode) -> FloatArray:
    return np.asarray(_SWING * geometry.size * np.array(mode.displacement, float))


def _still(recording: rr.RecordingStream, base: str, geometry: Geometry, mode: ReferenceMode) -> None:
    """Draw the static parts: the structure at rest, and ghosts of the motion."""
    colour, thin = mode_colour(mode.id), rr.Radius.ui_points(1.1)
    recording.log(f"{base}/rest", rr.LineStrips3D(geometry.strips(), colors=[GREY], radii=thin), static=True)
    recording.log(f"{base}/supports", plates(geometry), static=True)
    swing = _swing(geometry, mode)
    ghosts = [strip for share in _GHOSTS for strip in geometry.strips(share * swing)]
    alpha = [110 if share == -1.0 else 50 for share in _GHOSTS for _ in geometry.lines]
    ghost = rr.LineStrips3D(ghosts, colors=[(*colour, a) for a in alpha], radii=thin)
    recording.log(f"{base}/ghost", ghost, static=True)


def _motion(recording: rr.RecordingStream, base: str, geometry: Geometry, mode: ReferenceMode) -> None:
    cycle = np.arange(_FRAMES) / _FRAMES
    swing, shares = _swing(geometry, mode), np.cos(2 * np.pi * cycle)
    red, green, blue = mode_colour(mode.id)
    colour = (red << 24) | (green << 16) | (blue << 8)
    radius = float(0.9 * TUBE * geometry.size)
    frames = [geometry.strips(share * swing) for share in shares]
    _cycle(recording, f"{base}/shape", frames, cycle, colour | 0xFF, radius)
    turned = ribs_of(geometry, mode, shares.tolist())
    if turned[0]:
        _cycle(recording, f"{base}/ribs", turned, cycle, colour | 140, _RIB_RADIUS)


def _cycle(
    recording: rr.RecordingStream,
    path: str,
    frames: list[list[FloatArray]],
    cycle: FloatArray,
    colour: int,
    radius: float,
) -> None:
    """Draw frames, which have equally many strips, on the timeline of the motion."""
    n = len(frames[0])
    strips = [strip for frame in frames for strip in frame]
    columns = rr.LineStrips3D.columns(strips=strips, colors=[colour] * len(strips), radii=[radius] * len(strips))
    column = rr.TimeColumn(PHASE, duration=_SECONDS * cycle)
    recording.send_columns(path, [column], columns.partition([n] * _FRAMES))


def _nearest(geometry: Geometry, places: FloatArray) -> list[int]:
    """Return the node nearest to each of some places (n, 3)."""
    distance = np.linalg.norm(geometry.nodes[None] - places.reshape(-1, 1, 3), axis=2)
    nearest: list[int] = np.argmin(distance, axis=1).tolist()
    return nearest


def draw_shapes(recording: rr.RecordingStream, reference: ReferenceResult, time: int) -> None:
    """Draw the modes of a reference from a time on [ns UTC]."""
    if reference.has_shapes:
        (draw_mode_shapes if reference.has_geometry else draw_bars)(recording, reference, time)


def draw_window_shapes(
    recording: rr.RecordingStream, reference: ReferenceResult, windows: Sequence[WindowResult]
) -> None:
    """Draw the shapes of windows, scaled to those of the reference."""
    if reference.has_shapes:
        (draw_measured_shapes if reference.has_geometry else draw_window_bars)(recording, reference, windows)
