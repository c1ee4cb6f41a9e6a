"""Normal stresses of modes in the sections of members, by the section forces of their inertia loads.

The section forces of a mode under its inertia load omega^2 M b balance the measured motion, so that errors of the
stiffness are not errors of the forces: sigma = N / A + M_y z / I_y - M_z y / I_z.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from daq import FloatArray
from updater.causes import modal_section_forces
from updater.errors import ModelError
from updater.fe import section_rigidity
from updater.reference import Reference
from updater.structure import Structure

_STATIONS = (np.arange(16) + 0.5) / 16  # shares of a member's length at which the size of its stresses is found
_NORMAL = [0, 4, 5]  # section forces with normal stresses: axial force, bending about y and z


@dataclass(frozen=True, kw_only=True)
class Fibre:
    """Normal stress of the vibration in a section of a member."""

    member: str
    distance: float  #: of the section from the member's start [m]
    y: float  #: from the centroid along the section's local y axis [m]
    z: float  #: along its local z axis [m]
    quantity: Literal["stress"] = "stress"

    @property
    def name(self) -> str:
        """Short name, such as `stress_column_0.1_y0.02_z-0.02`."""
        return f"stress_{self.member}_{self.distance:g}_y{self.y:g}_z{self.z:g}"


def edge_fibres(structure: Structure, member: str, distance: float) -> tuple[Fibre, ...]:
    """Return the fibres of a section with the largest bending stresses.

    Parameters
    ----------
    structure : with the member
    member : its name
    distance : of the section from the start of the member [m]

    Raises
    ------
    ModelError
        If there is no such member, the section is not on it, or its file states no `edge`.
    """
    found = structure.member[_number(structure, member)]
    if not 0 <= distance <= found.length:
        raise ModelError(f"section of {member}: expected a distance of 0 to {found.length:g} m, found {distance:g} m")
    section = structure.section.get(found.section)
    if section is None or section.edge is None:
        raise ModelError(f"section of {member}: stresses need the shape of its section, or its edge")
    return tuple(Fibre(member=member, distance=distance, y=y, z=z) for y, z in section.fibres().tolist())


def modal_stress(reference: Reference, fibres: Sequence[Fibre]) -> tuple[FloatArray, FloatArray]:
    """Return the stresses (n_fibres, n_modes) of unit modal coordinates, and their root mean square along the member.

    Parameters
    ----------
    reference : with a model of beam elements
    fibres : of sections

    Returns
    -------
    tuple
        Both in Pa per unit of a mass-normalised modal coordinate [Pa/(m kg^1/2)].

    Raises
    ------
    ModelError
        If the model has no beam elements, or a member does not exist.
    """
    structure = reference.model.structure
    if fibres and structure.external is not None:
        raise ModelError("stresses need a model of members with sections; external matrices have none")
    n, square = len(reference.frequency), (2 * np.pi * reference.frequency) ** 2
    forces: dict[tuple[str, float], FloatArray] = {}  # of each section, and at the stations along its member
    at, along = np.empty((len(fibres), n)), np.empty((len(fibres), n))
    for i, fibre in enumerate(fibres):
        number = _number(structure, fibre.member)
        member, place = structure.member[number], (fibre.member, fibre.distance)
        if place not in forces:
            stations = np.r_[fibre.distance, _STATIONS * member.length]
            weighted = modal_section_forces(reference, {number: stations})[number][:, _NORMAL, :n]
            rigidity = section_rigidity(reference.model, member, stations)[:, _NORMAL]
            forces[place] = weighted * np.sqrt(rigidity)[:, :, None] * square
        section = structure.section[member.section]
        moment_y, moment_z = section.second_moment
        lever = np.array([1 / section.area, fibre.z / moment_y, -fibre.y / moment_z])
        stress = np.einsum("k,skn->sn", lever, forces[place])
        at[i], along[i] = stress[0], np.sqrt((stress**2).mean(0))
    return at, along


def _number(structure: Structure, member: str) -> int:
    names = [m.name for m in structure.member]
    if member not in names:
        raise ModelError(f"section of {member!r}: no such member; there are {', '.join(names)}")
    return names.index(member)
