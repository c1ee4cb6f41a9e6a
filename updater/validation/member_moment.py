"""Moment of a member that a change of flexibility at a place follows."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from daq import FloatArray
from updater.causes import modal_section_forces
from updater.fe import section_rigidity
from updater.inference import Comparison
from updater.quantities import Vector
from updater.reference import Reference

_ALIKE = 0.9  # correlation with a moment over the modes, at least
_AXES: tuple[Literal["x", "y", "z"], ...] = ("x", "y", "z")


@dataclass(frozen=True)
class MemberMoment:
    """Moment of a member, and the size of an action in it."""

    member: str
    axis: Literal["x", "y", "z"]  #: local
    coefficient: float  #: action over the moment that is divided by the root of E I [sqrt(m)]
    root_rigidity: float  #: root of E I, or of G J, of the member without its segments [N m2]^(1/2)


def member_moment(
    reference: Reference, comparison: Comparison, position: Vector, action: FloatArray
) -> MemberMoment | None:
    """Return the moment of a member that an action follows; None if there is none, such as for a force.

    Parameters
    ----------
    position : of the action [m]
    action : (n_modes,) of the reference's modes over omega^2
    """
    structure, model, paired = reference.structure, reference.model, comparison.paired
    omega = 2 * np.pi * comparison.frequency[paired]
    wanted = omega * action[paired]
    best, closest = None, _ALIKE
    for m, member in enumerate(structure.member):
        if not member.passes(position):
            continue
        at = np.array([np.linalg.norm(np.subtract(position, member.start))])
        forces = modal_section_forces(reference, {m: at})[m][0]
        own = section_rigidity(model, member, at)[0]
        for k, axis in enumerate(_AXES, start=3):
            rigidity = structure.rigidity(member)[k - 3]
            moment = np.sqrt(own[k] / rigidity) * omega * forces[k, paired]
            square = float(moment @ moment)
            along = float(wanted @ moment)
            alike = abs(along) / float(np.sqrt(square * (wanted @ wanted))) if square > 0 else 0.0
            if alike > closest:
                best, closest = MemberMoment(member.name, axis, along / square, float(np.sqrt(rigidity))), alike
    return best
