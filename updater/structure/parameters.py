"""Physical parameters of a structure that may be fitted, with their priors."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cached_property, partial
from typing import Literal

import numpy as np

from daq import FloatArray
from updater.errors import SelectionError
from updater.structure.base import ON_MEMBER, Vector
from updater.structure.entries import AXES, Axis, Body, Group, Joint, Member, Segment, Support
from updater.structure.structure import Structure
from updater.structure.walls import (
    WALL_AXES,
    Wall,
    wall_of,
    wall_segments,
    walls_of,
    walls_with_springs,
    with_wall_factors,
)

_STIFFNESS_PRIOR = 0.03  # of ln E
_FLEXIBILITY_PRIOR = 0.02  # of c E I / L, c the spring's flexibility: a nominally rigid connection
_BEARING_PRIOR = 1e-4  # times c E I / L^3: prior flexibility of a nominally rigid bearing along an axis
_STATED_PRIOR = 1.0  # relative to a spring's flexibility in the file: it may be twice that, or half
_MIN_STATED = 0.1  # relative to the flexibility in the file
_RIGID = 1e-6  # the least flexibility of a turn, c E I / L
_STIFF_WALL = 1e-4  # the least of a wall, relative to the expected one
_UNMOVED = 1e-8  # the least of a bearing, c E I / L^3
_WELD_PRIOR = 0.5  # relative to the flexibility that a joint's zone lacks compared with the members
_WELDED = 0.95  # the most
_THICK = 2.0  # radii of gyration that a joint reaches: as far as a member is thick
_BLOCK = 4.0  # radii of gyration that a block or gusset reaches: of a solid bar 1.15 times its depth
_BLOCK_PRIOR = 2.0  # of ln of its factor on stiffness: a solid block is as good as rigid
_MAX_OF_MEMBER = 0.25  # of a member's length, that it reaches at the most
_OUTSIDE = 0.01  # relative distance outside its bounds that a file's value may have: it may be rounded
_PLACE_DIGITS = 6  # of a weld's place and extent in metres
# of ln(I / A) and ln(J / A) of a section, beyond E: outer dimensions are within 1 % (EN 10219-2), and sharp instead of
# rounded corners change I / A of a box by 1 to 3 %, J / A by 6 %
_AREA: Axis = "x"  # of a section's parameter that is its area
_SECTION_KEYS: Mapping[Axis, str] = {_AREA: "A", "rx": "J", "ry": "Iy", "rz": "Iz"}
# of ln A of a section, and relative to a body's mass: mills keep the mass of a length within 6 % (EN 10219-2), three
# deviations; bodies are weighed without their screws and cables
_MASS_PRIOR = 0.02
_HOUSING_PRIOR = 3e-3  # of the members' mass: each sensor's housing with its cable, which files leave out
_MIN_MASS = -0.5  # relative to the mass in the file
_SECTION_PRIORS: Mapping[Axis, float] = {_AREA: _MASS_PRIOR, "rx": 0.04, "ry": 0.02, "rz": 0.02}
_SECTION_DIGITS = 4  # of a factor on a section's stiffness: 5e-5 changes frequencies by less than 3e-5
_TWISTS = 0.5  # cosine squared of the angle between a member and an axis, above which it twists rather than bends
_START = 0.05  # times its standard deviation: start of nominally rigid or unwelded parameters
TURNS = AXES[3:]
_FACTOR = ".K"  # ending of the keys of factors on the stiffness of external matrices
_MASSES = {"body", "housings"}  # kinds of parameters that are masses
JOINT_ZONES = {"weld", "block"}  #: kinds of parameters that are stiffer zones about a joint
FACTORS = {"section", "block"}  #: kinds of parameters that are ln of a factor on the file's stiffness
Meeting = tuple[str, Vector]  #: a member, and where it meets others


@dataclass(frozen=True, kw_only=True)
class ModelParameter:
    """A parameter: ln of a stiffness, a connection's flexibility along or about one axis, its weld, or a mass.

    Stiffness is a material's, or a section's over its material's: in twist (axis rx), or bending about local axes.
    A section's area (axis x), as by a thicker wall, is a factor on all its stiffness and its mass. A body's mass is
    relative to that in the file, that of each sensor's housing is in kilograms.

    Flexibilities are c E I / L about an axis, c E I / L^3 along one, of the longest member. Those of a chord's wall
    are about the local axes of the branch, with its E I / L, and along it, with its E A / L. Members that meet overlap
    and are welded: near the joint they give less than their axes, drawn to a point, do. Of that flexibility a weld
    takes a share.
    """

    name: str
    key: str  #: name of the parameter, such as `steel.E`, `support 0.ry`, `crossbeam.rz`, `crossbeam.weld`
    prior: float  #: standard deviation about the mean
    kind: Literal["stiffness", "support", "joint", "weld", "block", "wall", "section", "body", "housings"]
    target: str = ""  #: material, index of the support or body, member, or section
    at: Vector = (0.0, 0.0, 0.0)  #: position of a joint, weld or body [m]
    axis: Axis = "x"
    mean: float = 0.0  #: expected value: that of the file, but of a wall that the file has rigid
    in_file: bool = True  #: False of a wall's spring that the file does not have
    lower: float = -np.inf  #: least value
    upper: float = np.inf  #: greatest value

    @property
    def of_matrices(self) -> bool:
        """True if it is the factor of all stiffness of external matrices."""
        return self.kind == "stiffness" and not self.target

    @property
    def of_group(self) -> bool:
        """True if it is the factor of a group of external matrices."""
        return self.kind == "stiffness" and self.key.endswith(_FACTOR) and bool(self.target)

    @property
    def of_rigid_wall(self) -> bool:
        """True if it is of a wall that the file has rigid."""
        return self.kind == "wall" and not self.in_file

    @property
    def has_mass(self) -> bool:
        """True if it is or has a mass."""
        return self.kind in _MASSES or (self.kind == "section" and self.axis == _AREA)

    @property
    def quantity(self) -> str:
        """Physical quantity of the parameter."""
        if self.kind == "stiffness":
            return "stiffness" if self.key.endswith(_FACTOR) else "Young's modulus"
        if self.kind in JOINT_ZONES:
            return f"stiffness factor {'of' if self.kind == 'weld' else 'beyond'} the joint zone"
        if self.kind == "section":
            named = {_AREA: "factor on area", "rx": "factor on twist"}
            return named.get(self.axis) or f"factor on bending about local {self.axis[1]}"
        if self.kind in _MASSES:
            return "mass" if self.kind == "body" else "mass of the housing"
        if self.kind == "wall":
            return self._of_wall
        if self.axis in TURNS:
            return f"rotational stiffness about {self.axis[1]}"
        return f"stiffness along {self.axis}"

    @property
    def _of_wall(self) -> str:
        """Physical quantity of a wall's parameter."""
        about = f"rotational stiffness of the wall about local {self.axis[1:]}"
        return about if self.axis in TURNS else "stiffness of the wall along the branch"

    @property
    def of(self) -> str:
        """Material, support, joint, section or body that it belongs to."""
        if self.kind == "stiffness":
            return self.target or "matrices"
        if self.kind in JOINT_ZONES:
            return self.target
        if self.kind == "section":
            return f"section {self.target}"
        if self.kind == "housings":
            return "each sensor"
        if self.kind == "body":
            return f"body {self.target}"
        return f"support {self.target}" if self.kind == "support" else f"the joint of {self.target}"

    @property
    def position(self) -> Vector | None:
        """Node that it belongs to [m]; None for a material, a section or all sensors."""
        return None if self.kind in {"stiffness", "section", "housings"} else self.at

    @property
    def start(self) -> float:
        """Value from which a fit starts."""
        return self.mean if self.mean or np.isinf(self.lower) else min(_START * self.prior, self.upper / 2)


