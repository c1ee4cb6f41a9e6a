"""Law of undisturbed windows: dependence on temperature, and scatter about it.

Log frequencies are whitened by the deviations that windows state. About the law they scatter in three ways, which
are kept apart because they average differently over windows:

- fast: error of identification, new in every window; one factor on the stated one, from successive differences;
- slow: other movements of the baseline, its dominant subspace; wind, sun, moisture, load. It does not average out;
- unknown: the law's own uncertainty, small where temperatures have been seen and wide where not.

Every array may have leading dimensions, one entry a site.

References
----------
Yan, A.-M. et al. (2005). Structural damage diagnosis under varying environmental conditions. MSSP 19, 847-864: the
dominant subspace of the baseline as the unmeasured environment.
von Neumann, J. (1941). Distribution of the ratio of the mean square successive difference to the variance. Annals of
Mathematical Statistics 12, 367-395.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln

from daq import FloatArray
from monitor.detection.scores import alone
from monitor.detection.temperature_terms import N_TERMS, THERMOMETER_STD, prior_std

BoolArray = npt.NDArray[np.bool_]

CHUNK = 24  #: windows learned from at once; movements of their means are slow
UNOBSERVED_STD = 3e-4  #: possible effect of an environment not yet observed on all log frequencies alike, and on each
_UNOBSERVED_WORTH = 2.0  # degrees of freedom of the variance of unobserved movements
_FITTED = 4.0  # degrees of freedom that the law of temperature takes from residuals
_YEAR_WORTH = 15.6e6  # s that an unmeasured temperature's seasons are worth: half a year
_WEIGHTINGS = 3  # iterations of the weights of windows at freezing, by the errors of the law at freezing
_UNOBSERVED_SECONDS = 6 * 3600.0  # time constant of unobserved movements [s]
_THERMOMETER = np.array([0.15, 0.25, 0.4, 0.6, 0.8, 1.0, 1.5, 2.5])  # K, that the thermometer's deviation may be ...
_THERMOMETER_PRIOR = -0.5 * (np.log(_THERMOMETER / THERMOMETER_STD) / 0.7) ** 2  # ... and the logarithm of how likely
_LASTING = 0.5  # of the fast variance: a direction that varies more for long makes successive windows alike
COMMON_STD = 3e-3  # effect of an unmeasured temperature on all log frequencies alike (steel 0.018 %/K)
_STATED_WORTH = 8.0  # degrees of freedom that the stated deviations are worth
_EVEN_WORTH = 24.0  # ... and that modes scatter by the same times these
_MAX_FREEDOM = 1e4
_EFFICIENCY = 2 / 3  # degrees of freedom that a successive difference is worth
_CORRELATED_SECONDS = np.array([86400.0, 2 * _UNOBSERVED_SECONDS])  # of slow and of unobserved movements
_SCATTER = ("fast", "freedom", "slow", "unobserved", "rank", "tail", "thermometer")  # fields of a law
_WILD = 4.5  # standard deviations from which a mode's value teaches nothing
_TAILS = np.array([3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 12.0, 24.0, 100.0])  # degrees of freedom that a tail may have ...
_TAILS_PRIOR = np.array([-12.0, -11.0, -10.0, -9.0, -8.0, -7.0, -5.0, -3.0, 0.0])  # ... and the logarithm of how likely


@dataclass(frozen=True, eq=False, kw_only=True)
class Sums:
    """Sums over all windows of the baseline; further windows are added to them."""

    information: FloatArray  #: (..., 2, q, q) of the coefficients: common, own
    moment: FloatArray  #: (..., q, n_tracks) of whitened frequencies, already weighted: common and own parts together
    difference: FloatArray  #: (...,) half squared differences of successive windows, summed
    n_difference: FloatArray  #: (...,)
    product: FloatArray  #: (..., n_tracks, n_tracks) residuals' products, summed
    n_product: FloatArray  #: (..., n_tracks, n_tracks)
    of_means: FloatArray  #: (..., n_tracks, n_tracks) products of residuals' means over `CHUNK` windows, summed
    n_means: FloatArray  #: (...,)
    weight: FloatArray  #: (...,) inverse variances by which windows' products were weighted, summed
    weight_of_means: FloatArray  #: (...,) the same of means
    tail: FloatArray  #: (..., n_tails) log likelihood of each tail
    thermometer: FloatArray  #: (..., n) log likelihood of each deviation of the thermometer
    moving: FloatArray  #: (..., 2, 2) variance of slow and of unobserved movements by which `information` is weighted


@dataclass(frozen=True, eq=False, kw_only=True)
class Law:
    """The law and the scatter about it."""

    centre: FloatArray  #: (..., n_tracks) log frequency that whitened ones are counted from
    scale: FloatArray  #: (..., n_tracks) standard deviation stated by a window
    measured: BoolArray  #: (...,) whether temperature is
    step: float  #: interval of windows [s]
    sums: Sums
    coefficient: FloatArray  #: (..., q, n_tracks)
    unknown: FloatArray  #: (..., 2, q, q) covariance of the coefficients: common, own
    fast: FloatArray  #: (...,) variance new in every window, over the one predicted for it (`scatter`)
    freedom: FloatArray  #: (...,) degrees of freedom it is known with
    slow: FloatArray  #: (..., n_tracks, n_tracks) covariance that lasts, whitened
    unobserved: FloatArray  #: (..., n_tracks, n_tracks) the same for movements for which the baseline was too short
    rank: npt.NDArray[np.intp]  #: (...,) rank of lasting movements
    tail: FloatArray  #: (...,) degrees of freedom of a deviation's tail
    thermometer: FloatArray  #: (...,) standard deviation of the thermometer's as the structure's temperature [K]

    @property
    def common(self) -> FloatArray:
        """Return the whitened direction (..., n_tracks) in which all frequencies change alike."""
        return common_direction(self.scale)

    def whiten(self, log_frequency: FloatArray) -> FloatArray:
        """Return log frequencies (..., n_windows, n_tracks) in the law's units."""
        return (log_frequency - self.centre[..., None, :]) / self.scale[..., None, :]

    def residual(self, terms: FloatArray, whitened: FloatArray) -> FloatArray:
        """Return the residuals of the law (..., n_windows, n_tracks)."""
        return whitened - terms[..., 0, :] @ self.coefficient

    def lasting(self, terms: FloatArray, age: FloatArray | None = None) -> FloatArray:
        """Return the covariance (..., n_windows, n_tracks, n_tracks) that averaging does not reduce.

        Parameters
        ----------
        terms : (..., n_windows, 5, q)
        age : (n_windows,) since the baseline [s], from which on unseen movements may have occurred; None: long ago
        """
        unknown = self.unsure(terms)
        along = self.common[..., :, None] * self.common[..., None, :]
        across = np.eye(self.scale.shape[-1]) - along
        spread = (
            unknown[..., 0, None, None] * along[..., None, :, :] + unknown[..., 1, None, None] * across[..., None, :, :]
        )
        slow = self.slow[..., None, :, :] + self.come(age)[..., None, None] * self.unobserved[..., None, :, :]
        moved = self.by_temperature(terms)
        return np.asarray(spread + slow + np.swapaxes(moved, -1, -2) @ moved)

    def unsure(self, terms: FloatArray) -> FloatArray:
        """Return the law's own variance (..., n_windows, 2) along the common direction and across it."""
        variance = np.zeros((*terms.shape[:-2], 2))
        for row in (0, 2, 3):
            value = terms[..., None, :, row, :]
            variance += np.moveaxis((value @ self.unknown * value).sum(-1), -2, -1)
        return variance

    def by_temperature(self, terms: FloatArray) -> FloatArray:
        """Return deviations of modes (..., n_windows, 4, n_tracks) by those of the regressors.

        The thermometer's, as it is learned, holds above freezing only.
        """
        one = np.ones_like(self.thermometer)
        std = np.stack([self.thermometer, one, one, THERMOMETER_STD * one], axis=-1)
        return np.asarray(terms[..., 1:, :] @ self.coefficient[..., None, :, :] * std[..., None, :, None])

    def freezing(self, terms: FloatArray) -> FloatArray:
        """Return the variance (..., n_windows, 2) of the regressors' errors at freezing: common direction, across."""
        moved = self.by_temperature(terms)[..., 2:, :]
        along = (moved @ self.common[..., None, :, None])[..., 0]
        across = np.maximum((moved**2).sum(-1) - along**2, 0.0) / max(self.scale.shape[-1] - 1, 1)
        value = terms[..., None, :, 3, :]
        unknown = np.moveaxis((value @ self.unknown * value).sum(-1), -2, -1)
        return np.asarray(unknown + np.stack([(along**2).sum(-1), across.sum(-1)], axis=-1))

    def come(self, age: FloatArray | None) -> FloatArray:
        """Return the share of the variance of unseen movements that may have occurred by then (..., n_windows).

        A short baseline is one moment, which differs from a later one by twice the variance; a long one averages it.
        """
        come = np.ones(1) if age is None else -np.expm1(-age / _UNOBSERVED_SECONDS)
        return np.asarray((1 + self._unseen)[..., None] * come)

    @property
    def _unseen(self) -> FloatArray:
        return _unseen(np.mean(self.sums.n_product, axis=(-2, -1)) * self.step)

    def lasting_directions(self, terms: FloatArray, age: FloatArray, variance: FloatArray) -> npt.NDArray[np.intp]:
        """Return in how many directions (..., n_windows) successive windows differ from the law alike.

        Arguments are those of `lasting`, and the variance (..., n_windows) predicted for each.
        """
        least = _LASTING * self.fast[..., None] * variance
        unknown = self.unsure(terms)
        rank = np.repeat(self.rank[..., None], terms.shape[-3], axis=-1)
        share = np.broadcast_to(self.come(age), rank.shape)
        young = np.flatnonzero((share < 1.0).reshape(-1, rank.shape[-1]).any(0))
        come = share[..., young, None, None] * self.unobserved[..., None, :, :]
        value = np.linalg.eigvalsh(self.slow[..., None, :, :] + come)
        rank[..., young] = (value > least[..., young, None]).sum(-1)
        some = rank + ((self.by_temperature(terms) ** 2).sum(-1) > least[..., None]).sum(-1) + (unknown[..., 0] > least)
        p = self.scale.shape[-1]
        return np.asarray(np.where(unknown[..., 1] > least, p, np.minimum(some, p)), dtype=np.intp)


