"""Fit of all alternatives of a cause at once, and the evidence for each (Laplace)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, Protocol, Self, TypeVar, runtime_checkable

import numpy as np
import numpy.typing as npt
from scipy.special import chdtrc, logsumexp

from daq import FloatArray, IndexArray
from updater.inference.comparison import Comparison
from updater.inference.reanalysis import Changed, Effect, Tangent, picked, predict, reanalyse
from updater.inference.residuals import residual

_SHARES = (1.0, 0.3, 0.1, 0.03)  # of a step, tried until the fit is better
_ENOUGH = 0.01  # of chi-square: a step that gains less is an alternative's last
_AT_REST = 1e-3  # of chi-square: a step that is predicted to gain less is not evaluated: 0.03 standard deviations
# of the exponent of an alternative's density relative to the best: gains of improbable alternatives count for less
_CAUTION = 0.5
# chi-square over the best, after the predicted step, within which a step is evaluated
_REACH = (1000.0, 300.0, 60.0, 60.0, 60.0, 60.0)
_REACH_NEAR = (60.0, 30.0, 30.0, 30.0, 30.0, 30.0)  # likewise, of alternatives that begin near their best
_FEW = 150  # alternatives that are continued after the first step: those with the best predictions
_RESCALED = 6  # fits of refined alternatives: their prior's order converges, unless another alternative is best in turn
_HOPELESS = 300.0  # of chi-square over the best: alternatives that begin near their best are not fitted
_SHARE = 0.01  # of the chance that a right cause is refused: for its frequencies alone, which many shapes would drown
_ROUNDING = 1e-14  # of the diagonal of a normal matrix: errors of its entries
_PATIENCE = 3  # exchanges without fewer wrong parameters, after which they are exchanged one by one
_MAX_PIVOTS = 100  # exchanges
_WRONG = 1e-6  # standard deviations by which a parameter may go beyond its bound
_STEP = 1e-4  # of the finite differences of an effect, in prior standard deviations
_AT_ONCE = 256  # rows times parameters whose residuals are computed together: their arrays stay in the cache
_FIRST = np.zeros(1, np.intp)
BoolArray = npt.NDArray[np.bool_]


class Hypotheses(Protocol):
    """Alternatives of one cause, each with parameters that have a Gaussian prior about zero."""

    @property
    def prior_std(self) -> FloatArray:
        """Standard deviations (n_parameters,)."""

    @property
    def lower(self) -> FloatArray:
        """Least values (n_alternatives, n_parameters)."""

    @property
    def start(self) -> FloatArray:
        """Start of the fit (n_alternatives, n_parameters)."""

    @property
    def log_prior(self) -> FloatArray:
        """Log probability of each alternative (n_alternatives,), summing to one."""

    @property
    def drifting(self) -> bool:
        """True if a drift common to all frequencies is allowed: not if the structure itself is unchanged."""

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the effect of the alternatives `rows` with parameters theta (len(rows), n_parameters)."""

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return by how much a prior that is not Gaussian raises the log evidence of alternatives `rows`.

        Parameters
        ----------
        theta : (len(rows), n_parameters) fitted with the Gaussian prior
        covariance : (len(rows), n_parameters, n_parameters)
        rows : (len(rows),) alternatives
        """

    def refined(self, log_density: FloatArray, theta: FloatArray) -> Self | None:
        """Return closer alternatives near the maximum of the posterior, started from fitted neighbours.

        None if there is nothing between them.

        Parameters
        ----------
        log_density : (n_alternatives,) log evidence of each
        theta : (n_alternatives, n_parameters) the best of each
        """


@runtime_checkable
class LinearInCompliance(Protocol):
    """Alternatives with parameters that only add compliance, the same to each: exact derivatives are cheap."""

    def compliance_increments(self, theta: FloatArray) -> Mapping[int, tuple[FloatArray, FloatArray]]:
        """Return of such parameters a compliance (n_modes + n_stress, same), and how much of it a unit adds (n,).

        Parameters
        ----------
        theta : (n, n_parameters)
        """


class HasEffect(Protocol):
    """A cause with the effects of its alternatives."""

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the effect of the alternatives `rows` with parameters theta (len(rows), n_parameters)."""


#: a cause of a joint hypothesis, the columns of its parameters, and its alternative (n,) in each joint one
Part = tuple[HasEffect, slice, IndexArray]