def with_springs(structure: Structure) -> Structure:
    """Return the structure with springs where feet, bearings and joints are rigid, so stiff that it shows nowhere."""
    knobs = [knob for knob in model_parameters_of(structure) if is_rigid(knob)]
    return apply_parameters(structure, knobs, nominal_parameters(knobs))


def nominal_parameters(knobs: Sequence[ModelParameter]) -> FloatArray:
    """Return the values (n_knobs,) of parameters as the structure file has them [unit of each: `ModelParameter`].

    Rigid connections have the springs of `with_springs`.
    """
    return np.array([_nominal(knob) for knob in knobs])


def _nominal(knob: ModelParameter) -> float:
    if knob.of_rigid_wall:
        return knob.lower
    return 10 * knob.lower if is_rigid(knob) else knob.mean


def is_rigid(knob: ModelParameter) -> bool:
    """Return whether a parameter is of a connection that the file has rigid."""
    return knob.kind in {"support", "joint"} and not knob.mean


def starts_rigid(knob: ModelParameter) -> bool:
    """Return whether a parameter is a flexibility that the file does not have: of a connection or a wall."""
    return is_rigid(knob) or knob.of_rigid_wall


def model_parameters_of(structure: Structure, *, of_file: bool = False) -> list[ModelParameter]:
    """Return the parameters that may be updated: `all_knobs` without those that the structure fixes, bounded.

    Parameters
    ----------
    of_file : whether to add, last, those that only an error of the file changes: sections and masses
    """
    every = [*all_knobs(structure), *(_of_the_file(structure) if of_file else ())]
    free = [k for k in every if not any(_matches(structure, k, p) for p in structure.updating.fixed)]
    return [_bounded(structure, knob) for knob in free]


