"""Entries of structure.toml: materials, members, supports, joints, segments, bodies and sensors."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from daq import FloatArray
from updater.quantities import Opens, check_opening
from updater.structure.base import ON_MEMBER, Count, Entry, NotNegative, Number, Positive, Vector
from updater.structure.section_shapes import Section
from updater.structure.sensors import Correction, Sensor

Axis = Literal["x", "y", "z", "rx", "ry", "rz"]
AXES: tuple[Axis, ...] = ("x", "y", "z", "rx", "ry", "rz")
GROUP_UNCERTAINTY = 0.03  # as of a material
_SHORTEST = 1e-5  # m, of a member: ends nearer than a tenth of it are one node
_RIGID = 1e6  # flexibility of the grounds that a fixed support stands on, relative to its own
_ALONG = 1e-6  # sine of the least angle between a member and its local y axis


class Material(Entry):
    """An isotropic, linear elastic material; in a file, `poisson_ratio` may replace the shear modulus."""

    youngs_modulus: Positive  #: E [Pa]
    shear_modulus: Positive  #: G [Pa]
    density: Positive  #: [kg/m3]

    @model_validator(mode="before")
    @classmethod
    def _of_poisson_ratio(cls, content: object) -> object:
        """Put E / (2 (1 + nu)) in the place of nu."""
        if not isinstance(content, dict) or "poisson_ratio" not in content:
            return content
        if "shear_modulus" in content:
            raise ValueError("expected shear_modulus or poisson_ratio, found both")
        ratio, modulus = content["poisson_ratio"], content.get("youngs_modulus")
        if not isinstance(ratio, int | float) or not -1 < ratio <= 0.5:
            raise ValueError(f"poisson_ratio: expected more than -1 and up to 0.5, found {ratio!r}")
        known = {key: value for key, value in content.items() if key != "poisson_ratio"}
        return known | ({"shear_modulus": modulus / (2 * (1 + ratio))} if isinstance(modulus, int | float) else {})


class Group(Entry):
    """Named part of the stiffness of external matrices: a panel, a joint, a foot. Its factor can be fitted."""

    stiffness: Path  #: matrix of its own, as large as the whole. Default: the npz file of the whole
    factor: Positive = 1.0  #: factor of its stiffness [-]
    #: standard deviation of the logarithm of the factor before the calibration [-]
    uncertainty: Positive = GROUP_UNCERTAINTY


class External(Entry):
    """Stiffness and mass of another program; one npz file may contain all three.

    Members are then straight lines of the matrices' nodes, and have neither material, section nor elements.
    """

    stiffness: Path  #: Matrix Market, or npz
    mass: Path
    dofs: Path  #: CSV with node, x, y, z, axis of every row, or npz
    faces: Path | None = None  #: CSV with the nodes a, b, c, d about each face, or npz. Default: those of the npz
    factor: Positive = 1.0  #: factor of the stiffness, as calibrated [-]
    group: dict[str, Group] = Field(default_factory=dict)  #: parts of the stiffness by name; they do not overlap

    @model_validator(mode="before")
    @classmethod
    def _one_file(cls, given: Any) -> Any:  # noqa: ANN401 - whatever stands in the file
        if not isinstance(given, dict):
            return given
        if "matrices" in given:
            others = {key: value for key, value in given.items() if key != "matrices"}
            given = dict.fromkeys(("stiffness", "mass", "dofs"), given["matrices"]) | others
        whole, groups = given.get("stiffness"), given.get("group")
        if not isinstance(groups, dict) or Path(str(whole)).suffix != ".npz":
            return given
        own = {name: {"stiffness": whole} | part if isinstance(part, dict) else part for name, part in groups.items()}
        return given | {"group": own}

    def beside(self, folder: Path) -> "External":
        """Return the same with whole paths, those given taken as relative to a folder."""
        paths = {key: (folder / getattr(self, key)).resolve() for key in ("stiffness", "mass", "dofs")}
        groups = {
            name: part.model_copy(update={"stiffness": (folder / part.stiffness).resolve()})
            for name, part in self.group.items()
        }
        faces = None if self.faces is None else (folder / self.faces).resolve()
        return self.model_copy(update=paths | {"group": groups, "faces": faces})

    def with_factor(self, group: str, factor: float) -> "External":
        """Return the same with the stiffness of a group, or of all if it is "", multiplied by a factor."""
        if not group:
            return self.model_copy(update={"factor": self.factor * factor})
        part = self.group[group]
        changed = part.model_copy(update={"factor": part.factor * factor})
        return self.model_copy(update={"group": {**self.group, group: changed}})


class Member(Entry):
    """A straight member of constant section."""

    name: str
    start: Vector = Field(alias="from")  #: [m]
    end: Vector = Field(alias="to")  #: [m]
    material: str = ""  #: "" for external matrices
    section: str = ""
    elements: Annotated[Count, Field(ge=1)] = 0  #: elements of equal length; 0 for external matrices
    preload: Number = 0.0  #: axial force, positive in tension [N]
    local_y: Vector | None = None  #: approximate direction of the section's y axis. Default: horizontal

    @model_validator(mode="after")
    def _has_axes(self) -> Self:
        if self.start == self.end:
            raise ValueError(f"ends where it begins, at {list(self.start)}")
        if self.length < _SHORTEST:
            raise ValueError(f"expected a length of {_SHORTEST:g} m or more, found {self.length:g} m")
        if self.local_y is not None:
            across = np.linalg.norm(np.cross(self.local_y, np.subtract(self.end, self.start))) / self.length
            if across <= _ALONG * np.linalg.norm(self.local_y):
                raise ValueError(f"local_y {list(self.local_y)} does not point across the member")
        return self

    @property
    def length(self) -> float:
        """Length [m]."""
        return math.dist(self.start, self.end)

    @property
    def axes(self) -> FloatArray:
        """Local axes (3, 3), rows = local x, y, z."""
        return local_axes(np.subtract(self.end, self.start), self.local_y)

    def point(self, distance: FloatArray | float) -> FloatArray:
        """Return the points (..., 3) [m] at distances (...) [m] from the member's start."""
        share = np.asarray(distance, float)[..., None] / self.length
        return np.asarray(self.start) + share * np.subtract(self.end, self.start)

    def passes(self, point: Vector) -> bool:
        """Return whether a point [m] is on the member, to 0.1 mm."""
        for here, start, end in zip(point, self.start, self.end, strict=True):
            if here < min(start, end) - ON_MEMBER or here > max(start, end) + ON_MEMBER:
                return False  # most members, found without arrays
        along = np.subtract(self.end, self.start) / self.length
        distance = float(np.clip(np.subtract(point, self.start) @ along, 0, self.length))
        return bool(np.linalg.norm(self.point(distance) - point) < ON_MEMBER)