def _unseen(watched: FloatArray) -> FloatArray:
    """Return the weight (...,) of the prior in the variance of lasting movements, after that time of windows [s].

    Movements of some hours show their variance with one degree of freedom in that time.
    """
    freedom = np.maximum(watched / _UNOBSERVED_SECONDS - _FITTED, 0.0)
    return np.asarray(_UNOBSERVED_WORTH / (_UNOBSERVED_WORTH + freedom))


def common_direction(scale: FloatArray) -> FloatArray:
    """Return the unit vector along which equal relative changes lie once whitened."""
    return np.asarray((1 / scale) / np.linalg.norm(1 / scale, axis=-1, keepdims=True))


def first_law(
    log_frequency: FloatArray,
    std: FloatArray,
    terms: FloatArray,
    *,
    measured: BoolArray,
    lag: int,
    step: float,
    variance: FloatArray | None = None,
) -> Law:
    """Learn from baseline windows, values far from the others' left out.

    Parameters
    ----------
    log_frequency, std : (..., n_windows, n_tracks), NaN where a window lacks a mode
    terms : (..., n_windows, 5, q) from `environment.terms`
    measured : (...,) whether temperature is
    lag : windows from one to the next that shares no sample with it
    step : from one window to the next [s]
    variance : (..., n_windows) predicted for each, relative to the stated one. Default: the same for all
    """
    variance = np.ones(log_frequency.shape[:-1]) if variance is None else variance
    centre = np.nanmedian(log_frequency, axis=-2)
    stated = np.sqrt(np.nanmedian(std**2, axis=-2))
    blank = _blank(centre, stated, measured, step)
    even = _first_law(blank, log_frequency, terms, lag, variance)
    uneven = _uneven(even, log_frequency, terms, lag, variance)
    return _first_law(_blank(centre, stated * uneven, measured, step), log_frequency, terms, lag, variance)