def check_updating(structure: Structure) -> None:
    """Check that the parameters that a structure fixes or bounds exist, and that bounds hold the file's values.

    Raises
    ------
    SelectionError
        Naming the parameter, and the ones that there are.
    """
    knobs = [*all_knobs(structure), *_of_the_file(structure)]
    for pattern in (*structure.updating.fixed, *structure.updating.bounds):
        if not any(_matches(structure, knob, pattern) for knob in knobs):
            known = ", ".join(knob.key for knob in knobs)
            raise SelectionError(f"updating: there is no parameter {pattern!r}; the parameters are {known}")
    for pattern, (least, greatest) in structure.updating.bounds.items():
        for knob in (k for k in knobs if _matches(structure, k, pattern) and not starts_rigid(k)):
            nominal = physical_value(structure, knob, knob.mean)
            if not least * (1 - _OUTSIDE) <= nominal <= greatest * (1 + _OUTSIDE):
                raise SelectionError(
                    f"updating: bounds of {pattern!r}: expected to contain the file's value {nominal:.6g}, "
                    f"found [{least:g}, {greatest:g}]"
                )


def _matches(structure: Structure, knob: ModelParameter, pattern: str) -> bool:
    """Return whether a pattern matches a parameter; a member's name matches its material's parameters."""
    keys = [knob.key]
    if knob.kind == "stiffness":
        keys += [f"{member.name}.E" for member in structure.member if member.material == knob.target]
    return any(fnmatchcase(key, pattern) for key in keys)


def _bounded(structure: Structure, knob: ModelParameter) -> ModelParameter:
    """Return a parameter with the bounds of the structure; rigid connections of the file have no greatest stiffness."""
    for pattern, bounds in structure.updating.bounds.items():
        if _matches(structure, knob, pattern):
            lower, upper = sorted(fitted_value(structure, knob, bound) for bound in bounds)
            upper = min(knob.upper, upper)
            if starts_rigid(knob):
                knob = replace(knob, mean=min(knob.mean, upper), upper=upper)
            else:
                knob = replace(knob, lower=min(max(knob.lower, lower), knob.mean), upper=max(upper, knob.mean))
    return knob


def physical_value(structure: Structure, knob: ModelParameter, value: float) -> float:
    """Return a fitted value as a modulus [Pa], mass [kg], stiffness [N/m, N m/rad] or factor [-]: `physical_unit`.

    Parameters
    ----------
    structure, knob : the parameter, and the structure that it belongs to
    value : fitted value [unit of the parameter]
    """
    if knob.kind == "stiffness":
        return _filed_modulus(structure, knob) * float(np.exp(value))
    if knob.kind == "weld":
        return 1 / (1 - value)
    if knob.kind in FACTORS:
        return float(np.exp(value))
    if knob.kind == "body":
        return structure.body[int(knob.target)].mass * (1 + value)
    if knob.kind == "housings":
        return value
    return _unit(structure, knob) / value


def _unit(structure: Structure, knob: ModelParameter) -> float:
    """Return the stiffness of a connection or a wall with a flexibility of one [N m/rad or N/m]."""
    if knob.kind != "wall":
        return flexibility_unit(structure, knob.axis, knob.at)
    branch = structure.member_named(knob.target)
    section, modulus = structure.section[branch.section], structure.material[branch.material].youngs_modulus
    of_axis = dict(zip(WALL_AXES, (*section.second_moment, section.area), strict=True))
    return modulus * of_axis[knob.axis] / branch.length