@runtime_checkable
class Rescaled(Protocol):
    """Alternatives whose prior follows the order of the change, once they are refined."""

    def rescaled(self, log_density: FloatArray, theta: FloatArray) -> Self | None:
        """Return the same with a prior of the order of the best change; None if they have it.

        Parameters
        ----------
        log_density : (n_alternatives,) log evidence of each
        theta : (n_alternatives, n_parameters) the best of each
        """


@runtime_checkable
class Joint(Protocol):
    """Alternatives of several causes together, whose changes of mass and compliance add."""

    def parts(self, rows: IndexArray) -> Sequence[Part]:
        """Return the causes of alternatives `rows`, in the order of their parameters."""

    def joined(self, effects: Sequence[Effect]) -> Effect:
        """Return the effects of the causes together."""


H = TypeVar("H", bound=Hypotheses)


@dataclass(frozen=True, eq=False)
class Fit(Generic[H]):
    """The best parameters of every alternative."""

    hypotheses: H
    theta: FloatArray  #: (n_alternatives, n_parameters)
    covariance: FloatArray  #: (n_alternatives, n_parameters, n_parameters)
    chi_square: FloatArray  #: (n_alternatives,) of data and priors
    log_density: FloatArray  #: (n_alternatives,) log evidence of each, its own prior probability left out
    freedom: float  #: number of data less the parameters that they determine
    frequency_residual: FloatArray  #: (n_alternatives, n) whitened residuals of the frequencies

    @cached_property
    def log_evidence(self) -> float:
        """Log evidence of the cause, all alternatives together."""
        return float(logsumexp(self.log_density + self.hypotheses.log_prior))

    @cached_property
    def probability(self) -> FloatArray:
        """Probability of each alternative (n_alternatives,), if this is the cause."""
        log = self.log_density + self.hypotheses.log_prior
        return np.asarray(np.exp(log - logsumexp(log)))

    @cached_property
    def best(self) -> int:
        """The most probable alternative."""
        return int(np.argmax(self.probability))

    def only(self, chosen: BoolArray) -> "Fit[H]":
        """Return the same as if it were one of the chosen alternatives (n_alternatives,) alone."""
        return replace(self, log_density=np.where(chosen, self.log_density, -np.inf))

    @property
    def p_value(self) -> float:
        """Chance of a worse fit if this is the cause: of all data, or of the frequencies (Bonferroni, at most)."""
        best = int(np.argmin(self.chi_square))
        off = self.frequency_residual[best]
        of_frequencies = float(chdtrc(len(off), off @ off))
        return min(float(chdtrc(self.freedom, self.chi_square[best])), of_frequencies / _SHARE)


def freedom_of_frequencies(comparison: Comparison, found: Fit[H]) -> float:
    """Return the mean sum of squares [-] of the whitened residuals of the best alternative's frequencies.

    It is the number of frequencies less the trace of their block of the hat matrix. Parameters that are determined by
    shapes and priors do not reduce it.

    Parameters
    ----------
    comparison : that was fitted
    found : the fit
    """
    rows = np.array([found.best])
    point = evaluate(comparison, found.hypotheses, found.theta[rows], rows)
    slope = slopes(comparison, found.hypotheses, point, rows)[0, : len(comparison.log_ratio)]
    return len(slope) - float(np.einsum("ij,jk,ik->", slope, found.covariance[found.best], slope))


def fit(comparison: Comparison, hypotheses: H, *, refine: bool = True, start: FloatArray | None = None) -> Fit[H]:
    """Fit every alternative by Gauss-Newton, all at once; on request, refined alternatives afterwards.

    Parameters
    ----------
    comparison : measured
    hypotheses : alternatives of one cause, or of several together
    refine : whether places between those of the best alternatives are fitted too
    start : (n_alternatives, n_parameters) fitted to similar data, in the place of the alternatives' own start
    """
    own = hypotheses.start if start is None else start
    found = _fit(comparison, hypotheses, own, near=start is not None)
    return refined_fit(comparison, found) if refine else found


def refined_fit(comparison: Comparison, found: Fit[H]) -> Fit[H]:
    """Fit refined alternatives after the first ones, with a prior of their order; return the last fit."""
    closer = found.hypotheses.refined(found.log_density, found.theta)
    for left in reversed(range(_RESCALED)):
        if closer is None:
            break
        hopeless = np.inf if isinstance(closer, Rescaled) else _HOPELESS  # they begin far from their best too
        found = _fit(comparison, closer, closer.start, near=True, hopeless=hopeless)
        closer = closer.rescaled(found.log_density, found.theta) if left and isinstance(closer, Rescaled) else None
    return found