def _first_law(blank: Law, log_frequency: FloatArray, terms: FloatArray, lag: int, variance: FloatArray) -> Law:
    whitened = blank.whiten(log_frequency)
    usual = 1.4826 * np.nanmedian(np.abs(whitened), axis=(-2, -1))
    cleaned = np.where(np.abs(whitened) > _WILD * usual[..., None, None], np.nan, whitened)
    age = log_frequency.shape[-2] * blank.step
    law = learn(blank, terms, cleaned, lag=lag, age=age, variance=variance)
    for _ in range(2):  # values rejected about the median are judged again about the law
        cleaned = np.where(_wild(law, terms, whitened, age, variance), np.nan, whitened)
        known = replace(blank, **{name: getattr(law, name) for name in _SCATTER})
        law = learn(known, terms, cleaned, lag=lag, age=age, variance=variance)
    return law


def learn(
    law: Law, terms: FloatArray, whitened: FloatArray, *, lag: int, age: float, variance: FloatArray | None = None
) -> Law:
    """Return the law after more windows, whitened by it; a window of NaN teaches nothing.

    The longer monitoring lasts (`age` [s]), the larger the part of unseen movements in them. `variance` (...,
    n_windows) is predicted for each, relative to the stated one.
    """
    variance = np.ones(whitened.shape[:-1]) if variance is None else variance
    kept = np.where(_wild(law, terms, whitened, age, variance), np.nan, whitened)
    solved = _regressed(_reweighted(law, age), terms, kept, age, variance)
    residual = solved.residual(terms, kept)
    share = _own_share(solved, terms, variance)
    scattered = _scattered(solved, residual, lag, variance, share)
    scattered = _thermometer(scattered, terms, residual, variance, share)
    return _tail(scattered, terms, scattered.residual(terms, whitened), age, variance)


