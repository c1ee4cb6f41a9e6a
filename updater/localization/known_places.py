"""Bodies removed or added at known places, identified from several records with different places.

Each record is a comparison with its own reference. The effect of a candidate is known except for its mass, so that sets
of candidates are compared by their evidence. Deviations between records are of three kinds. Stated noise is
independent. Scatter by remounting the structure is independent too; its standard deviation per mode is learned from all
records. An error of the model is the same in all records and does not average out.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import Bounds, linear_sum_assignment, minimize
from scipy.special import comb, logsumexp

from daq import FloatArray, IndexArray
from updater.causes import Discrete
from updater.errors import ModalDataError
from updater.inference import MODEL_ERROR, BoolArray, Comparison, Effect, Whitener, compare, evaluate, no_effect, slopes
from updater.modal_data import COMMON_STD, ModalMean
from updater.reference import Reference

_MAX_SETS = 2000  # sets of candidates that are compared
_SCATTER, _SCATTER_SPREAD = 1e-3, 1.5  # median of the scatter of ln f, and standard deviation of its logarithm
_ERROR, _ERROR_SPREAD = 2 * MODEL_ERROR, 0.8  # the same of the model's error, of a mode's typical displacement
_FARTHEST = 4.0  # of these standard deviations: how far either is sought
_SAME_MODE = 0.1  # of ln f: how far a mode may lie from itself in another record
_FEWEST = 3  # modes that all records must have in common
_ROUNDS = 2  # linearisations about the masses found ...
_NEAR = 30.0  # ... of sets so near the best in log evidence


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyRecord:
    """One record from before and after the change."""

    reference: Reference  #: learned before the change, of the structure as this record has it
    event: ModalMean  #: (n_tracks,) mean of the windows since the change
    position: FloatArray  #: (n_candidates, 3) places of the candidates in this record [m]


@dataclass(frozen=True, eq=False, kw_only=True)
class BodySelection:
    """Posterior over the sets of candidates that may have come or gone."""

    sets: tuple[tuple[int, ...], ...]  #: (n_sets,) candidates of each set; the empty set is first
    probability: FloatArray  #: (n_sets,) by all records together [-]
    per_record: FloatArray  #: (n_records, n_sets) by each record alone [-]
    mass: FloatArray  #: (n_candidates,) of the most probable set, 0 for others; negative if taken off [kg]
    mass_std: FloatArray  #: (n_candidates,) [kg]
    scatter: FloatArray  #: (n_modes,) standard deviation of ln f between records beyond the stated noise [-]
    model_error: float  #: most probable error of the model, of a mode's typical displacement [-]
    residual: FloatArray  #: (n_records, n_modes) ln f left by the most probable set [-]
    residual_std: FloatArray  #: (n_records, n_modes) its standard deviation [-]
    excess: float  #: largest excess of scatter or model error over its prior, in prior standard deviations [-]

    @property
    def best(self) -> tuple[int, ...]:
        """The most probable set of candidates."""
        return self.sets[int(np.argmax(self.probability))]

    @property
    def candidate_probability(self) -> FloatArray:
        """Probability of each candidate (n_candidates,) by all records together."""
        return np.asarray(self.probability @ _members(self.sets, len(self.mass)).astype(float))


def select_bodies(
    records: Sequence[BodyRecord], mass: FloatArray, mass_std: FloatArray, *, most: int = 3
) -> BodySelection:
    """Compare all sets of candidates by all records together, and by each alone.

    Each number of bodies from none to `most` is equally probable beforehand, and so is each set of a number.

    Parameters
    ----------
    records : of the same change, the candidates in the same order
    mass : (n_candidates,) change of mass that each candidate would be, negative if it is taken off [kg]
    mass_std : (n_candidates,) standard deviation of that [kg]
    most : largest number of bodies that came or went

    Raises
    ------
    ModalDataError
        If there is no record, records have fewer than three modes in common, or modes cannot be right.
    ValueError
        If the candidates are not the same in all records, or too many sets would have to be compared.
    """
    mass, mass_std = np.atleast_1d(np.asarray(mass, float)), np.atleast_1d(np.asarray(mass_std, float))
    sets = _sets(records, mass, mass_std, most)
    members = _members(sets, len(mass))
    problem = _Problem(records, members, mass, mass_std)
    prior = _log_prior(sets, len(mass))
    found = [problem.fitted(row) for row in range(len(sets))]
    highest = max(one.log_evidence for one in found)
    for _ in range(_ROUNDS):
        near = (one.log_evidence > highest - _NEAR for one in found)
        found = [
            problem.fitted(row, one) if close else one for row, (one, close) in enumerate(zip(found, near, strict=True))
        ]
    evidence = np.array([one.log_evidence for one in found]) + prior
    best = found[int(np.argmax(evidence))]
    alone = np.array([problem.alone(k, best.hyper) for k in range(len(records))]) + prior
    of_best = members[int(np.argmax(evidence))]
    return BodySelection(
        sets=sets,
        probability=np.exp(evidence - logsumexp(evidence)),
        per_record=np.exp(alone - logsumexp(alone, axis=1, keepdims=True)),
        mass=np.where(of_best, best.mass, 0.0),
        mass_std=np.where(of_best, best.mass_std, 0.0),
        scatter=np.exp(best.hyper[:-1]),
        model_error=float(np.exp(best.hyper[-1])),
        residual=best.residual,
        residual_std=best.residual_std,
        excess=problem.excess(best),
    )


def _sets(
    records: Sequence[BodyRecord], mass: FloatArray, mass_std: FloatArray, most: int
) -> tuple[tuple[int, ...], ...]:
    n = len(mass)
    if not records:
        raise ModalDataError("records: expected at least one, found none")
    if len(mass_std) != n or not (mass_std > 0).all():
        raise ValueError(f"mass_std: expected {n} positive numbers of kg, found {mass_std.tolist()}")
    if not mass.all():
        raise ValueError(f"mass: expected numbers of kg other than 0, found {mass.tolist()}")
    for number, record in enumerate(records, 1):
        if record.position.shape != (n, 3):
            raise ValueError(
                f"record {number}: expected positions of {n} candidates ({n}, 3), found {record.position.shape}"
            )
    most = min(most, n)
    total = int(sum(comb(n, k) for k in range(most + 1)))
    if most < 1 or total > _MAX_SETS:
        raise ValueError(f"most: expected at least 1 and at most {_MAX_SETS} sets, found {most} of {n}: {total} sets")
    return tuple(itertools.chain.from_iterable(itertools.combinations(range(n), k) for k in range(most + 1)))


def _members(sets: Sequence[tuple[int, ...]], n: int) -> BoolArray:
    return np.array([[k in one for k in range(n)] for one in sets])


def _log_prior(sets: Sequence[tuple[int, ...]], n: int) -> FloatArray:
    """Return the log probability of each set (n_sets,): each number alike, each set of a number alike."""
    most = max(len(one) for one in sets)
    return np.array([-np.log((most + 1) * comb(n, len(one))) for one in sets])


@dataclass(frozen=True, eq=False, kw_only=True)
class _KnownBodies(Discrete):
    """Point masses at known places of one record; an alternative is a set of them, the parameters all masses."""

    comparison: Comparison
    motion: FloatArray  #: (n_candidates, 3, n_modes) of the reference's modes at the candidates
    members: BoolArray  #: (n_sets, n_candidates)

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return modal mass changes sum m Phi^T Phi of the bodies in each set."""
        mass = np.einsum("pk,kar,kas->prs", np.where(self.members[rows], theta, 0.0), self.motion, self.motion)
        return replace(no_effect(len(rows), self.comparison), mass=mass)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Linear:
    """Residuals of one record, linear in the masses."""

    rest: FloatArray  #: (n_sets, n_modes) of log frequencies, at the masses of the linearisation
    slope: FloatArray  #: (n_sets, n_modes, n_candidates) derivative [1/kg]
    other: FloatArray  #: (n_sets, n_other) whitened, of shapes and all else
    other_slope: FloatArray  #: (n_sets, n_other, n_candidates)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Stack:
    """Log frequencies of some records under one set, linear in the masses, which other data determine in part."""

    rest: FloatArray  #: (n_records, n_modes) at the expected masses, as all else but frequencies gives them
    slope: FloatArray  #: (n_records, n_modes, n_candidates) [1/kg]
    expected: FloatArray  #: (n_candidates,) masses as expected by the prior and by all else but frequencies [kg]
    covariance: FloatArray  #: (n_candidates, n_candidates) of these [kg2]
    log_evidence: float  #: log evidence of everything else


