"""The structure in three dimensions: members, supports, sensors, and the located mass."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import rerun as rr

from daq import FloatArray
from monitor.results.run_results import RunResults, standing_answer, thin
from monitor.results.windows import MassAnswer, ReferenceResult, WindowResult
from monitor.text.cause_list import listed_causes
from monitor.text.causes import placed_text
from monitor.text.quantities import share_text
from monitor.text.verdicts import is_one_mass
from monitor.views.geometry import Geometry, screen
from monitor.views.palette import ALARM, DIM, GREY, LIGHTER, REGION, SENSOR, STEEL, TEXT, heat
from monitor.views.viewer.primitives import at, once
from updater import Cause
from updater.quantities import Vector, plain

TUBE = 0.0095  # of the structure's size, radius of its members
SIDE = (24.0, 12.0)  # degrees: azimuth and elevation of the viewer
_DENSITY = 400.0  # kg/m3 of the sphere that represents a mass: light, so that it is visible
_LEADER = 0.62  # share of the way from the mass to the top of its label, which extends downwards
_LARGEST = 0.06  # of the structure's size
_LIFT = 0.12  # of the structure's size, from a place up to its words


def draw_structure(recording: rr.RecordingStream, run_results: RunResults) -> None:
    """Draw members, supports, sensors and, window by window, where the mass is."""
    if run_results.geometry is None:
        return
    draw_bare_structure(recording, run_results.geometry, run_results.start)
    answered: WindowResult | None = None
    for window in thin(run_results.windows):
        draw_place(recording, run_results.geometry, window, run_results.mass_unit, answered)
        answered = standing_answer(window, answered)


def draw_bare_structure(recording: rr.RecordingStream, reference: ReferenceResult, time: int) -> None:
    """Draw a reference: members from a time on [ns UTC], supports and sensors permanently."""
    geometry = Geometry(reference)
    recording.log("/structure", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    supports(recording, "/structure", geometry)
    sensors(recording, reference, geometry)
    at(recording, time)
    _bare(recording, geometry)


def draw_place(
    recording: rr.RecordingStream,
    reference: ReferenceResult,
    window: WindowResult,
    unit: tuple[float, str],
    answered: WindowResult | None,
) -> None:
    """Draw the position of the mass, and of causes other than one mass; both remain until the alarm ends.

    Parameters
    ----------
    answered : window whose position of the mass was drawn before
    """
    geometry = Geometry(reference)
    at(recording, window.end)
    if window.answer:
        _mass(recording, geometry, window.answer, unit)
    elif answered and not standing_answer(window, answered):
        _bare(recording, geometry)
    if window.diagnosis or window.phase != "alarm":
        recording.log("/structure/causes", rr.Clear(recursive=True))
    if window.diagnosis and not (window.answer and is_one_mass(window.diagnosis)):
        draw_causes(recording, geometry, window.diagnosis.causes, reference, static=False)


def draw_causes(
    recording: rr.RecordingStream,
    geometry: Geometry,
    causes: Sequence[Cause],
    reference: ReferenceResult,
    *,
    static: bool,
) -> None:
    """Draw a ball and words at each cause's place, its 95 % region, and a ring about each channel that one names."""
    above = np.array([0.0, 0.0, _LIFT * geometry.size])
    listed = listed_causes(causes)
    placed = [c for c in listed if c.where and c.where.position]
    places = np.array([c.where.position for c in placed if c.where], float).reshape(-1, 3)
    placed_channels = [(name, c) for c in listed if c.where for name in c.where.channels if name in reference.sensors]
    at_sensors = np.array([reference.sensors[name][0] for name, _ in placed_channels], float).reshape(-1, 3)
    balls = rr.Points3D(places, radii=2.2 * TUBE * geometry.size, colors=[ALARM])
    recording.log("/structure/causes/places", balls, static=static)
    rings = rr.Points3D(at_sensors, radii=2.0 * TUBE * geometry.size, colors=[REGION])
    recording.log("/structure/causes/channels", rings, static=static)
    words = [placed_text(c) for c in placed]
    words += [f"{plain(c.cause)}: {name}" for name, c in placed_channels]
    spots = np.concatenate([places, at_sensors]) + above
    labels = rr.Points3D(spots, radii=0.0, colors=[TEXT], labels=words, show_labels=True)
    recording.log("/structure/causes/names", labels, static=static)
    leaders = rr.LineStrips3D(
        [[s - above, s - 0.4 * above] for s in spots], colors=[GREY], radii=rr.Radius.ui_points(0.6)
    )
    recording.log("/structure/causes/leaders", leaders, static=static)
    regions = [stretch for c in placed if c.where for stretch in c.where.region]
    bars = rr.LineStrips3D([list(r) for r in regions], colors=[REGION], radii=2.0 * TUBE * geometry.size)
    recording.log("/structure/causes/region", bars, static=static)