def _regressed(law: Law, terms: FloatArray, kept: FloatArray, age: float, variance: FloatArray) -> Law:
    """Return the law with the coefficients after more windows.

    Errors of the regressors at freezing are proportional to the coefficients; windows in which frost has no effect
    determine these well. Weights and coefficients are therefore found alternately.
    """
    share, value = np.isfinite(kept).mean(-1), terms[..., 0, :]
    filled = _filled(law, terms, kept)
    along = law.common[..., None, :] * (filled @ law.common[..., :, None])
    solved = replace(law, unknown=np.zeros_like(law.unknown))
    for _ in range(_WEIGHTINGS):
        weights = share[..., None, :] / _noise(solved, terms, age, variance)
        weighted = weights[..., 0, :, None] * along + weights[..., 1, :, None] * (filled - along)
        new_information = np.swapaxes(value[..., None, :, :] * weights[..., None], -1, -2) @ value[..., None, :, :]
        moment = np.swapaxes(value, -1, -2) @ weighted
        solved = _solve(law, law.sums.information + new_information, law.sums.moment + moment)
        if not terms[..., 3:, :].any():
            break
    return solved


def _half_squares(residual: FloatArray, lag: int, variance: FloatArray) -> FloatArray:
    """Return half squared differences (..., n_windows - lag, n_tracks) over the variance predicted for them."""
    predicted = 0.5 * (variance[..., lag:] + variance[..., :-lag])
    return np.asarray(0.5 * (residual[..., lag:, :] - residual[..., :-lag, :]) ** 2 / predicted[..., None])


