"""Probability of locating a body of a given mass: Monte Carlo simulation of records not yet measured.

At each place the body's exact effect is computed, the expected errors are drawn many times, and the likelihood of
every other place is formed as `locate_mass` would, with the same covariances, priors and nuisances, but linear about
the body's mass: the data enter by inner products only, thousands of records a second.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp
from scipy.stats import chi2

from daq import FloatArray, IndexArray
from updater.errors import ModalDataError, ModelError
from updater.inference import Comparison, Prediction, compare, likeliest_place, picked, predict, reanalyse
from updater.modal_data import ModalMean
from updater.planning.detectability import DetectabilityStudy

_DRAWS = 200
_SEED = 7  # the same question has the same answer
_STEP = 0.05  # of a parameter's prior standard deviation, for finite differences
_PERIODS = 250.0  # of the lowest seen mode in the shortest record tried
_LONGEST = 86400.0  # s, of the longest


@dataclass(frozen=True, kw_only=True)
class Target:
    """Body that is to be located."""

    mass: float  #: [kg]
    within: float = 0.05  #: largest distance of the answer from the truth [m]
    chance: float = 0.95  #: probability of an alarm and an answer within that

    def __post_init__(self) -> None:
        """Refuse invalid requests."""
        if not 0 < abs(self.mass) < np.inf:
            raise ValueError(f"mass: expected a number of kg other than 0, found {self.mass!r}")
        if not 0 < self.within < np.inf:
            raise ValueError(f"within: expected a positive distance in m, found {self.within!r}")
        if not 0 < self.chance < 1:
            raise ValueError(f"chance: expected a number between 0 and 1, found {self.chance!r}")


@dataclass(frozen=True, eq=False)
class _Signatures:
    """Effect of the body, and its derivatives, at each possible place."""

    rows: IndexArray  #: (n,) places of the outlook
    log_ratio: FloatArray  #: (n_parameters, n, n_modes)
    shape: FloatArray  #: (n_parameters, n, n_modes, n_channels)
    prior: FloatArray  #: (n_parameters,) inverse variances


@dataclass(frozen=True, eq=False)
class _Draws:
    """Standard normal numbers behind the errors of the played records, the same for records of every length."""

    frequency: FloatArray  #: (n_draws, n) errors of the measurement
    frequency_model: FloatArray  #: (n_draws, n) errors of the model
    mixing: FloatArray  #: (n_draws, n, n_modes) contributions of other modes to a shape
    shape_model: FloatArray  #: (n_draws, n, n_channels) errors of the model
    blur: FloatArray  #: (n_draws, n, n_channels) of the channels' own noise


class LocalizationSimulation:
    """One mass anywhere on a structure.

    Parameters
    ----------
    outlook : the structure and its sensors
    target : mass to be found

    Raises
    ------
    ModelError
        If the mass is more than a fifth of the structure's: the likelihood's prior does not expect it.
    """

    def __init__(self, outlook: DetectabilityStudy, target: Target) -> None:
        heaviest = float(outlook.places.prior_std[0])
        if abs(target.mass) > heaviest:
            name = outlook.reference.structure.name
            raise ModelError(f"{name}: expected a target of at most {heaviest:.3g} kg, found {target.mass:g} kg")
        self._outlook, self.target = outlook, target  #: body that is to be located
        step = max(1, int(target.within / 4 / float(np.median(outlook.places.weight))))
        self._signatures = _signatures(outlook, target.mass, np.arange(0, len(outlook.member), step))
        self._draws = _draw(outlook)

    @property
    def places(self) -> IndexArray:
        """Places of the outlook where the body is tried."""
        return self._signatures.rows

    @property
    def records(self) -> FloatArray:
        """Records that are tried (n,) [s], each twice as long as the one before, up to a day."""
        shortest = _PERIODS / float(self._outlook.frequency.min())
        doubled = shortest * 2.0 ** np.arange(max(0, int(np.ceil(np.log2(_LONGEST / shortest)))))
        return np.append(doubled, max(shortest, _LONGEST))

    def chance(self, seconds: float, places: IndexArray) -> FloatArray:
        """Return how often the body raises the alarm and is found near enough (n,).

        Parameters
        ----------
        seconds : of the record before and of that after [s]
        places : (n,) some of `places`
        """
        outlook = self._outlook.lasting(seconds)
        return np.array([self._chance(outlook, int(np.searchsorted(self.places, p))) for p in places])

    def seconds_needed(self, places: IndexArray) -> FloatArray:
        """Return how long both records must last (n,) [s]; infinite where a day's do not suffice.

        Parameters
        ----------
        places : (n,) some of `places`
        """
        needed, chance = np.full(len(places), np.inf), np.zeros(len(places))
        shorter = float(self.records[0])
        for seconds in self.records.tolist():
            left = np.flatnonzero(np.isinf(needed))
            if not len(left):
                break
            now = self.chance(seconds, places[left])
            share = (self.target.chance - chance[left]) / np.maximum(now - chance[left], 1e-9)
            between = shorter * (seconds / shorter) ** np.clip(share, 0, 1)
            needed[left] = np.where(now >= self.target.chance, between, np.inf)
            chance[left], shorter = now, seconds
        return needed

    def _chance(self, outlook: DetectabilityStudy, place: int) -> float:
        known, base = self._signatures, outlook.reference.baseline
        try:
            data = compare(outlook.reference, _event(base, known.log_ratio[0, place], known.shape[0, place]))
        except ModalDataError:  # the body makes two modes look like one: refused, so not found
            return 0.0
        error = self._errors(outlook, data)
        shift = known.log_ratio[0, place] + error[0]
        t2 = (shift**2 / (2 * base.log_frequency_std**2)).sum(1)
        alarm = t2 > chi2.isf(outlook.record.false_alarm_probability, shift.shape[1])
        signature = _whitened(data, known.log_ratio, known.shape).transpose(1, 0, 2)
        measured = signature[place, 0] + _whitened(data, *error)
        answer = self._answers(signature, measured)
        near = np.linalg.norm(answer - outlook.point[known.rows[place]], axis=1) <= self.target.within
        return float((alarm & near).mean())

    def _errors(self, outlook: DetectabilityStudy, data: Comparison) -> tuple[FloatArray, FloatArray]:
        """Draw errors of log ratios (n_draws, n) and of shapes (n_draws, n, n_channels): of records, of the model."""
        quiet = outlook.bodies.comparison
        std = np.sqrt(2) * outlook.reference.baseline.log_frequency_std
        model = np.sqrt(np.maximum(_variance(data) - _variance(quiet), 0))
        blur = outlook.record.blur(outlook.frequency)[:, None] * self._draws.blur
        by_mode = np.einsum("din,inc->dic", self._draws.mixing, outlook.shape_error)
        covariance = _covariance(data.shape_whitener) - _covariance(quiet.shape_whitener)
        value, vector = np.linalg.eigh(covariance)  # rounding may have made it indefinite
        root = np.asarray(vector * np.sqrt(np.maximum(value, 0))[:, None, :])
        by_model = np.einsum("icd,sid->sic", root, self._draws.shape_model)
        frequency = std * self._draws.frequency + model * self._draws.frequency_model
        return frequency, np.sqrt(2) * (by_mode + blur) + by_model

    def _answers(self, signature: FloatArray, measured: FloatArray) -> FloatArray:
        """Return the place of each record's posterior (n_draws, 3).

        Parameters
        ----------
        signature : (n, n_parameters, n_data)
        measured : (n_draws, n_data)
        """
        bodies, rows = self._outlook.bodies, self._signatures.rows
        normal = signature @ signature.transpose(0, 2, 1) + np.diag(self._signatures.prior)
        root = np.linalg.inv(np.linalg.cholesky(normal))
        basis = root @ signature
        score = ((measured @ basis.reshape(-1, basis.shape[2]).T).reshape(len(measured), *basis.shape[:2]) ** 2).sum(2)
        log = 0.5 * score + np.log(np.einsum("pii->pi", root)).sum(1) + bodies.log_prior[rows]
        place = likeliest_place(bodies.member[rows], np.exp(log - logsumexp(log, axis=1, keepdims=True)))
        return np.asarray(place @ self._outlook.point[rows])


def _draw(outlook: DetectabilityStudy) -> _Draws:
    random, n = np.random.default_rng(_SEED), (_DRAWS, len(outlook.frequency))
    n_modes, n_channels = len(outlook.reference.frequency), len(outlook.reference.baseline.channels)
    shapes = (n, n, (*n, n_modes), (*n, n_channels), (*n, n_channels))
    return _Draws(*(random.standard_normal(shape) for shape in shapes))


def _signatures(outlook: DetectabilityStudy, mass: float, rows: IndexArray) -> _Signatures:
    """Compute the exact effect of the body, and its derivatives by offsets and a radius of gyration."""
    bodies = outlook.bodies
    std = bodies.prior_std
    theta = np.zeros((len(rows), len(std)))
    theta[:, 0] = mass
    here = _predicted(outlook, theta, rows)
    base = outlook.reference.baseline.shape
    ratios, shapes = [here.log_ratio], [here.shape - base]
    for parameter in range(1, len(std)):
        moved = theta.copy()
        moved[:, parameter] = _STEP * std[parameter]
        there = _predicted(outlook, moved, rows)
        ratios.append((there.log_ratio - here.log_ratio) / _STEP)
        shapes.append((there.shape - here.shape) / _STEP)
    prior = np.ones(len(std))
    prior[0] = (mass / std[0]) ** 2
    return _Signatures(rows, np.array(ratios), np.array(shapes), prior)


def _predicted(outlook: DetectabilityStudy, theta: FloatArray, rows: IndexArray) -> Prediction:
    comparison, effect = outlook.bodies.comparison, outlook.bodies.effect(theta, rows)
    value, vector = picked(reanalyse(comparison, effect))
    return predict(comparison, value, vector, effect)


def _event(base: ModalMean, log_ratio: FloatArray, shape: FloatArray) -> ModalMean:
    """Return the error-free measurement, with the deviations of the baseline."""
    unit = base.shape + shape
    unit = unit / np.linalg.norm(unit, axis=1, keepdims=True)
    return replace(base, log_frequency=base.log_frequency + log_ratio, shape=unit)


def _whitened(data: Comparison, log_ratio: FloatArray, shape: FloatArray) -> FloatArray:
    """Return changes of log ratios (..., n) and shapes (..., n, n_channels) over their errors (..., n_data)."""
    frequency = log_ratio @ data.drifting.matrix.T
    beside = shape - (shape * data.base).sum(-1, keepdims=True) * data.base
    turned = np.einsum("icd,...id->...ic", data.shape_whitener, beside)
    return np.concatenate([frequency, turned.reshape(*frequency.shape[:-1], -1)], axis=-1)


def _variance(data: Comparison) -> FloatArray:
    return np.diag(data.frequency_covariance)


def _covariance(whitener: FloatArray) -> FloatArray:
    lower = np.linalg.inv(whitener)
    return np.asarray(lower @ lower.transpose(0, 2, 1))
