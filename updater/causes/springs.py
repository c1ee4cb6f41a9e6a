"""A foot or a joint that gives more, or less, than it did: modal flexibility Lambda^-1 + sum_a c_a mu_a mu_a^T.

mu_a = (moment of each mode in the spring about axis a) / omega^2 is the modal displacement under a unit couple at the
spring, so that a flexibility c_a [rad/(N m)] more is exact in all modes and nearly so in thirty.
"""

import itertools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from daq import FloatArray, IndexArray
from updater.causes.base import Discrete
from updater.comparison import Comparison
from updater.knobs import bending_stiffness
from updater.reanalysis import Effect, no_effect
from updater.reference import Reference
from updater.structure import Joint, Structure, Support
from updater.verdict import Quantity, Where

if TYPE_CHECKING:
    from updater.causes.base import Cause
    from updater.fit import Fit

BoolArray = npt.NDArray[np.bool_]
Turn = Literal["rx", "ry", "rz"]
TURNS: tuple[Turn, ...] = ("rx", "ry", "rz")
_STD = 0.1  # of c E I / L: a connection that has come loose


@dataclass(frozen=True, eq=False, kw_only=True)
class Springs(Discrete):
    """Connections with rotational springs; parameters are flexibilities added about x y z, in L / (E I).

    Alternatives are each connection's axes that may have changed, singly and together: an axis that has not, or that
    the data cannot show, must not count for or against a connection. Each is there twice, begun from no change and from
    what the frequencies say to first order: where modes cross on the way, one of them may not arrive.
    """

    name: str
    advice: str
    comparison: Comparison
    connections: tuple[Support | Joint, ...]  #: (n,) of each alternative
    active: BoolArray  #: (n, 3) axes that each alternative changes
    unit: float  #: E I / L of the longest member [N m/rad]
    couple: FloatArray  #: (n, 3, n_modes) mu about the global axes, 0 where there is nothing to change [s2]
    begun: FloatArray  #: (n, 3) where the fit begins
    place_free: bool = False

    @property
    def start(self) -> FloatArray:
        """No change, or the first order."""
        return self.begun

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return flexibility changes."""
        couple = self.couple[rows]
        flexibility = np.einsum("pa,par,pas->prs", theta / self.unit, couple, couple)
        return replace(no_effect(len(rows), self.comparison), flexibility=flexibility)

    def where(self, fit: "Fit[Cause]") -> Where:
        """Return the node."""
        found = self.connections[fit.best]
        member = found.member if isinstance(found, Joint) else None
        return Where(member=member, position=found.at, position_std=0.0, region=((found.at, found.at),))

    def parameters(self, fit: "Fit[Cause]") -> dict[str, Quantity]:
        """Return the stiffness about each axis."""
        old = self.connections[fit.best].stiffness
        found = {}
        for a, axis in enumerate(TURNS):
            if self.active[fit.best, a]:
                flexibility = self.unit / old[axis] + fit.theta[fit.best, a]
                std = float(fit.covariance[fit.best, a, a] ** 0.5) / flexibility
                value = self.unit / flexibility
                found[f"stiffness_{axis}"] = Quantity(value=value, std=value * std, unit="N m/rad")
        return found

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Write the new stiffnesses."""
        found = self.connections[row]
        new = {
            axis: self.unit / (self.unit / found.stiffness[axis] + theta[a])
            for a, axis in enumerate(TURNS)
            if self.active[row, a]
        }
        changed = found.model_copy(update={"stiffness": {**found.stiffness, **new}})
        kind = "joint" if isinstance(found, Joint) else "support"
        parts = tuple(changed if _same(part, found) else part for part in getattr(structure, kind))
        return structure.model_copy(update={kind: parts})


def _same(one: Support | Joint, other: Support | Joint) -> bool:
    return one.at == other.at and getattr(one, "member", None) == getattr(other, "member", None)


def propose_support_stiffness(reference: Reference, comparison: Comparison) -> Springs | None:
    """Return the supports that are held about some axis by a spring."""
    model = reference.calibration.model
    supports = tuple(s for s in reference.calibration.structure.support if set(s.stiffness) & set(TURNS))
    rows = [[model.turn_rows(s.at, a) * s.stiffness.get(axis, 0.0) for a, axis in enumerate(TURNS)] for s in supports]
    advice = "Tighten the foot's bolts and measure again."
    return _springs("support_stiffness", advice, reference, comparison, supports, rows)


def propose_joint_stiffness(reference: Reference, comparison: Comparison) -> Springs | None:
    """Return the joints."""
    model, joints = reference.calibration.model, reference.calibration.structure.joint
    rows = [[model.joint_rows(j, a) * j.stiffness.get(axis, 0.0) for a, axis in enumerate(TURNS)] for j in joints]
    advice = "Look at the joint's weld or bolts; sensors that turn with either side of it would show the hinge."
    return _springs("joint_stiffness", advice, reference, comparison, joints, rows)


def _springs(
    name: str,
    advice: str,
    reference: Reference,
    comparison: Comparison,
    connections: tuple[Support | Joint, ...],
    rows: list[list[FloatArray]],
) -> Springs | None:
    if not connections or reference.calibration.structure.external is not None:
        return None  # of matrices from elsewhere nobody knows E I / L
    unit = bending_stiffness(reference.calibration.structure)
    moment = np.array(rows) @ reference.shape
    own = np.array([[unit / c.stiffness[a] if a in c.stiffness else 0.0 for a in TURNS] for c in connections])
    chosen = [
        (i, np.array(axes))
        for i, c in enumerate(connections)
        for axes in itertools.product((False, True), repeat=3)
        if any(axes) and all(TURNS[a] in c.stiffness for a in np.flatnonzero(axes))
    ]
    which, active = np.array([i for i, _ in chosen]), np.array([axes for _, axes in chosen])
    couple = np.where(active[:, :, None], moment[which] / (2 * np.pi * reference.frequency) ** 2, 0.0)
    lower = -0.999 * own[which]
    first = np.maximum(_first_order(comparison, couple, unit), lower)
    return Springs(
        name=name,
        advice=advice,
        prior_std=np.full(3, _STD),
        lower=np.tile(lower, (2, 1)),
        drifting=True,
        comparison=comparison,
        connections=2 * tuple(connections[i] for i in which),
        active=np.tile(active, (2, 1)),
        unit=unit,
        couple=np.tile(couple, (2, 1, 1)),
        begun=np.concatenate([np.zeros(first.shape), first]),
    )


def _first_order(comparison: Comparison, couple: FloatArray, unit: float) -> FloatArray:
    """Return the parameters (n, 3) by d ln f_i = -omega_i^2 sum_a theta_a mu_ai^2 / 2 unit, fitted to frequencies."""
    square = (2 * np.pi * comparison.frequency[comparison.paired]) ** 2
    whitener = comparison.drifting.matrix
    slope = (-0.5 / unit * square * couple[:, :, comparison.paired] ** 2) @ whitener.T
    normal = slope @ slope.transpose(0, 2, 1) + np.eye(3) / _STD**2
    score = slope @ (whitener @ comparison.log_ratio)
    return np.asarray(np.linalg.solve(normal, score[:, :, None])[:, :, 0])