def physical_slope(structure: Structure, knob: ModelParameter, value: float) -> float:
    """Return the magnitude of the derivative of `physical_value`: the factor from fitted to physical deviations.

    Parameters
    ----------
    structure, knob : the parameter, and the structure that it belongs to
    value : fitted value [unit of the parameter]
    """
    now = physical_value(structure, knob, value)
    if knob.kind in {"stiffness", *FACTORS}:
        return now
    if knob.kind in _MASSES:
        return abs(structure.body[int(knob.target)].mass) if knob.kind == "body" else 1.0
    return now**2 if knob.kind == "weld" else now / value


def fitted_value(structure: Structure, knob: ModelParameter, value: float) -> float:
    """Return the fitted value of a physical one: the inverse of `physical_value`."""
    if knob.kind == "stiffness":
        return float(np.log(value / _filed_modulus(structure, knob)))
    if knob.kind == "weld":
        return 1 - 1 / value
    if knob.kind in FACTORS:
        return float(np.log(value))
    if knob.kind == "body":
        return value / structure.body[int(knob.target)].mass - 1
    if knob.kind == "housings":
        return value
    return _unit(structure, knob) / value


def physical_unit(structure: Structure, knob: ModelParameter) -> str:
    """Return the unit of a parameter: Pa, N m/rad, N/m, kg, or - for a factor."""
    if knob.kind == "stiffness":
        return "-" if structure.external is not None else "Pa"
    if knob.kind in {*JOINT_ZONES, "section"}:
        return "-"
    if knob.kind in _MASSES:
        return "kg"
    return "N m/rad" if knob.axis in TURNS else "N/m"


def _filed_modulus(structure: Structure, knob: ModelParameter) -> float:
    """Return Young's modulus of a material [Pa], or the factor of matrices from another program."""
    if structure.external is not None:
        return structure.external.group[knob.target].factor if knob.target else structure.external.factor
    return structure.material[knob.target].youngs_modulus


def all_knobs(structure: Structure) -> list[ModelParameter]:
    """Return the parameters of each material, foot, bearing and joint."""
    if structure.external is not None:  # of external matrices only factors are known, and springs of the file
        whole = ModelParameter(name="stiffness", key="matrices" + _FACTOR, prior=_STIFFNESS_PRIOR, kind="stiffness")
        groups = [_of_group(name, part) for name, part in structure.external.group.items()]
        return [whole, *groups, *_springs_of_supports(structure)]
    knobs = [
        ModelParameter(name=f"stiffness of {m}", key=f"{m}.E", prior=_STIFFNESS_PRIOR, kind="stiffness", target=m)
        for m in structure.material
    ]
    unit = FlexibilityUnits(structure)
    for i, support in enumerate(structure.support):
        knobs += [_rigid(f"support {i}", a, "support", str(i), support.at) for a in may_give(support)]
        knobs += [_stated(unit, f"support {i}", a, "support", str(i), support) for a in support.stiffness]
    found = meetings(structure)
    times = Counter([*(joint.member for joint in structure.joint), *(member for member, _ in found)])
    for joint in structure.joint:
        name = f"joint of {joint.member}" + _place(joint.at, times[joint.member])
        knobs += [_stated(unit, name, a, "joint", joint.member, joint) for a in joint.stiffness]
    for member, at in found:
        place = _place(at, times[member])
        knobs += [_rigid(f"joint of {member}{place}", a, "joint", member, at) for a in TURNS]
        if any(knob.kind == "weld" and knob.at == at for knob in knobs):  # one holds all that meet there
            continue
        knobs.append(
            ModelParameter(
                name=f"weld of {member}{place}",
                key=f"{member}{place}.weld",
                prior=_WELD_PRIOR,
                kind="weld",
                target=member,
                at=at,
                lower=0.0,
                upper=_WELDED,
            )
        )
    return [*knobs, *_of_walls(structure)]


def _of_walls(structure: Structure) -> list[ModelParameter]:
    """Return the springs of walls of hollow chords that branches are welded to: those of the file, or expected ones.

    The file has them where a diagnosis wrote them as effective ones. They are as uncertain as expected ones: a spring
    that stays as it was would leave its error to the feet.
    """
    walls = [(wall, wall.expected, False) for wall in walls_of(structure)]
    walls += [(wall, wall.springs(structure.segment), True) for wall in walls_with_springs(structure)]
    times = Counter(wall.branch.name for wall, _, _ in walls)
    return [
        ModelParameter(
            name=f"wall at {wall.branch.name}{place} flexibility {axis}",
            key=f"{wall.branch.name}{place}.wall_{axis}",
            prior=wall.expected[axis],
            kind="wall",
            target=wall.branch.name,
            at=wall.at,
            axis=axis,
            mean=mean[axis],
            in_file=in_file,
            lower=min(_STIFF_WALL * wall.expected[axis], mean[axis]),
        )
        for wall, mean, in_file in walls
        for place in (_place(wall.at, times[wall.branch.name]),)
        for axis in mean
    ]


