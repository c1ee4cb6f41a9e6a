"""A group of external matrices that has lost stiffness, or gained some: a panel, a joint, a foot.

One factor 1 - loss on the group's stiffness adds the compliance loss / (1 - loss) sum_k mu_k mu_k^T of its strains in
modes and in states of self-stress (`updater.fe.external.groups`).
"""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from scipy import sparse

from daq import FloatArray, IndexArray, IntArray
from updater.causes.base import BoolArray, Cause, Discrete
from updater.causes.modal_loads import group_compliance
from updater.causes.stiffness.local_stiffness import LOSS_STD, SOFTEST, STIFFEST, StiffnessLoss
from updater.inference import Comparison, Effect, Fit, first_order, no_effect
from updater.quantities import Quantity, Where, vector
from updater.reference import Reference
from updater.structure import Structure

_MIN_LOAD = 1e-6  # of the largest diagonal entry: load by a unit translation of a part that is free, by rounding
_FREE = 0.5  # error of the energy of a part that is not connected to the ground, over that of squared displacements
_MAX_START = 7.0  # of the compliance relative to the group's own, at the start of a fit


@dataclass(frozen=True, eq=False, kw_only=True)
class GroupStiffness(StiffnessLoss, Discrete):
    """The groups of external matrices; the parameter is -ln of the factor on stiffness.

    Each is there twice, started from no change and from the frequencies to first order.
    """

    reference: Reference
    group: tuple[str, ...]  #: (n,) of each alternative
    corner: FloatArray  #: (n, 2, 3) least and greatest coordinates of its nodes [m]
    middle: FloatArray  #: (n, 3) mean of its nodes [m]
    compliance: FloatArray  #: (n, n_modes + n_stress, same) of each group
    #: (n,) error of its elastic energy by a mesh, over that of squared displacements: 1 where it is connected to the
    #: ground, 1/2 else. The energy of linear elements is 2 e too large, displacements squared 4 e
    mesh_share: FloatArray
    begun: FloatArray  #: (n, 1) where the fit begins
    name: str = "local_stiffness"
    advice: str = "Inspect this part for a crack, loose bolts or a loose connection."
    place_free: bool = False

    @property
    def start(self) -> FloatArray:
        """Start of a fit: no change, or the first-order estimate."""
        return self.begun

    @property
    def neutral_start(self) -> FloatArray:
        """Nothing is done to any."""
        return np.zeros(self.begun.shape)

    def repeats(self, other: Self, row: int) -> BoolArray:
        """Return both alternatives of the same group: a group changes once."""
        return np.array([group == other.group[row] for group in self.group])

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return flexibility changes."""
        more = np.expm1(np.minimum(theta[:, 0], SOFTEST))
        return replace(no_effect(len(rows), self.comparison), compliance=more[:, None, None] * self.compliance[rows])

    def where(self, fit: Fit[Cause]) -> Where:
        """Return the group's name, the mean of its nodes and the box that they fill."""
        least, most = self.corner[fit.best]
        return Where(
            member=self.group[fit.best],
            position=vector(self.middle[fit.best]),
            position_std=0.0,
            region=((vector(least), vector(most)),),
        )

    def points(self, fit: Fit[Any]) -> FloatArray:
        """Return the middle of each alternative (n, 3) [m]."""
        del fit
        return self.middle

    def by_place(self, fit: Fit[Any]) -> list[FloatArray]:
        """Return the probability of the alternatives (n,) of each group, the most probable group first."""
        names = np.array(self.group)
        shares = [np.where(names == name, fit.probability, 0.0) for name in dict.fromkeys(self.group)]
        return sorted((share for share in shares if share.any()), key=lambda share: -share.sum())

    def deviations(self, fit: Fit[Any]) -> float:
        """Return by how many standard deviations the factor of the best alternative differs from one."""
        return float(abs(fit.theta[fit.best, 0]) / np.sqrt(fit.covariance[fit.best, 0, 0]))

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the share of stiffness that is lost, negative where it has grown."""
        left = float(np.exp(-fit.theta[fit.best, 0]))
        by_mesh = (1 - left) * self.mesh_share[fit.best] * self.comparison.size_error
        std = left * float(np.hypot(np.sqrt(fit.covariance[fit.best, 0, 0]), by_mesh))
        return {"loss": Quantity(value=1 - left, std=std, unit="-")}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Multiply the group's factor."""
        assert structure.external is not None
        factor = float(np.exp(-min(theta[0], SOFTEST)))
        return structure.model_copy(update={"external": structure.external.with_factor(self.group[row], factor)})


def propose_group_stiffness(reference: Reference, comparison: Comparison) -> GroupStiffness | None:
    """Return the groups of external matrices; None if there are none."""
    model = reference.model
    if not model.groups:
        return None
    compliance = np.array(list(group_compliance(reference).values()))
    paired = comparison.paired
    gained = np.diagonal(compliance, axis1=1, axis2=2)[:, paired]
    slope = -0.5 * gained * (2 * np.pi * comparison.frequency[paired]) ** 2
    more = first_order(comparison, slope[:, None])[0]
    first = np.log1p(np.clip(more, np.expm1(STIFFEST / 2), _MAX_START))
    nodes = [model.nodes[_nodes_of(model.dofs, part.diagonal() != 0)] for part in model.groups.values()]
    corner = np.array([[points.min(0), points.max(0)] for points in nodes])
    middle = np.array([points.mean(0) for points in nodes])
    return GroupStiffness(
        reference=reference,
        comparison=comparison,
        group=2 * tuple(model.groups),
        corner=np.tile(corner, (2, 1, 1)),
        middle=np.tile(middle, (2, 1)),
        compliance=np.tile(compliance, (2, 1, 1)),
        mesh_share=np.where(2 * [_is_grounded(model.dofs, part) for part in model.groups.values()], 1.0, _FREE),
        begun=np.concatenate([np.zeros(first.shape), first]),
        prior_std=np.array([LOSS_STD]),
        lower=np.full((2 * len(nodes), 1), STIFFEST),
        drifting=True,
    )


def _is_grounded(dofs: IntArray, part: sparse.csc_array) -> bool:
    """Return whether a group holds the structure: it resists a translation, as clamped feet, or couples no two nodes.

    The latter are springs to the ground, also those against rotation alone.
    """
    node = np.zeros(part.shape[0], np.intp)
    node[dofs[dofs >= 0]] = np.nonzero(dofs >= 0)[0]
    row, column = part.nonzero()
    if np.array_equal(node[row], node[column]):
        return True
    translation = np.zeros((part.shape[0], 3))
    for axis in range(3):
        free = dofs[:, axis] >= 0
        translation[dofs[free, axis], axis] = 1.0
    load = np.abs(part @ translation).max()
    return bool(load > _MIN_LOAD * part.diagonal().max())


def _nodes_of(dofs: IntArray, held: BoolArray) -> IndexArray:
    """Return the nodes (n,) with a DOF among those held (n_dofs,)."""
    return np.flatnonzero(np.append(held, False)[dofs].any(1))
