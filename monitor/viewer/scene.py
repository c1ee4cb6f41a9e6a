"""The structure in three dimensions: members, sensors, the located mass, mode shapes."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.results import MassAnswer, ReferenceMode, ReferenceResult, WindowResult
from monitor.viewer.palette import ALARM, DIM, GREY, STEEL, TEXT, heat, mode_colour

_TUBE = 0.010  # of the structure's size, radius of its members
_SHAPE = 0.16  # of its size, largest displacement of a mode
_LEAST_LEVEL = 0.05  # of the posterior, as a share of its largest, that is drawn
_PHASES = np.arange(24) / 24


class Geometry:
    """Nodes and lines of a reference, with a length to draw by."""

    def __init__(self, reference: ReferenceResult) -> None:
        self.nodes = np.array(reference.nodes)
        self.lines = [np.array(nodes) for nodes in reference.lines.values()]
        self.size = float(np.linalg.norm(np.ptp(self.nodes, axis=0)))
        self.centre = (self.nodes.min(0) + self.nodes.max(0)) / 2

    def strips(self, displacement: FloatArray | None = None) -> list[FloatArray]:
        """Return one polyline a member, displaced by (n_nodes, 3) [m]."""
        at = self.nodes if displacement is None else self.nodes + displacement
        return [at[line] for line in self.lines]


def draw_structure(recording: rr.RecordingStream, reference: ReferenceResult, windows: Sequence[WindowResult]) -> None:
    """Draw members, sensors and, window by window, where the mass is."""
    geometry = Geometry(reference)
    recording.log("/structure", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _foot(recording, geometry)
    _sensors(recording, reference, geometry)
    members = rr.LineStrips3D(geometry.strips(), colors=[STEEL], radii=_TUBE * geometry.size)
    recording.log("/structure/members", members, static=True)
    for window in windows:
        recording.set_time("time", timestamp=np.datetime64(window.end, "ns"))
        if window.answer:
            _mass(recording, geometry, window.answer)
        else:
            recording.log("/structure/mass", rr.Clear(recursive=True))


def _foot(recording: rr.RecordingStream, geometry: Geometry) -> None:
    low = geometry.nodes[np.argmin(geometry.nodes[:, 2])]
    half = geometry.size * np.array([0.07, 0.07, 0.012])
    box = rr.Boxes3D(centers=[low - [0, 0, half[2]]], half_sizes=[half], colors=[DIM], fill_mode="solid")
    recording.log("/structure/foot", box, static=True)


def _sensors(recording: rr.RecordingStream, reference: ReferenceResult, geometry: Geometry) -> None:
    """Draw one point a place, named by what its channels have in common, and an arrow a channel."""
    places: dict[tuple[float, float, float], list[str]] = {}
    for channel, (at, _) in reference.sensors.items():
        places.setdefault(at, []).append(channel)
    labels = [_common(channels) for channels in places.values()]
    points = rr.Points3D(list(places), radii=0.014 * geometry.size, colors=[(120, 200, 240)], labels=labels)
    recording.log("/structure/sensors", points, static=True)
    origins = [at for at, _ in reference.sensors.values()]
    vectors = [0.07 * geometry.size * np.asarray(d) / np.linalg.norm(d) for _, d in reference.sensors.values()]
    arrows = rr.Arrows3D(origins=origins, vectors=vectors, colors=[(90, 150, 190)], radii=0.004 * geometry.size)
    recording.log("/structure/directions", arrows, static=True)


def _common(names: list[str]) -> str:
    if len(names) == 1:
        return names[0]
    shared = [a for a, *rest in zip(*names, strict=False) if all(a == b for b in rest)]
    return "".join(shared).rstrip("_-. ") or names[0]


def _mass(recording: rr.RecordingStream, geometry: Geometry, answer: MassAnswer) -> None:
    at = np.array(answer.position)
    radius = geometry.size * (0.028 + 0.03 * min(1.0, abs(answer.mass) / 0.5))
    recording.log("/structure/mass/body", rr.Points3D([at], radii=radius, colors=[ALARM]))
    text = f"{1000 * answer.mass:+.0f} ± {1000 * answer.mass_std:.0f} g, ± {1000 * answer.position_std:.0f} mm"
    beside = at + geometry.size * np.array([0.16, -0.08, 0.09])  # clear of the sensors' names
    recording.log(
        "/structure/mass/label", rr.Points3D([beside], radii=0.0, colors=[TEXT], labels=[text], show_labels=True)
    )
    region = [[r.start, r.end] for r in answer.region]
    band = rr.LineStrips3D(region, colors=[(255, 210, 90)], radii=1.3 * _TUBE * geometry.size)
    recording.log("/structure/mass/region", band)
    segments, level = _posterior_on_members(answer)
    shown = level > _LEAST_LEVEL
    tube = rr.LineStrips3D(
        [s for s, keep in zip(segments, shown, strict=True) if keep],
        colors=heat(level[shown]),
        radii=1.6 * _TUBE * geometry.size,
    )
    recording.log("/structure/mass/posterior", tube)


def _posterior_on_members(answer: MassAnswer) -> tuple[list[FloatArray], FloatArray]:
    """Return segments between neighbouring positions and their density, as a share of the largest (square root)."""
    segments, level = [], []
    for a, b in zip(answer.profile[:-1], answer.profile[1:], strict=True):
        if a.member == b.member:
            segments.append(np.array([a.position, b.position]))
            level.append((a.density + b.density) / 2)
    return segments, np.sqrt(np.array(level) / max(max(level, default=1.0), 1e-12))


def draw_mode_shapes(recording: rr.RecordingStream, reference: ReferenceResult) -> None:
    """Draw each mode still (both extremes) and moving, on a timeline of its own."""
    geometry = Geometry(reference)
    for mode in reference.modes:
        base, colour = f"/modes/mode_{mode.id}", mode_colour(mode.id)
        recording.log(base, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        thin = rr.Radius.ui_points(1.2)
        recording.log(f"{base}/rest", rr.LineStrips3D(geometry.strips(), colors=[GREY], radii=thin), static=True)
        swing = _SHAPE * geometry.size * np.array(mode.displacement)
        ghosts = [strip for share in (-1.0, -0.5, 0.5) for strip in geometry.strips(share * swing)]
        ghost = rr.LineStrips3D(ghosts, colors=[(*colour, 70)], radii=thin)
        recording.log(f"{base}/ghost", ghost, static=True)
        tube = 0.8 * _TUBE * geometry.size
        recording.log(f"{base}/name", _name(geometry, mode), static=True)
        recording.set_time("phase", duration=0.0)
        recording.log(f"{base}/shape", rr.LineStrips3D(geometry.strips(swing), colors=[colour], radii=tube))
        frames = [strip for phase in _PHASES for strip in geometry.strips(np.cos(2 * np.pi * phase) * swing)]
        columns = rr.LineStrips3D.columns(strips=frames).partition([len(geometry.lines)] * len(_PHASES))
        recording.send_columns(f"{base}/shape", [rr.TimeColumn("phase", duration=2 * _PHASES)], columns)
        recording.reset_time()
        still = rr.LineStrips3D(geometry.strips(swing), colors=[colour], radii=tube)
        recording.log(f"{base}/still", still, static=True)


def _name(geometry: Geometry, mode: ReferenceMode) -> rr.Points3D:
    text = f"{mode.id}:  {mode.frequency:.2f} Hz,  {100 * mode.damping:.2f} %"
    below = [*geometry.centre[:2], geometry.nodes[:, 2].min() - 0.07 * geometry.size]
    return rr.Points3D([below], radii=0.0, colors=[mode_colour(mode.id)], labels=[text], show_labels=True)