def _of_the_file(structure: Structure) -> list[ModelParameter]:
    """Return the parameters that only an error of the file changes."""
    return [*_of_sections(structure), *_of_masses(structure), *_of_blocks(structure)]


def _of_blocks(structure: Structure) -> list[ModelParameter]:
    """Return the stiffness about joints beyond the welds, as by a solid block or gussets."""
    blocks = (
        replace(
            weld,
            kind="block",
            name=weld.name.replace("weld of", "block of", 1),
            key=f"{weld.key.removesuffix('weld')}block",
            prior=_BLOCK_PRIOR,
            upper=np.inf,
        )
        for weld in all_knobs(structure)
        if weld.kind == "weld"
    )
    return [block for block in blocks if joint_zones(structure, block)]


def _of_masses(structure: Structure) -> list[ModelParameter]:
    """Return the masses of bodies and of the sensors' housings; of external matrices only those of bodies.

    Housings are of one kind and have one mass. Where the file has a body at a sensor, it is that.
    """
    knobs = [
        ModelParameter(
            name=f"mass of body {i}",
            key=f"body {i}.mass",
            prior=_MASS_PRIOR,
            kind="body",
            target=str(i),
            at=body.at,
            lower=_MIN_MASS,
        )
        for i, body in enumerate(structure.body)
        if body.mass
    ]
    total = 0.0 if structure.external else sum(_mass_of(structure, member) for member in structure.member)
    housings = ModelParameter(
        name="mass of the housings", key="sensors.mass", prior=_HOUSING_PRIOR * total, kind="housings", lower=0.0
    )
    return [*knobs, housings] if total and bodies_of_one(structure, housings) else knobs


def bodies_of_one(structure: Structure, knob: ModelParameter) -> tuple[Body, ...]:
    """Return the bodies that one of a parameter adds to those of the file: housings where it has none."""
    if knob.kind == "body":
        return (structure.body[int(knob.target)],)
    if knob.kind != "housings":
        return ()
    places = dict.fromkeys(sensor.at for sensor in structure.sensor)
    alone = (at for at in places if not any(_same(at, body.at) for body in structure.body))
    return tuple(Body(at=at, mass=1.0) for at in alone)


def segments_of_one(structure: Structure, knob: ModelParameter) -> tuple[Segment, ...]:
    """Return the mass that one of a section's area adds, as segments along whole members."""
    if knob.kind != "section" or not knob.has_mass:
        return ()
    doubled = _section_segments(structure, {knob.target: {_AREA: 2.0}})
    return tuple(Segment(member=s.member, at=s.at, extent=s.extent, mass=s.mass) for s in doubled)


def _mass_of(structure: Structure, member: Member) -> float:
    """Return the mass of a member's material [kg]."""
    return structure.material[member.material].density * structure.section[member.section].area * member.length


def _of_sections(structure: Structure) -> list[ModelParameter]:
    """Return the parameters of the sections that members have; none of external matrices."""
    return [
        ModelParameter(
            name=f"section {name} {axis}",
            key=f"{name}.{_SECTION_KEYS[axis]}",
            prior=_SECTION_PRIORS[axis],
            kind="section",
            target=name,
            axis=axis,
        )
        for name in dict.fromkeys(member.section for member in structure.member)
        for axis in _SECTION_KEYS
        if structure.external is None
    ]


def _springs_of_supports(structure: Structure) -> list[ModelParameter]:
    unit = FlexibilityUnits(structure)
    return [
        _stated(unit, f"support {i}", axis, "support", str(i), support)
        for i, support in enumerate(structure.support)
        for axis in support.stiffness
    ]


def _of_group(name: str, group: Group) -> ModelParameter:
    return ModelParameter(
        name=f"stiffness of {name}", key=name + _FACTOR, prior=group.uncertainty, kind="stiffness", target=name
    )


def may_give(support: Support) -> list[Axis]:
    """Return the fixed axes with a possible flexibility: rotations, and the restrained axes of a bearing."""
    clamped = all(a in support.fixed or a in support.stiffness for a in TURNS)
    return [a for a in support.fixed if a in TURNS or not clamped]