def _uneven(law: Law, log_frequency: FloatArray, terms: FloatArray, lag: int, variance: FloatArray) -> FloatArray:
    """Return the ratio of the scatter of each mode to the stated deviations (..., n_tracks), without the common part.

    A mode that is now and then taken for its neighbour would else make the others' scatter look large, too.
    """
    whitened = law.whiten(log_frequency)
    age = log_frequency.shape[-2] * law.step
    residual = law.residual(terms, np.where(_wild(law, terms, whitened, age, variance), np.nan, whitened))
    half = _half_squares(residual, lag, variance)
    n = np.isfinite(half).sum(-2)
    total = np.nansum(half, axis=-2)
    mean = total.sum(-1, keepdims=True) / np.maximum(n.sum(-1, keepdims=True), 1)
    each = np.where(n, total / np.maximum(n, 1), mean)
    alike = np.median(each, axis=-1, keepdims=True)
    worth = _EFFICIENCY * n
    return np.asarray(np.sqrt((_EVEN_WORTH + worth * each / np.maximum(alike, 1e-12)) / (_EVEN_WORTH + worth)))


def _blank(centre: FloatArray, scale: FloatArray, measured: BoolArray, step: float) -> Law:
    """Return the law before anything is measured, but for the frequencies about which it is drawn."""
    lead, p = centre.shape[:-1], centre.shape[-1]
    information = np.stack([np.eye(N_TERMS) / std[..., None, :] ** 2 for std in prior_std(scale)], axis=-3)
    sums = Sums(
        information=information,
        moment=np.zeros((*lead, N_TERMS, p)),
        difference=np.zeros(lead),
        n_difference=np.zeros(lead),
        product=np.zeros((*lead, p, p)),
        n_product=np.zeros((*lead, p, p)),
        of_means=np.zeros((*lead, p, p)),
        n_means=np.zeros(lead),
        weight=np.zeros(lead),
        weight_of_means=np.zeros(lead),
        tail=np.broadcast_to(_TAILS_PRIOR, (*lead, len(_TAILS))),
        thermometer=np.broadcast_to(_THERMOMETER_PRIOR, (*lead, len(_THERMOMETER))),
        moving=np.zeros((*lead, 2, 2)),
    )
    return Law(
        centre=centre,
        scale=scale,
        measured=measured,
        step=step,
        sums=sums,
        coefficient=np.zeros((*lead, N_TERMS, p)),
        unknown=_inverse(information),
        fast=np.ones(lead),
        freedom=np.full(lead, _STATED_WORTH),
        slow=np.zeros((*lead, p, p)),
        unobserved=np.zeros((*lead, p, p)),
        rank=np.zeros(lead, dtype=np.intp),
        tail=np.full(lead, 100.0),
        thermometer=np.full(lead, THERMOMETER_STD),
    )


def _wild(law: Law, terms: FloatArray, whitened: FloatArray, age: float, variance: FloatArray) -> BoolArray:
    """Return which values (..., n_windows, n_tracks) of that age are too far from the law to learn from."""
    lasting = np.diagonal(law.lasting(terms, np.array([age])), axis1=-2, axis2=-1)
    expected = (law.fast[..., None] * variance)[..., None] + lasting
    return np.asarray(law.residual(terms, whitened) ** 2 > _WILD**2 * expected)


def _filled(law: Law, terms: FloatArray, whitened: FloatArray) -> FloatArray:
    """Return whitened frequencies with missing modes predicted by the law and the common part of the others."""
    residual = law.residual(terms, whitened)
    seen = np.isfinite(residual)
    along = law.common[..., None, :]
    together = np.where(seen, residual * along, 0.0).sum(-1) / np.maximum((seen * along**2).sum(-1), 1e-12)
    return np.where(seen, whitened, terms[..., 0, :] @ law.coefficient + together[..., None] * along)


def _noise(law: Law, terms: FloatArray, age: float, variance: FloatArray) -> FloatArray:
    """Return the variance (..., 2, n_windows) of the common and of the own part of one window, for the regression.

    A movement lasts for many windows, so that together they determine it no better than one does. The same applies to
    errors of the law's regressors at freezing.
    """
    come = np.array([1.0, -np.expm1(-age / _UNOBSERVED_SECONDS)])
    alike = _alike(law, age)
    moving = (_moving(law) * (come * alike)[..., None]).sum(-2)
    freezing = np.moveaxis(law.freezing(terms), -1, -2) * alike[..., 1, None, None]
    return np.asarray((law.fast[..., None] * variance)[..., None, :] + moving[..., None] + freezing)


