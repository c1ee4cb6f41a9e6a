"""Structure as written to a file: without springs and welds that have no effect, rounded to the known digits."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np

from updater.quantities import rounded_value
from updater.structure.base import Entry, Vector
from updater.structure.entries import AXES, Axis, External, Joint, Material, Segment, Support
from updater.structure.parameters import (
    JOINT_ZONES,
    ModelParameter,
    flexibility_unit,
    is_of,
    is_rigid,
    joint_segments,
    physical_value,
    starts_rigid,
)
from updater.structure.structure import Structure
from updater.structure.walls import Wall, with_wall_factors

_Connection = TypeVar("_Connection", Support, Joint)
_Entry = TypeVar("_Entry", bound=Entry)
_DIGITS, _PLACE_DECIMALS = 5, 6  # of numbers without a deviation; of places [m]
_NEGLIGIBLE = 15.0  # times the least flexibility: a stiffer connection is rigid, which changes frequencies by 2e-5
_FACTOR_DIGITS = 0.01  # relative deviation that a factor is rounded as if it had at most: a change is known better
_NO_WELD = 1e-4  # relative change of a segment's stiffness that is left out, which changes frequencies by 1e-5


def simplified(structure: Structure, knobs: Sequence[ModelParameter]) -> Structure:
    """Return the structure without springs, also of walls, and welds that change nothing.

    Parameters
    ----------
    knobs : parameters of the file that the structure was made from
    """
    supports, joints = list(structure.support), list(structure.joint)
    for knob in knobs:
        if knob.kind == "support":
            i = int(knob.target)
            if stands_for_rigid(structure, supports[i], knob):
                supports[i] = _held(supports[i], knob.axis)
        else:
            joints = [_stiffened(j, knob.axis) if stands_for_rigid(structure, j, knob) else j for j in joints]
    segments = with_wall_factors(structure, _by_wall({knob: partial(_rigid_wall, knob) for knob in knobs}))
    return structure.model_copy(
        update={
            "support": tuple(supports),
            "joint": tuple(joint for joint in joints if joint.stiffness),
            "segment": tuple(segment for segment in segments if not _does_nothing(segment)),
        }
    )


def _by_wall(
    change: Mapping[ModelParameter, Callable[[Wall, float], float]],
) -> dict[tuple[str, Vector], dict[Axis, Callable[[Wall, float], float]]]:
    """Return changes of the springs of walls by branch and node, of each axis; those of other parameters are left."""
    found: dict[tuple[str, Vector], dict[Axis, Callable[[Wall, float], float]]] = {}
    for knob, own in change.items():
        if knob.kind == "wall":
            found.setdefault((knob.target, knob.at), {})[knob.axis] = own
    return found


def _rigid_wall(knob: ModelParameter, wall: Wall, factor: float) -> float:
    """Return the factor of a wall's spring, 1 if it is as good as rigid."""
    return 1.0 if is_negligible(knob, wall.flexibility(factor)) else factor


def without_edges(structure: Structure) -> Structure:
    """Return the structure without the edges of sections, on which stresses depend but no motion."""
    none: dict[str, object] = {"edge": None, "round": False}
    sections = {name: section.model_copy(update=none) for name, section in structure.section.items()}
    return structure.model_copy(update={"section": sections})


def stands_for_rigid(structure: Structure, connection: Support | Joint, knob: ModelParameter) -> bool:
    """Return whether a spring is of a connection that the file has rigid, and so stiff that it changes nothing.

    Parameters
    ----------
    structure : with the connection
    knob : parameter of the file
    """
    if not (is_rigid(knob) and is_of(structure, connection, knob)):
        return False
    return is_negligible(knob, _flexibility(structure, connection, knob.axis))


def is_negligible(knob: ModelParameter, value: float) -> bool:
    """Return whether a parameter is the flexibility of a connection, or a wall, that is practically rigid.

    Parameters
    ----------
    knob : the parameter
    value : fitted value [unit of the parameter]
    """
    return starts_rigid(knob) and value < _NEGLIGIBLE * knob.lower


def _flexibility(structure: Structure, connection: Support | Joint, axis: Axis) -> float:
    """Return a connection's flexibility in its unit; infinite where it has no spring."""
    stiffness = dict(connection.stiffness.items()).get(axis)
    return flexibility_unit(structure, axis, connection.at) / stiffness if stiffness else np.inf


def _held(support: Support, axis: Axis) -> Support:
    fixed = tuple(a for a in AXES if a in support.fixed or a == axis)
    return support.model_copy(update={"fixed": fixed, "stiffness": _others(support.stiffness, axis)})


def _stiffened(joint: Joint, axis: Axis) -> Joint:
    return joint.model_copy(update={"stiffness": _others(joint.stiffness, axis)})


def _others(stiffness: Mapping[Any, float], axis: Axis) -> dict[Any, float]:
    return {a: value for a, value in stiffness.items() if a != axis}


def _does_nothing(segment: Segment) -> bool:
    return not segment.mass and 0 < _largest_change(segment) < _NO_WELD  # a file's own segments of factor 1 stay


