"""Mode shapes: a still picture on the timeline of the run, a moving one on a timeline of its own."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.results.windows import ReferenceMode, ReferenceResult
from monitor.views.geometry import Geometry, screen
from monitor.views.palette import GREY, TEXT, mode_colour
from monitor.views.viewer.primitives import PHASE, at
from monitor.views.viewer.scene import TUBE, plates

SIDE = (32.0, 28.0)  # degrees: azimuth and elevation of the viewer
_SWING = 0.12  # of the structure's size, largest displacement: more, and a beam that bends towards the eye folds
_LABEL_ROOM = 0.12  # of its size, under all shapes
_FRAMES = 48
_SECONDS = 2.0  # of one cycle
_GHOSTS = (-1.0, -0.5, 0.5)


def draw_mode_shapes(recording: rr.RecordingStream, reference: ReferenceResult, time: int) -> None:
    """Draw each mode of the reference: rest, both extremes from a time on [ns UTC], and the motion."""
    geometry = Geometry(reference)
    sensors = _nearest(geometry, np.array([place for place, _ in reference.sensors.values()]))
    under = _below(geometry, seen(geometry, reference.modes), -_LABEL_ROOM / 2)
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
        recording.log(f"{base}/shape", _shape(geometry, mode, swing))
        places = (geometry.nodes + swing)[sensors]
        points = rr.Points3D(places, radii=1.4 * TUBE * geometry.size, colors=[TEXT])
        recording.log(f"{base}/sensors", points)
        _motion(recording, base, geometry, mode)


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
    return f"Mode {mode.id}   {mode.frequency:.2f} Hz   {100 * mode.damping:.2f} %"


def _swing(geometry: Geometry, mode: ReferenceMode) -> FloatArray:
    return np.asarray(_SWING * geometry.size * np.array(mode.displacement, float))


def _shape(geometry: Geometry, mode: ReferenceMode, displacement: FloatArray) -> rr.LineStrips3D:
    return rr.LineStrips3D(
        geometry.strips(displacement), colors=[mode_colour(mode.id)], radii=0.9 * TUBE * geometry.size
    )


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
    swing, n = _swing(geometry, mode), len(geometry.lines)
    frames = [strip for c in cycle for strip in geometry.strips(np.cos(2 * np.pi * c) * swing)]
    red, green, blue = mode_colour(mode.id)
    colour = (red << 24) | (green << 16) | (blue << 8) | 0xFF
    columns = rr.LineStrips3D.columns(
        strips=frames, colors=[colour] * n * _FRAMES, radii=[0.9 * TUBE * geometry.size] * n * _FRAMES
    ).partition([n] * _FRAMES)
    recording.send_columns(f"{base}/shape", [rr.TimeColumn(PHASE, duration=_SECONDS * cycle)], columns)


def _nearest(geometry: Geometry, places: FloatArray) -> list[int]:
    """Return the nodes nearest to places (n, 3), each once."""
    distance = np.linalg.norm(geometry.nodes[None] - places.reshape(-1, 1, 3), axis=2)
    return sorted(set(np.argmin(distance, axis=1).tolist()))