@dataclass(frozen=True, eq=False, kw_only=True)
class _Covariance:
    """Covariance of log frequencies: independent between records, plus a common part of low rank."""

    own: FloatArray  #: (n_records, n_modes, n_modes) inverse of the part that is independent between records
    shared: FloatArray  #: (n_records, n_modes, n_shared) columns of the common part; their products are its covariance
    log_det_own: float  #: log determinant of the independent part

    @cached_property
    def pulled(self) -> FloatArray:
        """Shared columns times the inverse of the independent part (n_records, n_modes, n_shared)."""
        return np.asarray(self.own @ self.shared)

    @cached_property
    def core(self) -> FloatArray:
        """Matrix (n_shared, n_shared) of Woodbury's identity, before it is inverted."""
        return np.asarray(np.eye(self.shared.shape[2]) + np.einsum("kis,kit->st", self.shared, self.pulled))

    @property
    def log_det(self) -> float:
        """Log determinant of the whole."""
        return self.log_det_own + float(np.linalg.slogdet(self.core)[1])

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the inverse times columns (n_records, n_modes, n_columns)."""
        through = np.linalg.solve(self.core, np.einsum("kis,kic->sc", self.pulled, right))
        return np.asarray(self.own @ right - self.pulled @ through)

    def diagonals(self) -> tuple[FloatArray, FloatArray]:
        """Return diagonals of the inverse (n_records, n_modes), and of its sum over both records (n_modes,)."""
        inverse, summed = np.linalg.inv(self.core), self.pulled.sum(axis=0)
        each = np.diagonal(self.own, axis1=1, axis2=2) - ((self.pulled @ inverse) * self.pulled).sum(axis=2)
        return each, np.diag(self.own.sum(axis=0)) - ((summed @ inverse) * summed).sum(axis=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Fitted:
    """One set of candidates fitted to all records."""

    log_evidence: float
    hyper: FloatArray  #: (n_modes + 1,) logarithms of the scatter per mode and of the model's error
    mass: FloatArray  #: (n_candidates,) [kg]
    mass_std: FloatArray  #: (n_candidates,) [kg]
    residual: FloatArray  #: (n_records, n_modes)
    residual_std: FloatArray  #: (n_records, n_modes)


class _Problem:
    """All records, and their covariance under a scatter and an error of the model."""

    def __init__(
        self, records: Sequence[BodyRecord], members: BoolArray, mass: FloatArray, mass_std: FloatArray
    ) -> None:
        self._mass, self._mass_std, self._members = mass, mass_std, members
        data = [compare(r.reference, r.event) for r in records]
        self._mode = _common_modes(data)
        ratio = np.array([d.log_ratio[rows] for d, rows in zip(data, self._mode, strict=True)])
        shift = np.abs(ratio.mean(axis=0))
        self._model = 4 * shift * shift.mean()  # variance of ln f by a unit error of the model, the same in all records
        self._noise = np.array([_noise(d)[np.ix_(rows, rows)] for d, rows in zip(data, self._mode, strict=True)])
        self._middle = np.r_[np.full(len(shift), np.log(_SCATTER)), np.log(_ERROR)]
        self._spread = np.r_[np.full(len(shift), _SCATTER_SPREAD), _ERROR_SPREAD]
        self._bounds = Bounds(self._middle - _FARTHEST * self._spread, self._middle + _FARTHEST * self._spread)
        self._bodies = [
            _KnownBodies(
                comparison=replace(d, plain=_unwhitened(d), drifting=_unwhitened(d)),
                motion=_motion(r),
                members=members,
                prior_std=mass_std,
                lower=np.full(members.shape, -np.inf),
                drifting=True,
            )
            for d, r in zip(data, records, strict=True)
        ]

    @cached_property
    def _at_expected(self) -> list[_Linear]:
        """All sets of each record, linear about the expected masses."""
        every = np.arange(len(self._members))
        return [self._linear(k, every, self._mass) for k in range(len(self._bodies))]

    def _linear(self, record: int, rows: IndexArray, mass: FloatArray) -> _Linear:
        """Linearise sets `rows` about masses (n_candidates,)."""
        members = self._members[rows]
        bodies = replace(self._bodies[record], members=members, lower=np.full(members.shape, -np.inf))
        every = np.arange(len(rows))
        point = evaluate(bodies.comparison, bodies, np.tile(mass, (len(rows), 1)), every)
        slope = np.where(members[:, None], slopes(bodies.comparison, bodies, point, every), 0.0)
        mode, other = self._mode[record], slice(len(bodies.comparison.log_ratio), -len(mass))
        return _Linear(
            rest=point.residual[:, mode],
            slope=slope[:, mode],
            other=point.residual[:, other],
            other_slope=slope[:, other],
        )

    def _stack(self, linear: Sequence[_Linear], row: int, about: FloatArray) -> _Stack:
        """Return one set's residuals, linear about some masses (n_candidates,)."""
        moved = about - self._mass
        other_slope = np.concatenate([one.other_slope[row] for one in linear])
        other = np.concatenate([one.other[row] for one in linear]) - other_slope @ moved
        slope = np.array([one.slope[row] for one in linear])
        precision = other_slope.T @ other_slope + np.diag(self._mass_std**-2.0)
        covariance = np.linalg.inv(precision)
        change = -covariance @ (other_slope.T @ other)
        left = other + other_slope @ change
        volume = -2 * float(np.log(self._mass_std).sum()) - float(np.linalg.slogdet(precision)[1])
        return _Stack(
            rest=np.array([one.rest[row] for one in linear]) + slope @ (change - moved),
            slope=slope,
            expected=self._mass + change,
            covariance=covariance,
            log_evidence=0.5 * (volume - float(left @ left) - float(((change / self._mass_std) ** 2).sum())),
        )

    def fitted(self, row: int, before: _Fitted | None = None) -> _Fitted:
        """Fit masses, scatter and the model's error of one set to all records, linear about the masses of a fit before.

        Without one, about the expected masses.
        """
        if before is None:
            stack, hyper = self._stack(self._at_expected, row, self._mass), self._middle
        else:
            linear = [self._linear(k, np.array([row]), before.mass) for k in range(len(self._bodies))]
            stack, hyper = self._stack(linear, 0, before.mass), before.hyper
        found = minimize(self._cost, hyper, args=(stack,), jac=True, method="L-BFGS-B", bounds=self._bounds)
        gained = self._covariance(found.x, self._noise).solve(stack.slope)
        information = np.einsum("kia,kib->ab", stack.slope, gained)
        covariance = np.linalg.inv(information + np.linalg.inv(stack.covariance))
        change = -covariance @ np.einsum("kia,ki->a", gained, stack.rest)
        return _Fitted(
            log_evidence=stack.log_evidence - float(found.fun),
            hyper=found.x,
            mass=stack.expected + change,
            mass_std=np.sqrt(np.diag(covariance)),
            residual=stack.rest + stack.slope @ change,
            residual_std=np.sqrt(
                np.diagonal(self._noise, axis1=1, axis2=2)
                + np.exp(2 * found.x[:-1])
                + np.exp(2 * found.x[-1]) * self._model
            ),
        )

    def excess(self, fitted: _Fitted) -> float:
        """Return the largest excess of scatter or model error over its prior median, in prior standard deviations."""
        return float(((fitted.hyper - self._middle) / self._spread).max())

    def alone(self, record: int, hyper: FloatArray) -> FloatArray:
        """Return the log evidence of each set (n_sets,) by one record, its scatter and the model's error known."""
        found = np.empty(len(self._members))
        for row in range(len(found)):
            stack = self._stack([self._at_expected[record]], row, self._mass)
            whole = self._covariance(hyper, self._noise[[record]], stack)
            square = float((stack.rest * whole.solve(stack.rest[..., None])[..., 0]).sum())
            found[row] = stack.log_evidence - 0.5 * (square + whole.log_det)
        return found

    def _covariance(self, hyper: FloatArray, noise: FloatArray, stack: _Stack | None = None) -> _Covariance:
        """Return the covariance by noise (n_records, n_modes, n_modes), scatter and model, and by a set's masses."""
        own = noise + np.diag(np.exp(2 * hyper[:-1]))
        by_model = np.diag(np.exp(hyper[-1]) * np.sqrt(self._model))
        shared = [np.broadcast_to(by_model, own.shape)]
        if stack:
            shared.append(stack.slope @ np.linalg.cholesky(stack.covariance))
        return _Covariance(
            own=np.linalg.inv(own),
            shared=np.concatenate(shared, axis=2),
            log_det_own=float(np.linalg.slogdet(own)[1].sum()),
        )

    def _cost(self, hyper: FloatArray, stack: _Stack) -> tuple[float, FloatArray]:
        """Return minus the log posterior of scatter and model error, masses integrated out, and its gradient."""
        whole = self._covariance(hyper, self._noise, stack)
        pull = whole.solve(stack.rest[..., None])[..., 0]
        diagonal, diagonal_of_sum = whole.diagonals()
        per_datum = (diagonal - pull**2).sum(axis=0)
        in_common = diagonal_of_sum - pull.sum(axis=0) ** 2
        gradient = np.exp(2 * hyper) * np.append(per_datum, self._model @ in_common)
        off = (hyper - self._middle) / self._spread
        cost = 0.5 * float((stack.rest * pull).sum() + whole.log_det + off @ off)
        return cost, gradient + off / self._spread