@dataclass(eq=False)
class Point:
    """State of the fit of some alternatives."""

    theta: FloatArray
    effect: Effect
    changed: Changed
    residual: FloatArray

    @property
    def cost(self) -> FloatArray:
        """Chi-square (n_alternatives,), the priors' included."""
        return np.asarray((self.residual**2).sum(1))

    def rows(self, rows: IndexArray) -> "Point":
        """Return some alternatives."""
        return Point(self.theta[rows], self.effect.rows(rows), self.changed.rows(rows), self.residual[rows])


def _fit(
    comparison: Comparison, hypotheses: H, start: FloatArray, *, near: bool, hopeless: float = _HOPELESS
) -> Fit[H]:
    """Fit all alternatives, which begin at `start` (n_alternatives, n_parameters).

    Parameters
    ----------
    near : whether that is near the best of each
    hopeless : of chi-square over the best: alternatives that begin near their best are not fitted
    """
    everything = np.arange(len(start))
    point = evaluate(comparison, hypotheses, start, everything)
    moving = point.cost < point.cost.min() + (hopeless if near else np.inf)
    moving &= bool(len(hypotheses.prior_std))
    begun = np.flatnonzero(moving)
    slope = _of_priors(hypotheses, point)
    slope[begun] = slopes(comparison, hypotheses, point, begun)
    for number, reach in enumerate(_REACH_NEAR if near else _REACH):
        step, promised = _newton(slope, point.residual, point.theta - hypotheses.lower)
        over = point.cost - promised - point.cost.min()
        worth = moving & (over < reach)
        if near or number > 1:  # else the prediction is of too large a step
            worth &= promised * np.exp(-_CAUTION * np.maximum(over, 0.0) / 2) > _AT_REST
        alive = np.flatnonzero(worth)
        if number:
            alive = np.sort(alive[np.argsort(over[alive], kind="stable")[:_FEW]])
        if not len(alive):
            break
        before = point.cost[alive]
        _descend(comparison, hypotheses, point, slope, step[alive], alive)
        gained = before - point.cost[alive]
        moving[alive] = gained > _ENOUGH
        moved = alive[gained > 0]
        if len(moved):
            slope[moved] = slopes(comparison, hypotheses, point, moved)
    covariance = _covariance(slope)
    of_frequencies = comparison.log_det_of_frequencies(drifting=hypotheses.drifting)
    of_new = comparison.freedom_of_new(point.effect.own.shape[1])
    volume = 0.5 * np.linalg.slogdet(covariance)[1] - np.log(hypotheses.prior_std).sum()
    log_ratio = hypotheses.log_ratio(point.theta, covariance, everything)
    determined = _determined(hypotheses, covariance[int(np.argmin(point.cost))])
    return Fit(
        hypotheses=hypotheses,
        theta=point.theta,
        covariance=covariance,
        chi_square=point.cost,
        log_density=-0.5 * point.cost + volume + of_frequencies + log_ratio,
        freedom=max(comparison.freedom + of_new - determined, 1.0),
        frequency_residual=point.residual[:, : len(comparison.log_ratio)],
    )


def _covariance(slope: FloatArray) -> FloatArray:
    """Return the covariance (n_alternatives, n_parameters, n_parameters) of the parameters at the best fit."""
    covariance = np.linalg.inv(normal(slope)).astype(np.float64)
    lost = np.flatnonzero((np.diagonal(covariance, axis1=1, axis2=2) <= 0).any(1))
    if len(lost):  # by rounding in the squares, as of data without an error: from the slopes themselves
        root = np.linalg.inv(np.linalg.qr(slope[lost], mode="r"))
        covariance[lost] = root @ root.transpose(0, 2, 1)
    return covariance


def _determined(hypotheses: Hypotheses, covariance: FloatArray) -> float:
    """Return how many parameters the data determine: a parameter that keeps its prior takes nothing from the data.

    Parameters
    ----------
    covariance : (n_parameters, n_parameters) of one alternative
    """
    return len(covariance) - float((np.diag(covariance) / hypotheses.prior_std**2).sum())


def _of_priors(hypotheses: Hypotheses, point: Point) -> FloatArray:
    """Return the derivatives (n_alternatives, n_data + n_parameters, n_parameters) of the priors' residuals alone."""
    n = len(hypotheses.prior_std)
    slope = np.zeros((*point.residual.shape, n))
    slope[:, point.residual.shape[1] - n :] = np.diag(1 / hypotheses.prior_std)
    return slope