class Mesh(Entry):
    """Mesh of members that state no number of elements."""

    element_length: Positive  #: maximum length [m]


class Support(Entry):
    """A node held to the ground: rigidly on the fixed axes, by a spring on those in `stiffness`."""

    at: Vector
    fixed: tuple[Axis, ...] = ()
    stiffness: dict[Axis, Positive] = Field(default_factory=dict)  #: [N/m] or [N m/rad]

    @model_validator(mode="after")
    def _fixed_or_sprung(self) -> Self:
        both = sorted(set(self.fixed) & set(self.stiffness))
        if both:
            raise ValueError(f"support at {list(self.at)}: {', '.join(both)} is both fixed and on a spring")
        return self


class Joint(Entry):
    """Rotational springs between one member and the others that meet it; axes without one stay rigid."""

    member: str
    at: Vector
    stiffness: dict[Literal["rx", "ry", "rz"], Positive]  #: about the global axes [N m/rad]


class Segment(Entry):
    """A stretch of a member that is softer, stiffer or heavier than the rest of it; several may overlap."""

    member: str
    at: Vector  #: its middle [m]
    extent: Positive  #: its length [m]
    stiffness: Positive = 1.0  #: factor on its stiffness in bending and twist [-]
    bending: tuple[Positive, Positive] = (
        1.0,
        1.0,
    )  #: additional factors on bending about the member's local y and z axes [-]
    torsion: Positive = 1.0  #: additional factor on twist [-]
    shear_stiffness: Positive = 1.0  #: factor on its stiffness in shear and along the axis [-]
    axial: Positive = 1.0  #: additional factor on its stiffness along the axis [-]
    mass: Number = 0.0  #: more over its length, spread along it as the member's own is [kg]
    gyration: NotNegative = 1.0  #: square of that mass's radii of gyration over that of the section [-]