def _moving(law: Law) -> FloatArray:
    """Return the variance (..., 2, 2) of slow and of unobserved movements, along the common direction and across it."""
    return np.stack([_parts(law, law.slow), _parts(law, law.unobserved)], axis=-2)


def _alike(law: Law, age: float) -> FloatArray:
    """Return the windows (..., 2) within the correlation times of slow and of unobserved movements, or seen so far."""
    lasted = np.mean(law.sums.n_product, axis=(-2, -1)) * law.step + age
    return np.asarray(np.minimum(_CORRELATED_SECONDS, lasted[..., None]) / law.step)


def _parts(law: Law, covariance: FloatArray) -> FloatArray:
    """Return the variance (..., 2) along the common direction and, in the mean, across it."""
    along = np.einsum("...i,...ij,...j->...", law.common, covariance, law.common)
    across = (np.trace(covariance, axis1=-2, axis2=-1) - along) / max(covariance.shape[-1] - 1, 1)
    return np.stack([along, np.maximum(across, 0.0)], axis=-1)


def _reweighted(law: Law, age: float) -> Law:
    """Return the law, its windows so far weighted by the present variance of movements.

    It was assumed to be larger when the first windows were learned from.
    """
    moving, alike = _moving(law), _alike(law, age)[..., None]
    before, now = (law.fast[..., None] + (alike * m).sum(-2) for m in (law.sums.moving, moving))
    ratio = np.where(law.sums.moving.any(-2), before / now, 1.0)
    prior = np.stack([np.eye(N_TERMS) / std[..., None, :] ** 2 for std in prior_std(law.scale)], axis=-3)
    information = prior + ratio[..., None, None] * (law.sums.information - prior)
    along = law.common[..., None, :] * (law.sums.moment @ law.common[..., :, None])
    moment = ratio[..., 0, None, None] * along + ratio[..., 1, None, None] * (law.sums.moment - along)
    return replace(law, sums=replace(law.sums, information=information, moment=moment, moving=moving))


