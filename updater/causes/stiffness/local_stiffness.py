"""A stretch of a member that has lost stiffness, or gained some: a crack, a loosened splice, a patch.

One factor 1 - loss on its stiffness in bending and twist adds modal flexibility dF = loss / (1 - loss) int A^T A dx /
(omega_r^2 omega_s^2), A the modes' weighed internal actions: the unit-load method, with self-stress exact in all modes
and nearly so in thirty. The share of the loss in shear is a parameter.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.member_grid import Cells, cut
from updater.causes.modal_loads import modal_section_forces
from updater.causes.stretches import WITHIN, Kinds, Spread, begun, everywhere, may_be_cut
from updater.inference import Comparison, Effect, Fit, first_order, log_uniform, no_effect
from updater.modal_data import Sites
from updater.quantities import Quantity
from updater.reference import Reference
from updater.structure import Segment, Structure

LOSS_STD = 1.0  # of ln of the factor on stiffness, while it is fitted
_MIN, _MAX = 0.01, 4.0  # of its magnitude: one per cent to all but two
STIFFEST = -1.0  # logarithm of the largest gain of stiffness
SHEAR = 0.5  #: share of the loss in shear and along the axis: little for a crack, all for a softer material
SOFTEST = 7.0  #: beyond it the stretch is a hinge
#: from 1/75 of the longest member to half of it; similar lengths have similar effects
LENGTHS = Kinds(
    size={8: 8, 30: 30, 90: 90},
    step={8: 10, 30: 14, 90: 28},
    about={8: (4, 6, 8, 10, 12, 14), 30: (18, 22, 26, 30, 36, 44, 52), 90: (62, 74, 88, 106, 126, 150)},
)
#: and on to all of it
ALL_LENGTHS = Kinds(
    size=LENGTHS.size | {220: 220},
    step=LENGTHS.step | {220: 40},
    about=LENGTHS.about | {220: (180, 216, 260, 300)},
    whole=True,
)


class StiffnessLoss:
    """Common part of causes whose first parameter is -ln of the factor on stiffness."""

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the correction of the evidence for a loss of any order."""
        del rows
        std = np.sqrt(covariance[:, 0, 0])
        return log_uniform(theta[:, 0], std, gaussian=LOSS_STD, least=_MIN, most=_MAX).log_ratio