class Body(Entry):
    """A rigid body fixed to a member."""

    at: Vector  #: the point of the member it is fixed to [m]
    mass: Number  #: [kg], negative for a body that was removed
    offset: Vector = (0.0, 0.0, 0.0)  #: from that point to the body's centre of mass [m]
    inertia: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)  #: about its own centre, global axes [kg m2]

    def times(self, factor: float) -> "Body":
        """Return the same body, so many times as heavy."""
        x, y, z = (factor * own for own in self.inertia)
        return self.model_copy(update={"mass": factor * self.mass, "inertia": (x, y, z)})

    @model_validator(mode="after")
    def _inertia_has_its_sign(self) -> Self:
        if any(own * self.mass < 0 for own in self.inertia):
            raise ValueError(
                f"body at {list(self.at)}: inertia {list(self.inertia)} is not of the sign of its mass {self.mass}"
            )
        return self


class Oscillator(Entry):
    """A body on a spring of its own, which lets it move along one direction; along the others it moves as the member.

    An appendage, a loose part, a tuned damper.
    """

    at: Vector  #: point of the member where it is attached [m]
    direction: Vector
    mass: Positive  #: [kg]
    frequency: Positive  #: natural frequency with its foot fixed [Hz]

    @model_validator(mode="after")
    def _has_direction(self) -> Self:
        if not any(self.direction):
            raise ValueError(f"oscillator at {list(self.at)}: the direction is zero")
        return self


class Ground(Entry):
    """A floor, a foundation or a neighbouring structure with a mode of its own, which moves supports."""

    at: Annotated[tuple[Vector, ...], Field(min_length=1)]  #: supports that stand on it [m]
    axis: Axis  #: direction in which it moves them, or axis of rotation through the middle between them
    mass: Positive  #: modal mass [kg], about an axis moment of inertia [kg m2]
    frequency: Positive  #: natural frequency without the structure [Hz]

    @property
    def stiffness(self) -> float:
        """Stiffness of its own spring [N/m or N m/rad]."""
        return self.mass * (2 * math.pi * self.frequency) ** 2

    def motion(self, at: Vector) -> FloatArray:
        """Return the motion (6,) of a support per unit of its own, zero of one that does not stand on it."""
        if at not in self.at:
            return np.zeros(6)
        way = np.eye(3)[AXES.index(self.axis) % 3]
        if self.axis in AXES[:3]:
            return np.append(way, np.zeros(3))
        return np.append(np.cross(way, np.subtract(at, np.mean(self.at, axis=0))), way)


