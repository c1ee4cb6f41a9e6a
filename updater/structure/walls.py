"""Walls of hollow chords that bend where a branch is welded to them: places, and springs as segments.

Members of a frame keep their sections. A wall of a tube bends under the moments and the force of a branch that is
narrower than it is, so that the branch turns and moves against the chord. Springs at the chord's face represent this:
they turn the branch about its own axes, and let it move along its axis. The spring about the chord's axis is beyond the
face: a force across the chord racks its section the other way than a moment does. The springs are effective, and hold
below the frequencies at which the wall has modes of its own. Each is written as a short segment of the branch, softer
in bending or along the axis. A branch as wide as the chord is held by the chord's sides, and has none.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from updater.structure.base import ON_MEMBER, Vector
from updater.structure.entries import Axis, Member, Segment
from updater.structure.section_shapes import Section
from updater.structure.structure import Structure

WALL_AXES: tuple[Axis, ...] = ("ry", "rz", "x")  #: local axes of the branch: bending about two, and along it
#: number of the section force that strains each spring, of six: axial force, shear, twist, bending about y and z
WALL_ACTIONS: Mapping[Axis, int] = {"ry": 4, "rz": 5, "x": 0}
_EXTENT = 0.1  # of the branch's radius of gyration: extent of a segment that represents a spring
_NARROW = 0.9  # of the chord's width: a wider branch stands on the chord's sides
_BULK = 0.15  # least second moment over area squared of a tube; of solid bars at most 0.083
_CLOSED = 0.5  # torsion constant of a tube, relative to its second moment, at least
_MAX_OF_MEMBER = 0.25  # of the branch's length, that a face is from the node at the most
_ALONG = 0.5  # cosine of the angle to the chord's axis, above which a branch runs along the wall
# Square tubes of 20-node solids under static loads, branches of 0.51 to 0.79 of the chord's width, chords of 13 to 30
# thicknesses (docs/validation/model/wall_joints.md). Flexibility about the branch's axis across the chord and about the
# chord's axis, times E t^3, and along the branch, times E t^3 / width^2, over powers of the share of the chord's width
# that the branch leaves; place of the spring about the chord's axis over half the chord's depth, and over the square
# of the share that the branch has.
_ACROSS, _ABOUT_CHORD, _PUSH = 0.66, 0.28, 0.064
_BEYOND = 1.15
_NU = 0.3  # Poisson's ratio of metals
_DIGITS = 6  # of places and extents [m]
_ALIKE = 1e-3  # relative difference of extents that are the same but for the digits of a file


@dataclass(frozen=True)
class Wall:
    """A face of a chord that a branch is welded to."""

    branch: Member
    at: Vector  #: node where the axes meet [m]
    start: Mapping[Axis, float]  #: of the segment that represents each spring, from the start of the branch [m]
    extent: float  #: of each segment [m]
    frequency: float  #: lowest one of the wall, a strip that turns freely at the chord's sides [Hz]
    expected: Mapping[Axis, float]  #: order of each flexibility, over L / E I of the branch, or L / E A

    def span(self, axis: Axis) -> tuple[float, float]:
        """Return the start and the end of the segment of a spring, from the start of the branch [m]."""
        return self.start[axis], self.start[axis] + self.extent

    def factor(self, flexibility: float) -> float:
        """Return the factor on the stiffness of the segment [-].

        Parameters
        ----------
        flexibility : of a spring, over L / E I of the branch, or L / E A [-]
        """
        return 1 / (1 + flexibility * self.branch.length / self.extent)

    def slope(self, flexibility: float) -> float:
        """Return the derivative of the factor's logarithm by the flexibility [-]."""
        return -self.factor(flexibility) * self.branch.length / self.extent

    def flexibility(self, factor: float) -> float:
        """Return the flexibility of a spring, over L / E I of the branch, or L / E A, by the segment's factor [-]."""
        return (1 / factor - 1) * self.extent / self.branch.length

    def segments(self, flexibility: Mapping[Axis, float]) -> list[Segment]:
        """Return the segments with springs of flexibilities by axis, over L / E I of the branch, or L / E A [-]."""
        factor = {axis: self.factor(own) for axis, own in flexibility.items() if own}
        places = dict.fromkeys(self._middle(axis) for axis in factor)
        return [self._segment(at, {a: f for a, f in factor.items() if self._middle(a) == at}) for at in places]

    def axes_of(self, segment: Segment) -> tuple[Axis, ...]:
        """Return the axes of the springs that a segment is at the place of."""
        if segment.member != self.branch.name or not math.isclose(segment.extent, self.extent, rel_tol=_ALIKE):
            return ()
        return tuple(axis for axis in WALL_AXES if math.dist(segment.at, self._middle(axis)) < ON_MEMBER)

    def springs(self, segments: tuple[Segment, ...]) -> dict[Axis, float]:
        """Return the flexibilities of the springs that segments have, by axis [unit: `segments`]."""
        factor = {axis: _factors(segment)[axis] for segment in segments for axis in self.axes_of(segment)}
        return {axis: self.flexibility(factor[axis]) for axis in WALL_AXES if factor.get(axis, 1.0) < 1}

    def _middle(self, axis: Axis) -> Vector:
        x, y, z = self.branch.point(self.start[axis] + self.extent / 2).round(_DIGITS).tolist()
        return x, y, z

    def _segment(self, at: Vector, factor: Mapping[Axis, float]) -> Segment:
        about_y, about_z, along = (factor.get(axis, 1.0) for axis in WALL_AXES)
        return Segment(member=self.branch.name, at=at, extent=self.extent, bending=(about_y, about_z), axial=along)