def _rigid(name: str, axis: Axis, kind: Literal["support", "joint"], target: str, at: Vector) -> ModelParameter:
    prior, lower = (_FLEXIBILITY_PRIOR, _RIGID) if axis in TURNS else (_BEARING_PRIOR, _UNMOVED)
    return ModelParameter(
        name=f"{name} flexibility {axis}",
        key=f"{name.removeprefix('joint of ')}.{axis}",
        prior=prior,
        kind=kind,
        target=target,
        at=at,
        axis=axis,
        lower=lower,
    )


def _stated(
    unit: "FlexibilityUnits",
    name: str,
    axis: Axis,
    kind: Literal["support", "joint"],
    target: str,
    spring: Support | Joint,
) -> ModelParameter:
    mean = unit(axis, spring.at) / dict(spring.stiffness)[axis]  # type: ignore[index]
    return ModelParameter(
        name=f"{name} flexibility {axis}",
        key=f"{name.removeprefix('joint of ')}.{axis}",
        prior=_STATED_PRIOR * mean,
        kind=kind,
        target=target,
        at=spring.at,
        axis=axis,
        mean=mean,
        lower=_MIN_STATED * mean,
    )


def _place(at: Vector, times: int) -> str:
    """Return where, for a member that has joints at several places."""
    return " at ({:g}, {:g}, {:g})".format(*at) if times > 1 else ""


def meetings(structure: Structure) -> list[Meeting]:
    """Return where members' ends meet others rigidly: of n at a point without joints, all but the first."""
    if structure.external is not None:
        return []
    found: list[Meeting] = []
    points: list[Vector] = []
    for point in (end for member in structure.member for end in (member.start, member.end)):
        if any(_same(point, other) for other in points):
            continue
        points.append(point)
        loose = {joint.member for joint in structure.joint if _same(joint.at, point)}
        there = [m.name for m in structure.member if m.name not in loose and m.passes(point)]
        found += [(name, point) for name in there[1:]]
    return found


def _same(one: Vector, other: Vector) -> bool:
    return bool(np.linalg.norm(np.subtract(one, other)) < ON_MEMBER)


def apply_parameters(structure: Structure, knobs: list[ModelParameter], x: FloatArray) -> Structure:
    """Return the structure with fitted parameters written into it.

    Parameters
    ----------
    structure : as in the file
    knobs : the parameters
    x : (n_knobs,) their values, as fitted [unit of each: `ModelParameter`]
    """
    material = dict(structure.material)
    supports, joints = list(structure.support), list(structure.joint)
    bodies = list(structure.body)
    welds: list[tuple[ModelParameter, float]] = []
    unit = FlexibilityUnits(structure)
    factors: dict[str, dict[Axis, float]] = {}
    walls: dict[Meeting, dict[Axis, float]] = {}
    changed_walls: dict[Meeting, dict[Axis, Callable[[Wall, float], float]]] = {}
    external = structure.external
    for knob, value in zip(knobs, x.tolist(), strict=True):
        if knob.kind == "stiffness" and external is not None:
            external = external.with_factor(knob.target, float(np.exp(value)))
        elif knob.kind == "stiffness":
            old, factor = material[knob.target], float(np.exp(value))
            changed = {"youngs_modulus": old.youngs_modulus * factor, "shear_modulus": old.shear_modulus * factor}
            material[knob.target] = old.model_copy(update=changed)
        elif knob.kind in JOINT_ZONES:
            welds.append((knob, physical_value(structure, knob, value)))
        elif knob.kind == "section":
            factors.setdefault(knob.target, {})[knob.axis] = round(float(np.exp(value)), _SECTION_DIGITS)
        elif knob.kind == "wall" and knob.in_file:
            changed_walls.setdefault((knob.target, knob.at), {})[knob.axis] = partial(_wall_factor, value)
        elif knob.kind == "wall":
            walls.setdefault((knob.target, knob.at), {})[knob.axis] = value
        elif knob.kind == "body":
            bodies[int(knob.target)] = bodies[int(knob.target)].times(1 + value)
        elif knob.kind == "housings":
            bodies += [body.times(value) for body in bodies_of_one(structure, knob)]
        elif knob.kind == "support":
            i, spring = int(knob.target), unit(knob.axis, knob.at) / value
            supports[i] = _sprung(supports[i], knob.axis, spring)
        else:
            _put_joint(joints, knob, unit(knob.axis, knob.at) / value)
    springs = wall_segments(structure, walls)
    own = with_wall_factors(structure, changed_walls)
    walled = structure.model_copy(update={"segment": (*own, *springs)})
    zones = [segment for knob, factor in welds for segment in joint_segments(walled, knob, factor)]
    return structure.model_copy(
        update={
            "external": external,
            "material": material,
            "support": tuple(supports),
            "joint": tuple(joints),
            "body": tuple(bodies),
            "segment": (*own, *_section_segments(structure, factors), *zones, *springs),
        }
    )