class BreathingCrack(Entry):
    """A crack, a connection that gapes, play, or dry friction, which opens and closes under the moment of its member.

    Members, supports and joints of the file have the mean flexibility: linear analyses use it. A simulation in time
    (`modalwatch rig`) opens and closes the crack.
    """

    member: str
    at: Vector  #: place on the member [m]
    #: local axis of the member that the moment acts about; x: torque
    axis: Literal["x", "y", "z"]
    flexibility: Positive  #: rotation per moment while it is open, or slides, over 1 / (E I) or 1 / (G J) [m]
    closed: NotNegative = 0.0  #: the same while it is closed, or sticks [m]
    mean: Positive  #: mean over time, which the rest of the file contains [m]
    moment: Number = 0.0  #: moment at which it opens, closes, or first slips [N m]
    #: side of that moment on which it is open; within, as play, or beyond it on both sides of zero; slips: with
    #: dry friction beyond it, until it turns back
    opens: Opens = "above"

    @model_validator(mode="after")
    def _mean_is_in_between(self) -> Self:
        if not self.closed <= self.mean <= self.flexibility:
            raise ValueError(
                f"breathing_crack of {self.member}: expected closed <= mean <= flexibility, "
                f"found {self.closed:g}, {self.mean:g}, {self.flexibility:g}"
            )
        check_opening(self.opens, self.moment)
        return self


class Recorder(Entry):
    """Recorder of the sensors."""

    clock: Positive = 1.0  #: ratio of indicated to true frequencies [-]


class Updating(Entry):
    """Choice of the model parameters that may be updated. Names are listed by `modalwatch structure --parameters`."""

    fixed: tuple[str, ...] = ()  #: names of parameters that keep the value of the file; `*` represents any characters
    bounds: dict[str, tuple[Positive, Positive]] = Field(default_factory=dict)  #: least and greatest value, by name

    @model_validator(mode="after")
    def _bounds_are_ordered(self) -> Self:
        for name, (least, greatest) in self.bounds.items():
            if least >= greatest:
                raise ValueError(f"bounds of {name}: expected [least, greatest], found [{least:g}, {greatest:g}]")
        return self