def _largest_change(segment: Segment) -> float:
    factors = (segment.stiffness, *segment.bending, segment.torsion, segment.shear_stiffness, segment.axial)
    return max(abs(factor - 1) for factor in factors)


def without_empty_segments(structure: Structure, own: Structure) -> Structure:
    """Return the structure without segments that change nothing, but for those of the file that it was made from."""
    segments = (s for s in structure.segment if s in own.segment or s.mass or _largest_change(s) > 0)
    return structure.model_copy(update={"segment": tuple(segments)})


def rounded(structure: Structure, knobs: Sequence[ModelParameter], std: Mapping[str, float]) -> Structure:
    """Return the structure with parameters rounded to the second digit of their standard deviations.

    Parameters
    ----------
    knobs : parameters of the file that the structure was made from
    std : standard deviation of parameters by name, in physical units; others stay as they are
    """
    external, material, welds = structure.external, dict(structure.material), dict[tuple[str, Vector, float], float]()
    supports, joints = list(structure.support), list(structure.joint)
    for knob in (k for k in knobs if k.key in std):
        if knob.kind == "stiffness" and external is not None:
            external = _rounded_factor(external, knob.target, std[knob.key])
        elif knob.kind == "stiffness":
            material[knob.target] = _rounded_material(material[knob.target], std[knob.key])
        elif knob.kind == "support":
            supports[int(knob.target)] = _rounded_spring(supports[int(knob.target)], knob.axis, std[knob.key])
        elif knob.kind == "joint":
            joints = [_rounded_spring(j, knob.axis, std[knob.key]) if is_of(structure, j, knob) else j for j in joints]
        elif knob.kind in JOINT_ZONES:
            zones = joint_segments(structure, knob, 1.0)
            welds |= {(zone.member, zone.at, zone.extent): std[knob.key] for zone in zones}
    walls = {knob: partial(_rounded_wall, std[knob.key], knob, structure) for knob in knobs if knob.key in std}
    with_walls = with_wall_factors(structure, _by_wall(walls))
    segments = [_rounded_weld(s, welds.get((s.member, s.at, s.extent))) for s in with_walls]
    parts = {"material": material, "support": tuple(supports), "joint": tuple(joints), "segment": tuple(segments)}
    return structure.model_copy(update=parts | {"external": external})


def _rounded_factor(external: External, group: str, std: float) -> External:
    """Return external matrices with the factor of a group, or of all if it is "", rounded."""
    part = external.group[group] if group else external
    changed = part.model_copy(update={"factor": rounded_value(part.factor, min(std, _FACTOR_DIGITS * part.factor))})
    if isinstance(changed, External):
        return changed
    return external.model_copy(update={"group": {**external.group, group: changed}})


def _rounded_material(material: Material, std: float) -> Material:
    modulus = rounded_value(material.youngs_modulus, std)
    shear = material.shear_modulus * modulus / material.youngs_modulus
    return material.model_copy(
        update={"youngs_modulus": modulus, "shear_modulus": rounded_value(shear, std * shear / modulus)}
    )


def _rounded_spring(connection: _Connection, axis: Axis, std: float) -> _Connection:
    stiffness = {a: rounded_value(k, std) if a == axis else k for a, k in connection.stiffness.items()}
    return connection.model_copy(update={"stiffness": stiffness})


def _rounded_weld(segment: Segment, std: float | None) -> Segment:
    """Return a segment with its stiffness rounded if it is of a weld whose factor has a deviation."""
    if std is None:
        return segment
    return segment.model_copy(update={"stiffness": rounded_value(segment.stiffness, std)})


def _rounded_wall(std: float, knob: ModelParameter, structure: Structure, wall: Wall, factor: float) -> float:
    """Return the factor of a wall's spring, rounded by the standard deviation of the spring's stiffness."""
    if factor == 1.0:
        return factor
    relative = std / physical_value(structure, knob, wall.flexibility(factor))
    return rounded_value(factor, factor * min(relative * (1 - factor), 1.0))


def with_few_digits(structure: Structure, own: Structure) -> Structure:
    """Return the structure with the numbers of parts that `own` lacks, such as bodies, to five digits.

    Places are to a micrometre: they stay on their member. Frequencies change by less than 5e-6.
    """
    parts = {
        kind: tuple(part if part in getattr(own, kind) else _with_few_digits(part) for part in getattr(structure, kind))
        for kind in ("body", "segment", "oscillator", "ground", "breathing_crack")
    }
    return structure.model_copy(update=parts)


def _with_few_digits(part: _Entry) -> _Entry:
    return part.model_copy(update={name: _few_digits(name, value) for name, value in part})


def _few_digits(name: str, value: object) -> object:
    """Return a number, or numbers, to five digits; a place to a micrometre."""
    if isinstance(value, tuple):
        return tuple(_few_digits(name, one) for one in value)
    if not isinstance(value, float):
        return value
    return round(value, _PLACE_DECIMALS) + 0.0 if name == "at" else float(f"{value:.{_DIGITS}g}")