def seen(geometry: Geometry, answers: Sequence[MassAnswer]) -> FloatArray:
    """Return the points (n, 3) that a picture of the structure must show, room for texts among them."""
    right, up = screen(geometry.side(*SIDE))
    room = 0.06 * geometry.size * np.array([right, -right, up, -up])
    texts = [np.array(a.position) + _reach(geometry, a) for a in answers]
    width = 0.22 * geometry.size * right
    labels = [text + offset for text in texts for offset in (width, -width)]
    return np.concatenate([*(geometry.nodes + offset for offset in room), np.array(labels).reshape(-1, 3)])


def _bare(recording: rr.RecordingStream, geometry: Geometry) -> None:
    recording.log("/structure/members", rr.LineStrips3D(geometry.strips(), colors=[STEEL], radii=TUBE * geometry.size))
    recording.log("/structure/mass", rr.Clear(recursive=True))


def plates(geometry: Geometry) -> rr.Boxes3D:
    """Return a plate under each support."""
    half = _plate(geometry)
    feet = geometry.nodes[geometry.held] - [0, 0, half[2]]
    return rr.Boxes3D(centers=feet, half_sizes=np.tile(half, (len(feet), 1)), colors=[DIM], fill_mode="solid")


def supports(recording: rr.RecordingStream, base: str, geometry: Geometry) -> None:
    """Draw a plate and a name at each support."""
    once(recording, f"{base}/supports", plates(geometry))
    below = geometry.nodes[geometry.held] - [0, 0, 3 * _plate(geometry)[2]]
    names = ["foot" if len(below) == 1 else "support"] * len(below)
    labels = rr.Points3D(below, radii=0.0, colors=[GREY], labels=names, show_labels=True)
    once(recording, f"{base}/supports/names", labels)


def _plate(geometry: Geometry) -> FloatArray:
    """Return half the size of a support's plate (3,) [m]."""
    return np.asarray(geometry.size * np.array([0.06, 0.06, 0.01]))


def sensors(recording: rr.RecordingStream, reference: ReferenceResult, geometry: Geometry) -> None:
    """Draw one point per position, named by the common part of its channels, and one arrow per channel."""
    places: dict[tuple[float, float, float], list[str]] = {}
    for channel, (place, _) in reference.sensors.items():
        places.setdefault(place, []).append(channel)
    labels = [common_name(channels) for channels in places.values()]
    points = rr.Points3D(
        list(places), radii=1.35 * TUBE * geometry.size, colors=[SENSOR], labels=labels, show_labels=True
    )
    recording.log("/structure/sensors", points, static=True)
    origins = [place for place, _ in reference.sensors.values()]
    vectors = [0.075 * geometry.size * np.asarray(d) / np.linalg.norm(d) for _, d in reference.sensors.values()]
    arrows = rr.Arrows3D(origins=origins, vectors=vectors, colors=[SENSOR], radii=0.003 * geometry.size)
    recording.log("/structure/directions", arrows, static=True)


def common_name(names: list[str]) -> str:
    """Return the common beginning of the names of one position's channels, or the first name if there is none."""
    if len(names) == 1:
        return names[0]
    shared = 0
    while all(len(n) > shared for n in names) and len({n[shared] for n in names}) == 1:
        shared += 1
    return names[0][:shared].rstrip("_-. /") or names[0]


def _mass(recording: rr.RecordingStream, geometry: Geometry, answer: MassAnswer, unit: tuple[float, str]) -> None:
    place, tube = np.array(answer.position), TUBE * geometry.size
    radius = _radius(geometry, answer)
    colour = ALARM if answer.mass >= 0 else LIGHTER
    recording.log("/structure/mass/body", rr.Points3D([place], radii=radius, colors=[colour]))
    _others(recording, geometry, answer, unit)
    bars = rr.LineStrips3D(_brackets(geometry, answer), colors=[REGION], radii=0.3 * tube)
    recording.log("/structure/mass/region", bars)
    segments, colours = heated_members(geometry, answer)
    recording.log("/structure/members", rr.LineStrips3D(segments, colors=colours, radii=tube))
    reach = _reach(geometry, answer)
    leader = rr.LineStrips3D([[place, place + _LEADER * reach]], colors=[GREY], radii=rr.Radius.ui_points(0.6))
    recording.log("/structure/mass/leader", leader)
    text = mass_label(geometry, answer, unit)
    label = rr.Points3D([place + reach], radii=0.0, colors=[TEXT], labels=[text], show_labels=True)
    recording.log("/structure/mass/label", label)