def _factors(segment: Segment) -> dict[Axis, float]:
    """Return the factors of a segment by the axes that springs of walls have [-]."""
    return dict(zip(WALL_AXES, (*segment.bending, segment.axial), strict=True))


def walls_of(structure: Structure) -> list[Wall]:
    """Return the faces of hollow chords that narrower branches end on, without those whose springs the file has."""
    if structure.external is not None:
        return []
    ends = ((member, end) for member in structure.member for end in (member.start, member.end))
    found = (wall_of(structure, member, end) for member, end in ends)
    return [wall for wall in found if wall is not None and not _has_springs(structure, wall)]


def walls_with_springs(structure: Structure) -> list[Wall]:
    """Return the faces of hollow chords with springs in the structure's segments."""
    if structure.external is not None:
        return []
    names = {segment.member for segment in structure.segment}
    branches = [member for member in structure.member if member.name in names]
    found = (wall_of(structure, member, end) for member in branches for end in (member.start, member.end))
    return [wall for wall in found if wall is not None and wall.springs(structure.segment)]


def _has_springs(structure: Structure, wall: Wall) -> bool:
    """Return whether the file has a joint at the node, of whatever member, or a segment at the place of a spring."""
    if any(math.dist(joint.at, wall.at) < ON_MEMBER for joint in structure.joint):
        return True
    own = (s for s in structure.segment if s.member == wall.branch.name and s.extent < 2 * wall.extent)
    places = [start + wall.extent / 2 for start in wall.start.values()]
    return any(abs(math.dist(s.at, wall.branch.start) - place) < wall.extent for s in own for place in places)


def wall_of(structure: Structure, branch: Member, at: Vector) -> Wall | None:
    """Return the face of a chord that a branch ends on; None if it ends on none.

    Parameters
    ----------
    branch : member
    at : place [m]
    """
    if not _is_end(branch, at):
        return None
    chords = (m for m in structure.member if m is not branch and m.passes(at) and not _is_end(m, at))
    return next((wall for chord in chords if (wall := _on_chord(structure, branch, chord, at))), None)


def _is_end(member: Member, at: Vector) -> bool:
    return min(math.dist(at, end) for end in (member.start, member.end)) < ON_MEMBER


def _on_chord(structure: Structure, branch: Member, chord: Member, at: Vector) -> Wall | None:
    own, section = structure.section[branch.section], structure.section[chord.section]
    if own.edge is None or section.edge is None or not _is_hollow(section):
        return None
    if abs(float(chord.axes[0] @ branch.axes[0])) > _ALONG:
        return None
    depth, aside, across, half = _face(section, chord, branch)
    own_half = float(np.max(np.abs(branch.axes[1:] @ across) * own.edge))
    if aside + own_half > _NARROW * half or depth > _MAX_OF_MEMBER * branch.length:
        return None
    extent = round(max(_EXTENT * math.sqrt(max(own.second_moment) / own.area), 2e-3 * branch.length), _DIGITS)
    about_chord: Axis = WALL_AXES[int(np.argmax(np.abs(branch.axes[1:] @ chord.axes[0])))]
    place = dict.fromkeys(WALL_AXES, depth)
    if not section.round:
        place[about_chord] += _BEYOND * (own_half / half) ** 2 * depth
    first = math.dist(at, branch.start) < ON_MEMBER
    start = {axis: own if first else branch.length - own - extent for axis, own in place.items()}
    return Wall(
        branch=branch,
        at=at,
        start=start,
        extent=extent,
        frequency=_lowest_frequency(structure, chord, 2 * half),
        expected=_expected(structure, branch, chord, about_chord, half, own_half / half),
    )


