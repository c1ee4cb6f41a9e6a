"""Members that are warmer than the rest of the structure: sun on one side, a pipe, a heated floor.

A warmer member is softer by the law of `temperature`. Where the structure restrains its expansion, it also causes axial
forces: an expansion e along a member of length L excites each state of self-stress z of unit energy by -e L N_z, which
causes the force -e L sum(N_z N_zj) in member j. A gradient across a section does not change the stiffness to first
order; the forces that it causes where it is restrained are neglected.

References
----------
EN 1991-1-5:2003, 6.1.6: differences of 15 K between the main members of a structure.
Przemieniecki, J. S. (1968). Theory of Matrix Structural Analysis, ch. 8 (initial strains).
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause, Discrete
from updater.causes.overall.temperature import SOFTENING, SOFTENING_STD
from updater.causes.stiffness.axial_force import geometric_stiffness, in_buckling_modes, restrained_forces
from updater.causes.stiffness.local_stiffness import flexibility
from updater.causes.stretches import may_be_cut
from updater.fe import Model
from updater.inference import Comparison, Effect, Fit, in_modes, no_effect
from updater.quantities import Quantity, Where, vector
from updater.reference import Reference
from updater.structure import Member, Segment, Structure

_WARMER_STD = 10.0  # K
_EXPANSION, _EXPANSION_STD = 1.2e-5, 0.3  # 1/K of steel; relative, of its logarithm: other metals, concrete
_COMPRESSED = -0.9  # relative to buckling: no structure is stable beyond
_TINY = 1e-12  # 1/K, relative to the stiffness of the modes: no force
_ON_A_SIDE = 0.01  # of the structure's size: members within it are in its outer face


@dataclass(frozen=True, eq=False, kw_only=True)
class MemberTemperature(Discrete):
    """Members, and members of one side together; parameters are temperature and coefficient of expansion.

    Both are standard scores, the second one of the logarithm.
    """

    reference: Reference
    members: tuple[tuple[int, ...], ...]  #: of each alternative
    compliance: FloatArray  #: (n, n_modes + n_stress, same) of the members of each alternative [s2]
    force: FloatArray  #: (n, n_members) axial forces per kelvin [N/K]
    share: FloatArray  #: (n, n_modes) geometric stiffness by these forces, relative to the modes' own [1/K]
    basis: FloatArray  #: (n, n_modes, n_modes) of these [s]
    name: str = "member_temperature"
    place_free: bool = False
    advice: str = (
        "Record before sunrise, when all members have the same temperature: a change that remains has another cause."
    )

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return flexibility changes."""
        softer = np.expm1(SOFTENING * _WARMER_STD * theta[:, 0])[:, None, None] * self.compliance[rows]
        more = self._expanded(theta, rows)[:, None] * self.share[rows]
        basis = self.basis[rows]
        restrained = (basis * (-more / (1 + more))[:, None, :]) @ basis.transpose(0, 2, 1)
        change = softer + in_modes(restrained, self.comparison)
        return replace(no_effect(len(rows), self.comparison), compliance=change)

    def _expanded(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the temperature rise (n,) with the same expansion of steel, as far as the forces do not buckle [K]."""
        same = _WARMER_STD * theta[:, 0] * np.exp(_EXPANSION_STD * theta[:, 1])
        most, least = self.share[rows].max(1, initial=_TINY), self.share[rows].min(1, initial=-_TINY)
        return np.clip(same, _COMPRESSED / most, _COMPRESSED / least)

    def deviations(self, fit: Fit[Any]) -> float:
        """Return by how many standard deviations the temperature differs from that of the other members."""
        return float(abs(fit.theta[fit.best, 0]) / np.sqrt(fit.covariance[fit.best, 0, 0]))

    def where(self, fit: Fit[Cause]) -> Where:
        """Return the members, all of each."""
        found = [self.reference.structure.member[m] for m in self.members[fit.best]]
        *others, last = (member.name for member in found)
        return Where(
            member=f"{', '.join(others)} and {last}" if others else last,
            position=None if others else vector(self.points(fit)[fit.best]),
            position_std=None if others else found[0].length / np.sqrt(12),
            region=tuple((member.start, member.end) for member in found),
        )

    def points(self, fit: Fit[Any]) -> FloatArray:
        """Return the middle of each alternative (n, 3) [m]."""
        del fit
        middles = [member.point(member.length / 2) for member in self.reference.structure.member]
        return np.array([np.mean([middles[m] for m in own], axis=0) for own in self.members])

    def by_place(self, fit: Fit[Any]) -> list[FloatArray]:
        """Return the probability of each alternative (n,) by itself, the most probable first."""
        shares = np.diag(fit.probability)
        return [shares[k] for k in np.argsort(-fit.probability, kind="stable") if fit.probability[k] > 0]

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return how much warmer the members are than the others."""
        value, std = (_WARMER_STD * float(x) for x in (fit.theta[fit.best, 0], fit.covariance[fit.best, 0, 0] ** 0.5))
        return {"warmer": Quantity(value=value, std=float(np.hypot(std, value * SOFTENING_STD / SOFTENING)), unit="K")}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Write the softer members as segments, and the axial forces of all members."""
        left = float(np.exp(-SOFTENING * _WARMER_STD * theta[0]))
        force = float(self._expanded(theta[None], np.array([row]))[0]) * self.force[row]
        segments = tuple(_softened(structure.member[m], left) for m in self.members[row])
        members = tuple(
            member.model_copy(update={"preload": member.preload + float(more)}) if more else member
            for member, more in zip(structure.member, force, strict=True)
        )
        return structure.model_copy(update={"member": members, "segment": (*structure.segment, *segments)})


def _softened(member: Member, left: float) -> Segment:
    """Return a segment of all of a member with a share of its stiffness."""
    middle = vector(member.point(member.length / 2))
    return Segment(member=member.name, at=middle, extent=member.length, stiffness=left, shear_stiffness=left)


def propose_member_temperature(reference: Reference, comparison: Comparison) -> MemberTemperature | None:
    """Return each member, and those of each side; none of one member, of very many or of matrices.

    Without reference logs, the stiffness of each material is a parameter of the file.
    """
    structure = reference.structure
    if reference.of_file or len(structure.member) < 2 or not may_be_cut(structure):
        return None
    members = _alternatives(structure)
    compliance, force, share, basis = _effects(reference, members)
    return MemberTemperature(
        prior_std=np.ones(2),
        lower=np.full((len(members), 2), -np.inf),
        drifting=True,
        comparison=comparison,
        reference=reference,
        members=members,
        compliance=compliance,
        force=force,
        share=share,
        basis=basis,
    )


def _alternatives(structure: Structure) -> tuple[tuple[int, ...], ...]:
    """Return each member, and the members in each outer face of the structure's bounding box if these are several."""
    n = len(structure.member)
    ends = np.array([(member.start, member.end) for member in structure.member])  # (n, 2, 3)
    low, high = ends.min((0, 1)), ends.max((0, 1))
    near = _ON_A_SIDE * float((high - low).max())
    faces = [np.abs(ends - bound).max(1) < near for bound in (low, high)]
    sides = [tuple(np.flatnonzero(face[:, axis]).tolist()) for face in faces for axis in range(3)]
    several = [side for side in dict.fromkeys(sides) if 1 < len(side) < n]
    return tuple((m,) for m in range(n)) + tuple(several)


@lru_cache(maxsize=4)
def _effects(
    reference: Reference, members: tuple[tuple[int, ...], ...]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return compliances, axial forces per kelvin, and their geometric stiffness, of each alternative."""
    cells, summed = flexibility(reference)
    ends = np.cumsum(cells.count + 1) - 1  # last edge of each member
    whole = summed[:, ends].sum(0)
    by_member = expansion_forces(reference.model)
    force = np.array([by_member[list(own)].sum(0) for own in members])
    share, basis = in_buckling_modes(reference, np.einsum("nm,mrs->nrs", force, geometric_stiffness(reference)))
    return np.array([whole[list(own)].sum(0) for own in members]), force, share, basis


def expansion_forces(model: Model) -> FloatArray:
    """Return the mean axial forces per kelvin (n_members that are warmer, n_members) [N/K]."""
    return -_EXPANSION * restrained_forces(model)