def _others(recording: rr.RecordingStream, geometry: Geometry, answer: MassAnswer, unit: tuple[float, str]) -> None:
    """Draw a paler ball with its own label at each other place that the data leave open; none if there is none."""
    places = np.array([o.position for o in answer.others], float).reshape(-1, 3)
    labels = [f"or {unit[0] * o.mass:+.4g} {unit[1]} here ({share_text(o.probability)})" for o in answer.others]
    balls = rr.Points3D(places, radii=_radius(geometry, answer), colors=[REGION])
    recording.log("/structure/mass/others", balls)
    below = places - np.array([0, 0, _radius(geometry, answer) + 0.11 * geometry.size])
    leaders = rr.LineStrips3D(np.stack([places, below], axis=1), colors=[GREY], radii=rr.Radius.ui_points(0.6))
    recording.log("/structure/mass/others/leaders", leaders)
    names = rr.Points3D(below, radii=0.0, colors=[TEXT], labels=labels, show_labels=True)
    recording.log("/structure/mass/others/names", names)


def sphere_radius(mass: float) -> float:
    """Return the radius [m] of the sphere that represents a mass [kg]: its volume is in proportion."""
    return float(np.cbrt(3 * abs(mass) / (4 * np.pi * _DENSITY)))


def mass_label(geometry: Geometry, answer: MassAnswer, unit: tuple[float, str]) -> str:
    """Return how much and where, each with its standard deviation; `unit`: how many are a kilogram, and its name."""
    (scale, name), place = unit, geometry.place(answer.member, np.array(answer.position))
    digits = max(0, -math.floor(math.log10(scale * answer.mass_std))) if 0 < answer.mass_std < math.inf else 1
    mass = f"{scale * answer.mass:+.{digits}f} ± {scale * answer.mass_std:.{digits}f} {name}"
    return f"{mass}\nat {place} ± {answer.position_std:.3f} m"


def _across(geometry: Geometry, member: str) -> FloatArray:
    """Return the direction (3,) across a member in the picture's plane, to the right or upwards."""
    towards = geometry.side(*SIDE)
    right, up = screen(towards)
    across = np.cross(towards, geometry.axis(member))
    length = float(np.linalg.norm(across))
    if length < 1e-6:  # the member points at the eye
        return right
    return np.asarray(across / length * (1 if across @ (right + 0.3 * up) >= 0 else -1))


def _reach(geometry: Geometry, answer: MassAnswer) -> FloatArray:
    """Return the position of the label's top relative to the mass (3,) [m], mostly sideways because texts are wide."""
    right, up = screen(geometry.side(*SIDE))
    across = _across(geometry, answer.member)
    length = _radius(geometry, answer) + (0.12 + 0.2 * abs(float(across @ right))) * geometry.size
    return np.asarray(length * across + 0.05 * geometry.size * up)


def _radius(geometry: Geometry, answer: MassAnswer) -> float:
    return float(np.clip(sphere_radius(answer.mass), 1.8 * TUBE * geometry.size, _LARGEST * geometry.size))


def _brackets(geometry: Geometry, answer: MassAnswer) -> list[list[FloatArray]]:
    """Return a bracket along each stretch of the 95 % region, on the other side than the label."""
    brackets = []
    for stretch in answer.region:
        across = -_across(geometry, stretch.member)
        start, end = (
            np.array(p) + (_radius(geometry, answer) + 0.025 * geometry.size) * across
            for p in (stretch.start, stretch.end)
        )
        cap = 0.012 * geometry.size * across
        brackets.append([start - cap, start, end, end - cap])
    return brackets


def _outside(nodes: FloatArray, places: list[Vector]) -> list[FloatArray]:
    """Return the parts of a member on both sides of places in order along it; the whole member if there are none."""
    if not places:
        return [nodes]
    first, last = np.array(places[0]), np.array(places[-1])
    along, least = np.linalg.norm(nodes - nodes[0], axis=1), 1e-9 * float(np.ptp(nodes, axis=0).max())
    before = nodes[along < np.linalg.norm(first - nodes[0]) - least]
    after = nodes[along > np.linalg.norm(last - nodes[0]) + least]
    ends = [np.vstack([before, first])] if len(before) else []
    return [*ends, np.vstack([last, after])] if len(after) else ends


def heated_members(geometry: Geometry, answer: MassAnswer) -> tuple[list[FloatArray], npt.NDArray[np.uint8]]:
    """Return the members in stretches, coloured by the square root of the posterior's density over its largest.

    A profile may cover the surroundings of the best place alone.
    """
    segments, level = [], []
    for a, b in zip(answer.profile[:-1], answer.profile[1:], strict=True):
        if a.member == b.member:
            segments.append(np.array([a.position, b.position]))
            level.append((a.density + b.density) / 2)
    for member, nodes in geometry.lines.items():
        cold = _outside(geometry.nodes[nodes], [p.position for p in answer.profile if p.member == member])
        segments += cold
        level += [0.0] * len(cold)
    share = np.array(level) / max(max(level, default=0.0), 1e-12)
    return segments, heat(np.sqrt(share))