def _wall_factor(flexibility: float, wall: Wall, factor: float) -> float:
    """Return the factor of a wall's spring with a flexibility instead of the factor that it has."""
    del factor
    return wall.factor(flexibility)


def _section_segments(structure: Structure, factors: Mapping[str, Mapping[Axis, float]]) -> list[Segment]:
    """Return segments along whole members with factors on the stiffness and the area of their sections."""
    found = []
    for member in structure.member:
        if of := factors.get(member.section):
            x, y, z = member.point(member.length / 2).round(_PLACE_DIGITS).tolist()
            bending, area = (of.get("ry", 1.0), of.get("rz", 1.0)), of.get(_AREA, 1.0)
            found.append(
                Segment(
                    member=member.name,
                    at=(x, y, z),
                    extent=member.length,
                    stiffness=area,
                    bending=bending,
                    torsion=of.get("rx", 1.0),
                    shear_stiffness=area,
                    mass=(area - 1) * _mass_of(structure, member),
                )
            )
    return found


def _put_joint(joints: list[Joint], knob: ModelParameter, spring: float) -> None:
    """Write a spring into the joint of its member at its place, which it makes if there is none."""
    for i, joint in enumerate(joints):
        if joint.member == knob.target and _same(joint.at, knob.at):
            joints[i] = joint.model_copy(update={"stiffness": {**joint.stiffness, knob.axis: spring}})
            return
    joints.append(Joint.model_validate({"member": knob.target, "at": knob.at, "stiffness": {knob.axis: spring}}))


def connection_of(structure: Structure, knob: ModelParameter) -> Support | Joint:
    """Return the support or joint that a parameter is a flexibility of."""
    if knob.kind == "support":
        return structure.support[int(knob.target)]
    return next(joint for joint in structure.joint if is_of(structure, joint, knob))


def is_of(structure: Structure, connection: Support | Joint, knob: ModelParameter) -> bool:
    """Return whether a parameter is a connection's flexibility."""
    if isinstance(connection, Joint):
        return knob.kind == "joint" and connection.member == knob.target and _same(connection.at, knob.at)
    return knob.kind == "support" and connection.at == structure.support[int(knob.target)].at


def joint_segments(structure: Structure, knob: ModelParameter, factor: float) -> list[Segment]:
    """Return the zones of the members that meet at a joint, with a factor on stiffness in bending and twist."""
    found = []
    for member, start, end in joint_zones(structure, knob):
        x, y, z = member.point((start + end) / 2).round(_PLACE_DIGITS).tolist()
        extent = round(end - start, _PLACE_DIGITS)
        found.append(Segment(member=member.name, at=(x, y, z), extent=extent, stiffness=factor))
    return found


def joint_zones(structure: Structure, knob: ModelParameter) -> list[tuple[Member, float, float]]:
    """Return the members that meet at a joint, and from where to where along each a zone of it reaches [m].

    A weld reaches from the joint as far as a member is thick, a block from there on. Both end half-way to the next
    joint of the member, and leave out a segment with the springs of a chord's wall, where the structure has one.
    """
    found = []
    for member in structure.member:
        if member.passes(knob.at):
            section, s = structure.section[member.section], float(np.linalg.norm(np.subtract(knob.at, member.start)))
            radius, most = (max(section.second_moment) / section.area) ** 0.5, _MAX_OF_MEMBER * member.length
            inner, outer = min(_THICK * radius, most), min(_BLOCK * radius, most)
            beyond = [(s - outer, s - inner), (s + inner, s + outer)]
            zones = beyond if knob.kind == "block" else [(s - inner, s + inner)]
            least, greatest = _half_way(structure, member, knob.at, 2 * outer)
            cut = [(max(start, least), min(end, greatest)) for start, end in zones]
            wall = wall_of(structure, member, knob.at)
            if wall is not None:
                soft = {axis for segment in structure.segment for axis in wall.axes_of(segment)}
                for gap in sorted(wall.span(axis) for axis in soft):
                    cut = [part for zone in cut for part in _without(*zone, *gap)]
            found += [(member, start, end) for start, end in cut if end - start > ON_MEMBER]
    return found