def _face(section: Section, chord: Member, branch: Member) -> tuple[float, float, FloatArray, float]:
    """Return where the axis of a branch leaves a chord, from the node along it and from the middle of the wall [m].

    Then follow the direction across this wall, and half of the wall's width [m]. A round chord is the same all around.
    """
    edge = np.array(section.edge)
    parts = np.abs(chord.axes[1:] @ branch.axes[0])
    if section.round:
        across = np.cross(chord.axes[0], branch.axes[0])
        return float(edge[0] / np.linalg.norm(parts)), 0.0, across / np.linalg.norm(across), float(edge[0])
    faced = int(np.argmax(parts / edge))  # axis of the section along which the branch leaves it
    depth = float(edge[faced] / parts[faced])
    return depth, float(depth * parts[1 - faced]), chord.axes[2 - faced], float(edge[1 - faced])


def _is_hollow(section: Section) -> bool:
    least = min(section.second_moment)
    return least > _BULK * section.area**2 and section.torsion_constant > _CLOSED * least


def _expected(
    structure: Structure, branch: Member, chord: Member, about_chord: Axis, half: float, share: float
) -> dict[Axis, float]:
    """Return the order of each flexibility.

    Parameters
    ----------
    about_chord : axis of the branch that is nearest to the chord's
    half : of the wall's width [m]
    share : of the wall's width that the branch has
    """
    own = structure.section[branch.section]
    ratio = structure.material[branch.material].youngs_modulus / structure.material[chord.material].youngs_modulus
    thickness = _thickness(structure.section[chord.section])
    unit = ratio / (branch.length * thickness**3)  # E of the branch over its length and E t^3
    left = 1 - share
    turns = dict(zip(WALL_AXES, (_ACROSS * left**2 * unit * moment for moment in own.second_moment), strict=False))
    turns[about_chord] *= _ABOUT_CHORD / (_ACROSS * left)
    return {**turns, "x": _PUSH * left**2 * unit * (2 * half) ** 2 * own.area}


def _thickness(section: Section) -> float:
    """Return the area of a tube over its outer circumference [m]: its wall's thickness less a share of t / width."""
    assert section.edge is not None
    return section.area / ((2 * np.pi if section.round else 8) * sum(section.edge) / 2)


def _lowest_frequency(structure: Structure, chord: Member, width: float) -> float:
    """Return the lowest frequency of a strip across a chord's wall, of a width [m], that turns at its ends [Hz]."""
    material = structure.material[chord.material]
    bending = math.sqrt(material.youngs_modulus / (12 * (1 - _NU**2) * material.density))
    return math.pi / 2 * bending * _thickness(structure.section[chord.section]) / width**2


def wall_segments(
    structure: Structure, flexibility: Mapping[tuple[str, Vector], Mapping[Axis, float]]
) -> list[Segment]:
    """Return the segments of walls with springs.

    Parameters
    ----------
    flexibility : by branch and node, of each axis [unit: `Wall.segments`]
    """
    found = ((wall_of(structure, structure.member_named(name), at), own) for (name, at), own in flexibility.items())
    return [segment for wall, own in found if wall is not None for segment in wall.segments(own)]


def with_wall_factors(
    structure: Structure, walls: Mapping[tuple[str, Vector], Mapping[Axis, Callable[[Wall, float], float]]]
) -> tuple[Segment, ...]:
    """Return the structure's segments with the factors of walls' springs changed, without walls that become rigid.

    Parameters
    ----------
    walls : by branch and node, of each axis the new factor by the wall and the old one
    """
    segments = list(structure.segment)
    for (name, at), change in walls.items():
        wall = wall_of(structure, structure.member_named(name), at)
        segments = [s for segment in segments if (s := _changed(wall, segment, change)) is not None]
    return tuple(segments)


def _changed(
    wall: Wall | None, segment: Segment, change: Mapping[Axis, Callable[[Wall, float], float]]
) -> Segment | None:
    """Return a segment, if it is of a wall with its factors changed; None if it does nothing then."""
    axes = wall.axes_of(segment) if wall is not None else ()
    if wall is None or not axes:
        return segment
    factors = _factors(segment).items()
    about_y, about_z, along = (change[a](wall, own) if a in axes and a in change else own for a, own in factors)
    if (about_y, about_z, along) == (1.0, 1.0, 1.0):
        return None
    return segment.model_copy(update={"bending": (about_y, about_z), "axial": along})