def _newton(slope: FloatArray, residual: FloatArray, room: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the step of each alternative (n_alternatives, n_parameters), and the predicted reduction of chi-square.

    Parameters
    ----------
    room : (n_alternatives, n_parameters) largest decrease of each parameter, to its least value
    """
    whole, gradient = normal(slope), np.einsum("pij,pi->pj", slope, residual)
    step = np.linalg.solve(whole, gradient[..., None])[..., 0]
    beyond = np.flatnonzero((step > room).any(1))
    if len(beyond):
        step[beyond] = _bounded(whole[beyond], gradient[beyond], room[beyond], step[beyond] > room[beyond])
    moved = (whole @ step[..., None])[..., 0]
    return step, np.asarray(((2 * gradient - moved) * step).sum(1))


def _bounded(whole: FloatArray, gradient: FloatArray, room: FloatArray, held: BoolArray) -> FloatArray:
    """Return the steps s (n, k) with the least s^T A s - 2 g^T s that go no farther than the room.

    By block principal pivoting: parameters that go too far are held at their bound, and those whose gradient leads away
    from it are released, all at once while their number decreases, else one by one.

    Parameters
    ----------
    whole, gradient : (n, k, k), (n, k) A and g
    room : (n, k) largest steps, infinite without a bound
    held : (n, k) parameters that are at their bound first

    References
    ----------
    Kim, J., Park, H. (2011). Fast nonnegative matrix factorization: an active-set-like method. SIAM J. Sci. Comput.
    33(6), 3261-3281.
    """
    scale = np.sqrt(np.diagonal(whole, axis1=1, axis2=2))
    fewest, patience = np.full(len(whole), held.shape[1] + 1), np.full(len(whole), _PATIENCE)
    step = np.zeros(gradient.shape)
    for _ in range(_MAX_PIVOTS):
        at = np.where(held, room, 0.0)
        alone = np.where(held[:, :, None] | held[:, None, :], np.eye(held.shape[1]), whole)
        right = np.where(held, at, gradient - (whole @ at[..., None])[..., 0])
        step = np.linalg.solve(alone, right[..., None])[..., 0]
        pull = gradient - (whole @ step[..., None])[..., 0]
        wrong = np.where(held, pull < -_WRONG * scale, (step - room) * scale > _WRONG)
        number = wrong.sum(1)
        if not number.any():
            break
        patience = np.where(number < fewest, _PATIENCE, patience - 1)
        fewest = np.minimum(fewest, number)
        last = wrong & (np.cumsum(wrong[:, ::-1], axis=1)[:, ::-1] == 1)
        held = held ^ np.where(patience[:, None] >= 0, wrong, last)
    return np.minimum(step, room)


def normal(slope: FloatArray) -> FloatArray:
    """Return the normal matrices (n_alternatives, n_parameters, n_parameters), the diagonal larger by rounding.

    Where more mass is taken off than the modes have, all derivatives are nearly parallel, and far larger than those of
    the priors: rounding may make the matrix singular.
    """
    matrix = slope.transpose(0, 2, 1) @ slope
    every = np.arange(matrix.shape[1])
    matrix[:, every, every] *= 1 + _ROUNDING
    return matrix


def _descend(
    comparison: Comparison,
    hypotheses: Hypotheses,
    point: Point,
    slope: FloatArray,
    step: FloatArray,
    rows: IndexArray,
) -> None:
    """Take of each row's step the largest share that fits better; none where none is predicted to gain anything.

    Parameters
    ----------
    slope : (n_alternatives, n_data + n_parameters, n_parameters) of all alternatives
    step : (len(rows), n_parameters)
    """
    least = np.full(len(rows), _AT_REST)  # gain that a share must promise
    for share in _SHARES:
        theta = np.maximum(point.theta[rows] - share * step, hypotheses.lower[rows])
        worth = np.flatnonzero(_predicted_gain(slope[rows], point.residual[rows], theta - point.theta[rows]) > least)
        if not len(worth):
            continue
        tried = evaluate(comparison, hypotheses, theta[worth], rows[worth])
        better = tried.cost < point.cost[rows[worth]]
        _adopt(point, tried, rows[worth[better]], better)
        least[worth] = _ENOUGH
        left = np.delete(np.arange(len(rows)), worth[better])
        rows, step, least = rows[left], step[left], least[left]
        if not len(rows):
            break


def _predicted_gain(slope: FloatArray, residual: FloatArray, change: FloatArray) -> FloatArray:
    """Return by how much a change of the parameters (n, n_parameters) lowers chi-square (n,), to first order."""
    moved = (slope @ change[:, :, None])[:, :, 0]
    return np.asarray(-((2 * residual + moved) * moved).sum(1))


def _adopt(point: Point, tried: Point, rows: IndexArray, chosen: BoolArray) -> None:
    for name, values in vars(point.effect).items():
        if isinstance(values, np.ndarray):
            expected = 1 if len(values) == 1 else len(chosen)
            if len(found := getattr(tried.effect, name)) != expected:
                raise ValueError(
                    f"Effect.{name}: expected {expected} rows, as at the start of the fit, found {len(found)}"
                )
    pairs = [(point, tried), (point.effect, tried.effect), (point.changed, tried.changed)]
    for into, source in pairs:
        for name, values in vars(into).items():
            if isinstance(values, np.ndarray) and len(values) == len(point.theta):  # else no alternative changes it
                values[rows] = getattr(source, name)[chosen]


def evaluate(comparison: Comparison, hypotheses: Hypotheses, theta: FloatArray, rows: IndexArray) -> Point:
    """Evaluate alternatives: prediction and whitened residuals.

    Parameters
    ----------
    comparison : measured
    hypotheses : alternatives
    theta : (len(rows), n_parameters) their parameters [unit of each]
    rows : numbers of the alternatives
    """
    effect = hypotheses.effect(theta, rows)
    changed = reanalyse(comparison, effect)
    value, vector = picked(changed)
    return Point(theta.copy(), effect, changed, _residual(comparison, hypotheses, theta, value, vector, effect))


def _residual(
    comparison: Comparison,
    hypotheses: Hypotheses,
    theta: FloatArray,
    value: FloatArray,
    vector: FloatArray,
    effect: Effect,
) -> FloatArray:
    """Return whitened residuals (n_alternatives, n_data + n_parameters), the priors' included."""
    whitener = comparison.drifting if hypotheses.drifting else comparison.plain
    of_data = residual(comparison, predict(comparison, value, vector, effect), whitener)
    return np.concatenate([of_data, theta / hypotheses.prior_std], axis=1)


def slopes(
    comparison: Comparison, hypotheses: Hypotheses, point: Point, rows: IndexArray, parameters: range | None = None
) -> FloatArray:
    """Return the derivatives of the residuals with respect to the parameters.

    Parameters
    ----------
    comparison, hypotheses : measured, and alternatives
    point : evaluated alternatives
    rows : their numbers
    parameters : those with respect to which derivatives are computed. Default: all

    Returns
    -------
    (len(rows), n_data + n_parameters, n_parameters)
        Of whitened residuals [1/unit of the parameter].
    """
    columns = list(range(len(hypotheses.prior_std)) if parameters is None else parameters)
    at = point.rows(rows)
    common = _common(hypotheses, at, rows)
    slope = np.zeros((len(columns), *at.residual.shape))
    each, once = ([i for i, k in enumerate(columns) if (k in common) is given] for given in (False, True))
    slope[each] = _slopes(comparison, hypotheses, at, rows, [columns[i] for i in each])
    if once:
        slope[once] = _slopes(comparison, hypotheses, at.rows(_FIRST), rows[:1], [columns[i] for i in once])
    return np.ascontiguousarray(np.moveaxis(slope, 0, 2))


def _common(hypotheses: Hypotheses, point: Point, rows: IndexArray) -> set[int]:
    """Return the parameters with the same derivatives for all rows: of other causes, before the free one acts."""
    parts = _parts_of(hypotheses, rows)
    if len(rows) < 2 or len(parts) < 2 or not point.effect.alike:
        return set()
    same = (range(own.start, own.stop) for _, own, number in parts if _is_common(point.theta[:, own], number))
    return {k for columns in same for k in columns}


def _parts_of(hypotheses: Hypotheses, rows: IndexArray) -> Sequence[Part]:
    """Return the causes of a hypothesis; itself if it is one."""
    if isinstance(hypotheses, Joint):
        return hypotheses.parts(rows)
    return [(hypotheses, slice(0, len(hypotheses.prior_std)), rows)]


def effects_of(parts: Sequence[Part], theta: FloatArray) -> list[Effect]:
    """Return the effect of each cause for n alternatives; one that is the same in all rows is computed once.

    Parameters
    ----------
    parts : causes with the columns of their parameters and their alternatives (n,)
    theta : (n, n_parameters) parameters [unit of each cause]
    """
    return [
        cause.effect(theta[:2, own], number[:2]).rows(
            np.zeros(len(number), np.intp)
        )  # all rows are equal: two are sufficient
        if len(number) > 2 and _is_common(theta[:, own], number)
        else cause.effect(theta[:, own], number)
        for cause, own, number in parts
    ]


def _is_common(theta: FloatArray, number: IndexArray) -> bool:
    """Return whether all rows have one alternative (n,) with the same parameters (n, n_parameters)."""
    return bool((number == number[0]).all() and (theta == theta[0]).all())


def _slopes(
    comparison: Comparison, hypotheses: Hypotheses, point: Point, rows: IndexArray, columns: list[int]
) -> FloatArray:
    """Return the derivatives (len(columns), len(rows), n_data + n_parameters) by some parameters, at these rows."""
    value, vector = picked(point.changed)
    tangent, theta, steps = Tangent(point.changed, point.effect), point.theta, _STEP * hypotheses.prior_std
    linear = hypotheses.compliance_increments(theta) if isinstance(hypotheses, LinearInCompliance) else {}
    parts = _Parts(hypotheses, point, rows)
    slope = np.zeros((len(columns), *point.residual.shape))
    for group in _groups([None if k in linear else parts.of[k] for k in columns], len(rows)):
        k = np.array([columns[g] for g in group])
        moved = np.tile(theta, (len(k), 1, 1))
        moved[np.arange(len(k)), :, k] += steps[k, None]
        stacked, every = moved.reshape(-1, len(steps)), np.tile(np.arange(len(rows)), len(k))
        if k[0] in linear:
            effect, amount = point.effect.rows(every), steps[k, None] * [linear[each][1] for each in k]
            d_value, d_vector = map(np.array, zip(*(tangent.by_compliance(linear[each][0]) for each in k), strict=True))
            d_value, d_vector = amount[..., None] * d_value, amount[..., None, None] * d_vector
        else:
            before, effect = parts.moved(parts.of[k[0]], stacked, every)
            d_value, d_vector = tangent.between(before, effect, len(k))
        found = _residual(
            comparison,
            hypotheses,
            stacked,
            np.broadcast_to(value + d_value, (len(k), *value.shape)).reshape(-1, *value.shape[1:]),
            np.broadcast_to(vector + d_vector, (len(k), *vector.shape)).reshape(-1, *vector.shape[1:]),
            effect,
        )
        slope[group] = (found.reshape(len(k), *point.residual.shape) - point.residual) / steps[k, None, None]
    return slope


class _Parts:
    """Causes of a hypothesis, moved one at a time: what the others change in the structure cancels."""

    def __init__(self, hypotheses: Hypotheses, point: Point, rows: IndexArray) -> None:
        """Compute the effect of each cause by itself at a point (len(rows),)."""
        self._parts = _parts_of(hypotheses, rows)
        #: number of the cause of each parameter
        self.of = [i for i, (_, own, _) in enumerate(self._parts) for _ in range(own.start, own.stop)]
        self._before = [point.effect]
        self._joint = hypotheses if len(self._parts) > 1 and isinstance(hypotheses, Joint) else None
        if self._joint is not None:
            effects = effects_of(self._parts, point.theta)
            self._others = [effect.without_structure() for effect in effects]
            self._before = [self._with_others(i, effect, np.arange(len(rows))) for i, effect in enumerate(effects)]

    def moved(self, number: int, theta: FloatArray, every: IndexArray) -> tuple[Effect, Effect]:
        """Return the joint effect before and after one cause has moved, without the others' mass and compliance.

        Parameters
        ----------
        number : of the cause
        theta : (n, n_parameters) parameters to which it moves
        every : (n,) positions of their rows
        """
        part, own, rows = self._parts[number]
        return self._before[number], self._with_others(number, part.effect(theta[:, own], rows[every]), every)

    def _with_others(self, number: int, effect: Effect, every: IndexArray) -> Effect:
        if self._joint is None:
            return effect
        others = [other.rows(every) for other in self._others]
        return self._joint.joined([*others[:number], effect, *others[number + 1 :]])


def _groups(kinds: list[int | None], n_rows: int) -> list[list[int]]:
    """Return positions of parameters whose derivatives are computed together: some of one kind."""
    size = max(_AT_ONCE // max(n_rows, 1), 1)
    alike = [[i for i, each in enumerate(kinds) if each == kind] for kind in dict.fromkeys(kinds)]
    return [kind[start : start + size] for kind in alike for start in range(0, len(kind), size)]