def _without(start: float, end: float, gap_start: float, gap_end: float) -> list[tuple[float, float]]:
    """Return what a gap leaves of a zone: one part, or two [m]."""
    return [(start, min(end, gap_start)), (max(start, gap_end), end)]


def _half_way(structure: Structure, member: Member, at: Vector, reach: float) -> tuple[float, float]:
    """Return half-way from a joint to the joints before and after it on a member, or the member's ends [m].

    Parameters
    ----------
    at : place of the joint [m]
    reach : distance within which other joints are sought [m]
    """
    ends = {end for other in structure.member for end in (other.start, other.end) if math.dist(end, at) < reach}
    joints = [end for end in ends if member.passes(end) and sum(other.passes(end) for other in structure.member) > 1]
    s, *others = (math.dist(joint, member.start) for joint in (at, *joints))
    before = [(s + other) / 2 for other in others if other < s - ON_MEMBER]
    after = [(s + other) / 2 for other in others if other > s + ON_MEMBER]
    return max(before, default=0.0), min(after, default=member.length)


def _sprung(support: Support, axis: Axis, spring: float) -> Support:
    """Return a support with a spring [N m/rad or N/m] about or along an axis."""
    fixed = tuple(a for a in support.fixed if a != axis)
    return support.model_copy(update={"fixed": fixed, "stiffness": {**support.stiffness, axis: spring}})


def flexibility_unit(structure: Structure, axis: Axis, at: Vector) -> float:
    """Return the unit of a connection's flexibility: E I / L about an axis [N m/rad], E I / L^3 along one [N/m].

    L is that of the longest member. I about an axis is the least of the members there that bend about it: a foot or a
    joint of a flat bar yields with the bar, much more about the weak axis than about the strong one. Where none bends
    about it, and along an axis, E I is that of the longest member about its strong axis. Of external matrices, whose
    E I is unknown, 1 N m/rad and 1 N/m.

    Parameters
    ----------
    at : place of the connection [m]
    """
    return FlexibilityUnits(structure)(axis, at)


class FlexibilityUnits:
    """Units of the flexibilities of a structure's connections, each as by `flexibility_unit`.

    The longest member, and the members at each place, are found once.
    """

    def __init__(self, structure: Structure) -> None:
        """Prepare the units of a structure."""
        self._structure = structure
        self._there: dict[Vector, list[Member]] = {}

    def __call__(self, axis: Axis, at: Vector) -> float:
        """Return the unit about or along an axis at a place [N m/rad or N/m]."""
        if self._structure.external is not None:
            return 1.0
        length, strong = self._longest
        if axis not in TURNS:
            return strong / length / length**2
        there = (_bending_rigidity(self._structure, member, axis) for member in self._members(at))
        return min((rigidity for rigidity in there if rigidity), default=strong) / length

    @cached_property
    def _longest(self) -> tuple[float, float]:
        """Length [m] and strong E I [N m2] of the longest member."""
        member = max(self._structure.member, key=lambda m: m.length)
        modulus = self._structure.material[member.material].youngs_modulus
        return member.length, modulus * max(self._structure.section[member.section].second_moment)

    @cached_property
    def _ends(self) -> FloatArray:
        """Ends of the members (n_members, 2, 3) [m]."""
        return np.array([(member.start, member.end) for member in self._structure.member])

    def _members(self, at: Vector) -> list[Member]:
        """Return the members that pass through a place, in the order of the file."""
        if at not in self._there:
            near = (self._ends.min(1) <= np.add(at, ON_MEMBER)) & (self._ends.max(1) >= np.subtract(at, ON_MEMBER))
            members = (self._structure.member[i] for i in np.flatnonzero(near.all(1)))
            self._there[at] = [member for member in members if member.passes(at)]
        return self._there[at]


def _bending_rigidity(structure: Structure, member: Member, axis: Axis) -> float:
    """Return E I of a member about a global axis across it [N m2], 0 if it rather twists about it."""
    twist, *bending = (member.axes[:, TURNS.index(axis)] ** 2).tolist()
    if twist > _TWISTS:
        return 0.0
    moment = np.dot(bending, structure.section[member.section].second_moment) / sum(bending)
    return structure.material[member.material].youngs_modulus * float(moment)