@dataclass(frozen=True, eq=False, kw_only=True)
class LocalStiffness(StiffnessLoss, Spread):
    """Stretches of all members; the parameter is -ln of the factor on stiffness."""

    #: (n_compliances, n_edges, n_modes + n_stress, same) from each member's start: in bending and twist, last in shear
    compliance: FloatArray
    name: str = "local_stiffness"
    advice: str = "Inspect this part of the member for a crack or a loose splice."

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the correction of the evidence for a loss of any order, and the evidence of the signals."""
        return super().log_ratio(theta, covariance, rows) + self.opening(theta, rows)

    def opening(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the log likelihood ratio (len(rows),) of opening and closing to none by the signals."""
        return self.comparison.circumstances.opening_at(self.name, self.sites(theta, rows))

    def sites(self, theta: FloatArray, rows: IndexArray) -> Sites:
        """Return the middles of stretches; of a gain of stiffness with no share about any axis."""
        lost = (theta[:, :1] > 0) * self.axis_shares(theta, rows)
        member = self.member[rows]
        return Sites(path=member, distance=self.middles(theta, rows) * self.cells.length[member], share=lost)

    def axis_shares(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the compliance added about y and z and in twist (len(rows), 3), over the most of them."""
        del rows
        return np.ones((len(theta), 3))

    def about_axes(self, theta: FloatArray, row: int, share: FloatArray) -> list[Effect]:
        """Return the effects of an alternative about y, about z and in twist alone, with a share (3,) of its loss."""
        rows, (_, compliance) = np.array([row]), flexibility_by_axis(self.reference)
        more = np.expm1(np.minimum(theta[0], SOFTEST)) * share
        matrices = [
            self.matrix(one[None], np.array([[own]]), theta[None], rows)
            for one, own in zip(compliance[:3], more, strict=True)
        ]
        return [replace(no_effect(1, self.comparison), compliance=matrix) for matrix in matrices]

    @property
    def prior_std(self) -> FloatArray:
        """Of the logarithm, the shift, the length, and of how much more than half as much it is softer in shear."""
        return np.array([LOSS_STD, WITHIN, WITHIN, SHEAR])

    @property
    def lower(self) -> FloatArray:
        """Lower bounds (n_alternatives, n_parameters): a stretch may gain less stiffness than it may lose."""
        return np.tile([STIFFEST, -np.inf, -np.inf, -SHEAR], (len(self.member), 1))

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return flexibility changes."""
        more = np.expm1(np.minimum(theta[:, :1], SOFTEST)) * self.shares(theta, rows)
        return replace(
            no_effect(len(rows), self.comparison), compliance=self.matrix(self.compliance, more, theta, rows)
        )

    def shares(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return how much of each compliance (len(rows), n_compliances) is added, over the most of them."""
        del rows
        return np.stack([np.ones(len(theta)), np.minimum(SHEAR + theta[:, 3], 1.0)], axis=1)

    def carried(self, theta: FloatArray, ratio: FloatArray) -> FloatArray:
        """Return the logarithm that adds as much flexibility in all."""
        found = theta.copy()
        found[:, 0] = np.maximum(np.log1p(np.maximum(np.expm1(theta[:, 0]) / ratio, -0.6)), STIFFEST)
        return found

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the share of stiffness that is lost and the length over which: as much less as that is longer."""
        left = np.exp(-fit.theta[:, 0])
        loss = self.averaged(fit, 1 - left, left * np.sqrt(fit.covariance[:, 0, 0]))
        extent = self.averaged(fit, *self.extents(fit))
        return {
            "loss": Quantity(value=loss[0], std=loss[1], unit="-"),
            "extent": Quantity(value=extent[0], std=extent[1], unit="m"),
        }

    def typical_shift(self, fit: Fit[Cause]) -> float:
        """Return the relative shift of frequencies if the stretch were where the strain energy is as on average [-].

        Half of c extent / L, c = loss / (1 - loss) and L the length of all members.
        """
        more = np.abs(np.expm1(np.minimum(fit.theta[:, 0], SOFTEST)))
        length = sum(member.length for member in self.reference.structure.member)
        return float(self.likely(fit) @ (more * self.extents(fit)[0])) / (2 * length)

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Add a segment of the stretch's stiffness."""
        member, at, extent = self.stretch(row, theta)
        more = float(np.expm1(min(theta[0], SOFTEST)))
        segment = Segment(
            member=member,
            at=at,
            extent=extent,
            stiffness=1 / (1 + more),
            shear_stiffness=1 / (1 + min(SHEAR + float(theta[3]), 1.0) * more),
        )
        return structure.model_copy(update={"segment": (*structure.segment, segment)})


def propose_local_stiffness(reference: Reference, comparison: Comparison) -> LocalStiffness | None:
    """Return stretches of a few lengths every few centimetres; none of very many members or of matrices.

    Against a structure file alone they are no longer than half the longest member: the stiffness of a whole member is
    one of the file's own parameters then (`model_parameters`).
    """
    structure = reference.structure
    if not may_be_cut(structure):
        return None
    cells, compliance = flexibility(reference)
    kinds = ALL_LENGTHS if reference.calibration.fitted else LENGTHS
    found = LocalStiffness(
        reference=reference,
        comparison=comparison,
        cells=cells,
        kinds=kinds,
        compliance=compliance,
        **everywhere(cells, kinds, 4),
    )
    return begun(found, start_of(found))


def start_of(cause: LocalStiffness) -> tuple[FloatArray, FloatArray]:
    """Return d ln f_i = -c/2 omega_i^2 dF_ii, c = loss / (1 - loss), fitted to the log frequencies."""
    comparison = cause.comparison
    paired = comparison.paired
    rows = np.arange(len(cause.member))
    bent = cause.shares(cause.start, rows)[:, :-1]
    softer = cause.matrix(cause.compliance[:-1], bent, cause.start, rows)
    gained = np.diagonal(softer, axis1=1, axis2=2)[:, paired]
    slope = -0.5 * gained * (2 * np.pi * comparison.frequency[paired]) ** 2
    more, explained = first_order(comparison, slope[:, None])
    return np.log1p(np.clip(more[:, 0], -0.5, math.e**2)), explained


@lru_cache(maxsize=4)
def flexibility(reference: Reference) -> tuple[Cells, FloatArray]:
    """Return the compliance of all stretches, summed from each member's start."""
    return compliances(reference, (slice(3, 6), slice(0, 3)))


@lru_cache(maxsize=2)
def flexibility_by_axis(reference: Reference) -> tuple[Cells, FloatArray]:
    """Return the compliances of all stretches about y and z, in twist and in shear, summed from each member's start."""
    return compliances(reference, (slice(4, 5), slice(5, 6), slice(3, 4), slice(0, 3)))


def compliances(reference: Reference, actions: tuple[slice, ...]) -> tuple[Cells, FloatArray]:
    """Return cells, and the compliance of stretches by each of some actions, summed from each member's start.

    The latter (n_compliances, n_edges, n_modes + n_stress, same).
    """
    cells = cut(reference.structure.member)
    found = modal_section_forces(reference, {m: cells.middles(m) for m in range(len(cells.members))})
    own = [found[m] for m in range(len(cells.members))]
    return cells, np.stack([cells.summed([each[:, which] for each in own]) for which in actions])