def _inverse(matrix: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _solve(law: Law, information: FloatArray, moment: FloatArray) -> Law:
    unknown = _inverse(information)
    along = law.common[..., None, :] * (moment @ law.common[..., :, None])
    coefficient = unknown[..., 0, :, :] @ along + unknown[..., 1, :, :] @ (moment - along)
    sums = replace(law.sums, information=information, moment=moment)
    return replace(law, sums=sums, coefficient=coefficient, unknown=unknown)


def _own_share(law: Law, terms: FloatArray, variance: FloatArray) -> FloatArray:
    """Return the share (..., n_windows) of a window's own error in its variance with that of freezing.

    Weight of windows as evidence of slow movements and of the thermometer's deviation. Errors of the regressors at
    freezing would otherwise count as either of these, and be added to the variance of freezing a second time.
    """
    freezing, p = law.freezing(terms), law.scale.shape[-1]
    own = law.fast[..., None] * variance
    return np.asarray(own / (own + (freezing[..., 0] + (p - 1) * freezing[..., 1]) / p))


def _scattered(law: Law, residual: FloatArray, lag: int, variance: FloatArray, share: FloatArray) -> Law:
    """Return the law with its scatter learned from the residuals too, which are weighted by the inverse variance."""
    seen = np.isfinite(residual)
    there = np.where(seen, residual, 0.0) * np.sqrt(share / variance)[..., None]
    means, weights, shares = _means(residual, variance, share)
    counts = means.any(-1) * shares
    weighted = means * np.sqrt(shares)[..., None]
    half = _half_squares(residual, lag, variance)
    sums = replace(
        law.sums,
        difference=law.sums.difference + np.nansum(half, axis=(-2, -1)),
        n_difference=law.sums.n_difference + np.isfinite(half).sum((-2, -1)),
        product=law.sums.product + np.swapaxes(there, -1, -2) @ there,
        n_product=law.sums.n_product + np.swapaxes(seen * share[..., None], -1, -2) @ seen,
        of_means=law.sums.of_means + np.swapaxes(weighted, -1, -2) @ weighted,
        n_means=law.sums.n_means + counts.sum(-1),
        weight=law.sums.weight + (seen.mean(-1) * share / variance).sum(-1),
        weight_of_means=law.sums.weight_of_means + (counts * weights).sum(-1),
    )
    worth = _EFFICIENCY * sums.n_difference
    fast = (_STATED_WORTH + _EFFICIENCY * sums.difference) / (_STATED_WORTH + worth)
    slow, unobserved = _slow(law, sums, fast)
    rank = (np.linalg.eigvalsh(slow + unobserved) > _LASTING * fast[..., None]).sum(-1)
    freedom = np.minimum(_STATED_WORTH + worth, _MAX_FREEDOM)
    return replace(law, sums=sums, fast=fast, freedom=freedom, slow=slow, unobserved=unobserved, rank=rank)


def _means(residual: FloatArray, variance: FloatArray, share: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return weighted means (..., n_chunks, n_tracks) over `CHUNK` windows, their weights and shares (..., n_chunks).

    A mean is over the root of its windows' mean variance; it is zero where a mode was hardly there.
    """
    n = residual.shape[-2] // CHUNK
    pieces = residual[..., : n * CHUNK, :].reshape(*residual.shape[:-2], n, CHUNK, residual.shape[-1])
    weights = 1 / variance[..., : n * CHUNK].reshape(*residual.shape[:-2], n, CHUNK).mean(-1)
    seen = np.isfinite(pieces).sum(-2)
    mean = np.where(np.isfinite(pieces), pieces, 0.0).sum(-2) / np.maximum(seen, 1)
    shares = share[..., : n * CHUNK].reshape(*share.shape[:-1], n, CHUNK).mean(-1)
    return np.where(seen > CHUNK // 3, mean * np.sqrt(weights)[..., None], 0.0), weights, shares


def _thermometer(law: Law, terms: FloatArray, residual: FloatArray, variance: FloatArray, share: FloatArray) -> Law:
    """Return the law with the thermometer's deviation learned from residuals along the law's slope.

    Means over `CHUNK` windows are normal with the variance of identification and that of the thermometer. Other
    movements in that direction count as the thermometer's. The first means are fitted by the law, and are no evidence.
    """
    means, weights, shares = _means(residual, variance, share)
    n = means.shape[-2]
    kelvin = (terms[..., 1, :] @ law.coefficient)[..., : n * CHUNK, :]
    slope = kelvin.reshape(*kelvin.shape[:-2], n, CHUNK, kelvin.shape[-1]).mean(-2) * np.sqrt(weights)[..., None]
    slope = np.where(means == 0, 0.0, slope)
    size = (slope**2).sum(-1)
    along = (means * slope).sum(-1) / np.sqrt(np.maximum(size, 1e-12))
    expected = (law.fast / CHUNK)[..., None, None] + _THERMOMETER**2 * size[..., None]
    each = np.where(size[..., None] > 0, np.log(expected) + along[..., None] ** 2 / expected, 0.0)
    gained = -0.5 * (shares[..., None] * each).sum(-2)
    after, new = law.sums.n_means, (means.any(-1) * shares).sum(-1)
    before = after - new
    evidence = np.maximum(after - _FITTED, 0.0) - np.maximum(before - _FITTED, 0.0)
    likelihood = law.sums.thermometer + gained * (evidence / np.maximum(new, 1e-9))[..., None]
    share = np.exp(likelihood - likelihood.max(-1, keepdims=True))
    std = np.sqrt((share * _THERMOMETER**2).sum(-1) / share.sum(-1))
    return replace(law, sums=replace(law.sums, thermometer=likelihood), thermometer=std)


def _slow(law: Law, sums: Sums, fast: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the covariances of lasting movements: in means over hours, in windows relative to these; and unseen ones.

    Unseen movements of the environment are assumed, the fewer the more was observed.
    """
    n = np.mean(sums.n_product, axis=(-2, -1))
    n_means = np.maximum(sums.n_means, 1)
    of_means = _dominant(sums.of_means / n_means[..., None, None], sums.n_means, fast / CHUNK)
    mean_weight = np.maximum(sums.weight, 1e-9) / np.maximum(n, 1)
    hours = of_means * (n_means / np.maximum(sums.weight_of_means, 1e-9))[..., None, None]
    beside = sums.product / np.maximum(sums.n_product - 1, 1) - hours * mean_weight[..., None, None]
    windows = _dominant(beside, n, fast) / mean_weight[..., None, None]
    watched = n * law.step
    share = _unseen(watched)
    unmeasured = np.where(law.measured, 0.0, _YEAR_WORTH / (_YEAR_WORTH + watched))
    unobserved = _uniform(law, share, UNOBSERVED_STD, UNOBSERVED_STD) + _uniform(
        law, unmeasured, COMMON_STD, COMMON_STD / 3
    )
    return (1 - share)[..., None, None] * (hours + windows), unobserved


def _uniform(law: Law, share: FloatArray, common_std: float, own_std: float) -> FloatArray:
    """Return the covariance of a relative change of all frequencies alike, and of each alone, times a share."""
    inverse = 1 / law.scale
    own = own_std**2 * inverse[..., None] ** 2 * np.eye(inverse.shape[-1])
    return np.asarray(share[..., None, None] * (common_std**2 * inverse[..., :, None] * inverse[..., None, :] + own))


def _dominant(covariance: FloatArray, n: FloatArray, noise: FloatArray) -> FloatArray:
    """Return the covariance of the directions that vary more than chance makes any vary.

    A few windows show a slow movement only a few times; its variance is enlarged by the corresponding uncertainty.

    Parameters
    ----------
    covariance : (..., n_tracks, n_tracks) of n values
    noise : (...,) variance that each direction has by chance

    References
    ----------
    Johnstone, I. M. (2001). On the distribution of the largest eigenvalue in principal components analysis. Annals of
    Statistics 29, 295-327: mean and deviation of the largest eigenvalue of noise; 2.02 is its 99 % quantile.
    """
    n, p = np.maximum(n, 3.0), covariance.shape[-1]
    value, vector = np.linalg.eigh(covariance / noise[..., None, None])
    root = np.sqrt(n - 1) + np.sqrt(p)
    chance = (root**2 + 2.02 * root * (1 / np.sqrt(n - 1) + 1 / np.sqrt(p)) ** (1 / 3)) / n
    kept = value > chance[..., None]
    excess = np.where(kept, value - 1, 0.0) * noise[..., None]
    return np.asarray((vector * excess[..., None, :]) @ np.swapaxes(vector, -1, -2))


def _tail(law: Law, terms: FloatArray, residual: FloatArray, age: float, variance: FloatArray) -> Law:
    """Return the law with tails learned from the residuals: the likelihood of Student's distributions.

    Wild values count at the limit: one wrong mode in a short baseline is no evidence of a tail. Nor are unseen
    movements that have not occurred: windows nearer to the law than these permit are not the narrow middle of a heavy
    tail.
    """
    fast = (law.fast[..., None] * variance)[..., None]
    value, vector = np.linalg.eigh(law.lasting(terms, np.array([age])) + fast[..., None] * np.eye(residual.shape[-1]))
    product = (law.sums.product / np.maximum(law.sums.n_product, 1))[..., None, :, :]
    seen = (vector * (product @ vector)).sum(-2) * variance[..., None]
    come = np.minimum(value, np.maximum(seen, fast))
    covariance = (vector * come[..., None, :]) @ np.swapaxes(vector, -1, -2)
    squared = np.minimum(alone(residual, covariance) ** 2, _WILD**2)[..., None]
    half = (_TAILS + 1) / 2
    constant = gammaln(half) - gammaln(_TAILS / 2) - 0.5 * np.log(np.pi * (_TAILS - 2))
    gained = np.nansum(constant - half * np.log1p(squared / (_TAILS - 2)), axis=(-3, -2))
    likelihood = law.sums.tail + np.where(np.isfinite(squared).any((-3, -2)), gained, 0.0)
    share = np.exp(likelihood - likelihood.max(-1, keepdims=True))
    tail = share.sum(-1) / (share / _TAILS).sum(-1)
    return replace(law, sums=replace(law.sums, tail=likelihood), tail=tail)
