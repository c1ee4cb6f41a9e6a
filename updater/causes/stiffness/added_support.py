"""A spring to the ground where there was none: something leans on a member, or a prop has been set.

Of stiffness k along an axis, F' = Lambda^-1 - k / (1 + k f) mu mu^T (Sherman and Morrison): mu the modes' displacements
there over omega^2, f = p^T K^-1 p the static flexibility of the point, all of it and not only that of the modes kept.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.member_grid import Cells, cut
from updater.causes.stretches import WITHIN, Kinds, Stretches, begun, everywhere, may_be_cut
from updater.fe import flexibility
from updater.inference import Comparison, Effect, Fit, first_order, in_modes, log_uniform, no_effect
from updater.quantities import Quantity, vector
from updater.reference import Reference
from updater.structure import AXES, Structure, Support

_STD = 2.0  # of ln(1 + k f), while it is fitted
_MIN, _MAX = 0.003, 7.0  # range relative to it: from hardly visible to fixed
_LARGE = 3e6  # points times DOFs, of which only the kept modes' flexibility is known
_DIRECTIONS = Kinds(
    size={0: 0, 1: 0, 2: 0}, step={0: 12, 1: 12, 2: 12}, about={0: (0,), 1: (0,), 2: (0,)}
)  # a point, along x, y or z


@dataclass(frozen=True, eq=False, kw_only=True)
class SupportSpring(Stretches):
    """Points of all members, each along x, y and z; the parameter is ln(1 + k f)."""

    moved: FloatArray  #: (n_edges, 3, n_modes) mu [s2 m/sqrt(kg)]
    give: FloatArray  #: (n_edges, 3) static flexibility f [m/N]
    name: str = "support_spring"
    advice: str = "Check whether anything touches the structure or leans on it at this place."

    @property
    def prior_std(self) -> FloatArray:
        """Of the logarithm, and of the shift."""
        return np.array([_STD, WITHIN])

    @property
    def lower(self) -> FloatArray:
        """It can only hold."""
        return np.tile([0.0, -np.inf], (len(self.member), 1))

    def at(self, theta: FloatArray, rows: IndexArray) -> tuple[FloatArray, FloatArray]:
        """Return mu (n, n_modes) and f (n,) of alternatives."""
        which, number = np.arange(len(rows)), self.middles(theta, rows)
        moved, give = (self.cells.between(table, self.member[rows], number) for table in (self.moved, self.give))
        return moved[which, self.kind[rows]], give[which, self.kind[rows]]

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return flexibility changes."""
        moved, give = self.at(theta, rows)
        held = -np.expm1(-np.minimum(theta[:, 0], _MAX)) / give
        change = -held[:, None, None] * moved[:, :, None] * moved[:, None, :]
        return replace(no_effect(len(rows), self.comparison), compliance=in_modes(change, self.comparison))

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the correction of the evidence for a stiffness of any order; half of that prior would bias it."""
        del rows
        std = np.sqrt(covariance[:, 0, 0])
        found = log_uniform(theta[:, 0], std, gaussian=_STD, least=_MIN, most=_MAX).log_ratio
        return np.asarray(found + np.log(2))

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the stiffness along the likeliest axis: its logarithm, averaged over positions."""
        likely = self.likely(fit)
        axis = int(np.argmax(np.bincount(self.kind, likely)))
        share = np.where(self.kind == axis, likely, 0.0)
        share = share / share.sum()
        theta = np.clip(fit.theta[:, 0], _MIN, _MAX)
        log = np.log(np.expm1(theta) / self.at(fit.theta, np.arange(len(theta)))[1])
        mean, std = float(share @ log), np.sqrt(fit.covariance[:, 0, 0]) / -np.expm1(-theta)
        variance = share @ (std**2 + (log - mean) ** 2)
        spread = float(np.hypot(np.sqrt(variance), self.reference.calibration.mass_error))
        value = float(np.exp(mean))
        return {f"stiffness_{AXES[axis]}": Quantity(value=value, std=value * spread, unit="N/m")}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Add a support on the spring."""
        member, this = int(self.member[row]), np.array([row])
        distance = float(self.middles(theta[None], this)[0] * self.cells.length[member])
        at = vector(self.cells.members[member].point(distance))
        give = float(self.at(theta[None], this)[1][0])
        stiffness = {AXES[self.kind[row]]: float(np.expm1(min(theta[0], _MAX))) / give}
        support = Support.model_validate({"at": at, "stiffness": stiffness})
        return structure.model_copy(update={"support": (*structure.support, support)})


def propose_support_spring(reference: Reference, comparison: Comparison) -> SupportSpring | None:
    """Return points every few centimetres, each along x, y and z; none of very many members or of matrices."""
    structure = reference.structure
    if not may_be_cut(structure):
        return None
    cells, moved, give = _points(reference)
    found = SupportSpring(
        reference=reference,
        comparison=comparison,
        cells=cells,
        kinds=_DIRECTIONS,
        moved=moved,
        give=give,
        **everywhere(cells, _DIRECTIONS, 2),
    )
    return begun(found, _start(found))


def _start(cause: SupportSpring) -> tuple[FloatArray, FloatArray]:
    """Return d ln f_i = s/2 omega_i^2 mu_i^2 / f, s = k f / (1 + k f), fitted to the log frequencies."""
    comparison = cause.comparison
    moved, give = cause.at(cause.start, np.arange(len(cause.member)))
    omega = 2 * np.pi * comparison.frequency[comparison.paired]
    slope = 0.5 * (omega * moved[:, comparison.paired]) ** 2 / give[:, None]
    found, explained = first_order(comparison, slope[:, None])
    held = found[:, 0]
    return -np.log1p(-np.clip(held, 0.0, 0.9)), np.where(held > 0, explained, 0.0)


@lru_cache(maxsize=4)
def _points(reference: Reference) -> tuple[Cells, FloatArray, FloatArray]:
    """Return the modes' mu (n_edges, 3, n_modes) and the static flexibility (n_edges, 3) at all cells' edges.

    Motion of the updated modes in place of the model's own, and static flexibility beyond the modes used.
    """
    model, modes = reference.model, reference.calibration.modes
    cells = cut(model.structure.member)
    points = cells.edge_points()
    reader = model.reader(points)[(6 * np.arange(len(points))[:, None] + np.arange(3)).ravel()]
    own, updated = reader @ modes.shape, reader @ reference.shape
    omega = 2 * np.pi * reference.frequency
    give = ((updated / omega) ** 2).sum(1)
    if model.n_dofs * len(give) <= _LARGE:
        give += np.maximum(flexibility(model, reader) - ((own / modes.omega) ** 2).sum(1), 0.0)
    give = np.maximum(give, 1e-12 * give.max())
    return cells, (updated / omega**2).reshape(len(points), 3, -1), give.reshape(-1, 3)