def _motion(record: BodyRecord) -> FloatArray:
    """Return the translations (n_candidates, 3, n_modes) of the reference's modes at the candidates."""
    reference = record.reference
    read = reference.model.reader(record.position) @ reference.shape
    return np.asarray(read.reshape(len(record.position), 6, -1)[:, :3])


def _unwhitened(data: Comparison) -> Whitener:
    return Whitener(np.eye(len(data.log_ratio)), 0.0)


def _noise(data: Comparison) -> FloatArray:
    """Return the covariance (n, n) of log frequencies by noise and by a change common to all."""
    return data.frequency_covariance - data.model_covariance + COMMON_STD**2


def _common_modes(data: Sequence[Comparison]) -> IndexArray:
    """Return the modes (n_records, n_modes) of each record that all of them have, in the order of the first one's."""
    own = [np.log(d.frequency[d.paired]) for d in data]
    kept = np.ones(len(own[0]), bool)
    partner = []
    for other in own:
        away = np.abs(own[0][:, None] - other)
        one, of_other = linear_sum_assignment(away)
        near = away[one, of_other] < _SAME_MODE
        found = np.full(len(own[0]), -1)
        found[one[near]] = of_other[near]
        kept &= found >= 0
        partner.append(found)
    if kept.sum() < _FEWEST:
        raise ModalDataError(f"records: expected at least {_FEWEST} modes in common, found {int(kept.sum())}")
    return np.array(partner)[:, kept]