class Entries(Entry):
    """All entries of a structure file, with queries that need no check."""

    name: str
    external: External | None = None
    material: dict[str, Material] = Field(default_factory=dict)
    section: dict[str, Section] = Field(default_factory=dict)
    mesh: Mesh | None = None
    member: Annotated[tuple[Member, ...], Field(min_length=1)]
    support: tuple[Support, ...] = ()
    joint: tuple[Joint, ...] = ()
    segment: tuple[Segment, ...] = ()
    body: tuple[Body, ...] = ()
    oscillator: tuple[Oscillator, ...] = ()
    ground: tuple[Ground, ...] = ()
    breathing_crack: tuple[BreathingCrack, ...] = ()
    sensor: tuple[Sensor, ...] = ()  #: sensors as mounted
    #: corrections of their channels, by the sensor's own name
    sensors: dict[str, Correction] = Field(default_factory=dict)
    recorder: Recorder | None = None
    updating: Updating = Updating()

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the sensors' channels, as logs have them."""
        return tuple(sensor.channel for sensor in self.corrected_sensors)

    @property
    def grounded_supports(self) -> tuple[Support, ...]:
        """The supports, with stiff springs in the place of fixed axes along which a ground moves them."""
        return tuple(self._grounded(support) for support in self.support) if self.ground else self.support

    def _grounded(self, support: Support) -> Support:
        motion = np.array([part.motion(support.at) for part in self.ground])
        motion[np.abs(motion) < ON_MEMBER] = 0.0  # a lever by rounding
        flexibility = motion.T**2 @ [1 / part.stiffness for part in self.ground]
        moved = {a: _RIGID / f for a, f in zip(AXES, flexibility.tolist(), strict=True) if f and a in support.fixed}
        fixed = tuple(axis for axis in support.fixed if axis not in moved)
        return support.model_copy(update={"fixed": fixed, "stiffness": {**support.stiffness, **moved}})

    @property
    def corrected_sensors(self) -> tuple[Sensor, ...]:
        """The sensors as logs have them: each under the channel that carries it, with all of its gain."""
        return tuple(sensor.corrected(self.sensors.get(sensor.channel)) for sensor in self.sensor)

    @property
    def axis_lines(self) -> FloatArray:
        """Ends (n_members, 2, 3) of the members' axes [m]."""
        return np.array([[member.start, member.end] for member in self.member])

    @property
    def measuring_axes(self) -> dict[str, tuple[Vector, Vector]]:
        """Channel -> position of its sensor [m], and its direction, of any length."""
        return {sensor.channel: (sensor.at, sensor.direction) for sensor in self.corrected_sensors}

    @property
    def active_channels(self) -> tuple[str, ...]:
        """Names of the channels with a gain other than 0."""
        return tuple(sensor.channel for sensor in self.corrected_sensors if sensor.gain)

    @property
    def delays(self) -> dict[str, float]:
        """Known delay of each channel [s]."""
        known = {s.channel: self.sensors.get(s.channel) for s in self.sensor}
        return {h.channel: c.delay if c else 0.0 for h, c in zip(self.corrected_sensors, known.values(), strict=True)}

    def member_named(self, name: str) -> Member:
        """Return the member of that name."""
        return next(member for member in self.member if member.name == name)

    def rigidity(self, member: Member) -> Vector:
        """Return G J, and E I about the local y and z axes, of a member without its segments [N m2]."""
        material, section = self.material[member.material], self.section[member.section]
        about_y, about_z = section.second_moment
        modulus = material.youngs_modulus
        return material.shear_modulus * section.torsion_constant, modulus * about_y, modulus * about_z

    def segments_of(self, member: Member) -> list[tuple[float, float, Segment]]:
        """Return a member's segments, each with its start and end along the member [m]."""
        axis = np.subtract(member.end, member.start) / member.length
        own = [(float(np.subtract(s.at, member.start) @ axis), s) for s in self.segment if s.member == member.name]
        return [(max(x - s.extent / 2, 0.0), min(x + s.extent / 2, member.length), s) for x, s in own]

    def part_at(self, member: Member, distance: float) -> tuple[Material, Vector, tuple[float, float], float]:
        """Return a member's material at a distance from its start [m] as segments make it, and factors.

        Factors on stiffness in twist and in bending about the local y and z axes, on that along the axis and in shear,
        and on rotary and polar inertia in addition to the density's.
        """
        material, area = self.material[member.material], self.section[member.section].area
        here = [s for start, end, s in self.segments_of(member) if start <= distance <= end]
        if not here:
            return material, (1.0, 1.0, 1.0), (1.0, 1.0), 1.0
        density = material.density + sum(s.mass / s.extent for s in here) / area
        turning = material.density + sum(s.gyration * s.mass / s.extent for s in here) / area
        factors = np.prod([[s.stiffness * factor for factor in (s.torsion, *s.bending)] for s in here], axis=0)
        twist, about_y, about_z = factors.tolist()
        along, shear = np.prod([[s.shear_stiffness * s.axial, s.shear_stiffness] for s in here], axis=0).tolist()
        return (
            material.model_copy(update={"density": density}),
            (twist, about_y, about_z),
            (along, shear),
            turning / density if density else 1.0,
        )


def local_axes(direction: FloatArray, local_y: Vector | None = None) -> FloatArray:
    """Return unit vectors of the local axes of a member (3, 3): rows are local x, y and z.

    Parameters
    ----------
    direction : (3,) from the start of the member to its end, of any length
    local_y : direction that local y is nearest to. Default: horizontal, or global y for a vertical member
    """
    x = _unit(direction.tolist())  # plain numbers: numpy takes twenty times as long for three of them
    default = (0.0, 1.0, 0.0) if abs(x[2]) > 1 - 1e-9 else (-x[1], x[0], 0.0)
    y = local_y or default
    along = y[0] * x[0] + y[1] * x[1] + y[2] * x[2]
    y = _unit([y[k] - along * x[k] for k in range(3)])
    z = x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]
    return np.array([x, y, z])


def _unit(vector: Sequence[float]) -> Vector:
    length = math.hypot(*vector)
    return vector[0] / length, vector[1] / length, vector[2] / length
