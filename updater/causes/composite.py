"""One free cause fitted jointly with causes at fixed alternatives; joint prediction of selected causes."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, Generic, Self, TypeVar

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause, Discrete, MayOpen
from updater.inference import (
    Comparison,
    Effect,
    Fit,
    LinearInCompliance,
    Prediction,
    Rescaled,
    effects_of,
    picked,
    predict,
    reanalyse,
)

C = TypeVar("C", bound=Cause)


@dataclass(frozen=True, eq=False)
class SelectedCause:
    """One alternative of a cause with its parameters."""

    cause: Cause
    row: int
    theta: FloatArray  #: (n_parameters,)

    @classmethod
    def begun(cls, cause: Cause) -> Self:
        """Return the first alternative of a cause with all parameters zero, from which a joint fit begins."""
        return cls(cause, 0, np.zeros(len(cause.prior_std)))

    @property
    def alternative(self) -> Hashable:
        """Name, prior and effect of a unit of each parameter: equal for the same alternative of grids that differ."""
        effect = self.cause.effect(self.cause.prior_std[None], np.array([self.row]))
        prior = float(self.cause.log_prior[self.row])
        return self.cause.name, prior, *(values.tobytes() for values in vars(effect).values())


@dataclass(frozen=True, eq=False)
class JointHypothesis(Generic[C]):
    """The alternatives of `free`, each together with the chosen ones; parameters are those of `free` first."""

    free: C
    chosen: tuple[SelectedCause, ...]
    start_neutral: bool = False  #: whether a cause with a position starts without effect

    @property
    def prior_std(self) -> FloatArray:
        """Prior standard deviations of the parameters of all causes (n_parameters,)."""
        return np.concatenate([self.free.prior_std, *(c.cause.prior_std for c in self.chosen)])

    @property
    def lower(self) -> FloatArray:
        """Lower bounds of the parameters of all causes (n_alternatives, n_parameters)."""
        return self._beside(self.free.lower, [c.cause.lower[c.row] for c in self.chosen])

    @property
    def start(self) -> FloatArray:
        """Start of the parameters of all causes: the chosen ones start from their present values."""
        return self._beside(
            self.free.neutral_start if self.start_neutral else self.free.start, [c.theta for c in self.chosen]
        )

    def _beside(self, own: FloatArray, others: list[FloatArray]) -> FloatArray:
        return np.concatenate([own, *(np.tile(other, (len(own), 1)) for other in others)], axis=1)

    @property
    def log_prior(self) -> FloatArray:
        """Sum of the log priors of the alternative and the chosen ones; -inf if both change the same part."""
        own = np.array(self.free.log_prior)
        for c in self.chosen:
            if (
                isinstance(self.free, Discrete)
                and isinstance(c.cause, type(self.free))
                and c.cause.name == self.free.name
            ):
                own[self.free.repeats(c.cause, c.row)] = -np.inf
        return np.asarray(own + sum(float(c.cause.log_prior[c.row]) for c in self.chosen))

    @property
    def drifting(self) -> bool:
        """True if one of the causes allows a drift of all frequencies."""
        return self.free.drifting or any(c.cause.drifting for c in self.chosen)

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return all effects together."""
        return self.joined(effects_of(self.parts(rows), theta))

    def parts(self, rows: IndexArray) -> list[tuple[Cause, slice, IndexArray]]:
        """Return each cause with the columns of its parameters and its alternatives, the free one first."""
        others = [(c.cause, own, np.full(len(rows), c.row)) for c, own in self._columns()]
        return [(self.free, slice(0, len(self.free.prior_std)), rows), *others]

    def joined(self, effects: Sequence[Effect]) -> Effect:
        """Return effects together; the channels read the free cause's effect last."""
        return reduce(lambda found, other: other.then(found), effects)

    def _columns(self) -> Iterator[tuple[SelectedCause, slice]]:
        """Yield each chosen cause with the columns of its parameters."""
        at = len(self.free.prior_std)
        for c in self.chosen:
            own = slice(at, at + len(c.cause.prior_std))
            yield c, own
            at = own.stop

    def compliance_increments(self, theta: FloatArray) -> Mapping[int, tuple[FloatArray, FloatArray]]:
        """Return the compliance increments of the chosen causes."""
        return {
            own.start + k: each
            for c, own in self._columns()
            if isinstance(c.cause, LinearInCompliance)
            for k, each in c.cause.compliance_increments(theta[:, own]).items()
        }

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the sum of the log ratios of all causes, each by its own parameters.

        The evidence of the signals is for one place that opens and closes: of several losses the largest counts.
        """
        found, opening = np.zeros(len(rows)), list[FloatArray]()
        for cause, own, number in self.parts(rows):
            found += cause.log_ratio(theta[:, own], covariance[:, own, own], number)
            if isinstance(cause, MayOpen):
                opening.append(cause.opening(theta[:, own], number))
        return found + np.max(opening, axis=0) - np.sum(opening, axis=0) if opening else found

    def refined(self, log_density: FloatArray, theta: FloatArray) -> "JointHypothesis[C] | None":
        """Refine the free one."""
        closer = self.free.refined(self._allowed(log_density), theta[:, : len(self.free.prior_std)])
        return None if closer is None else replace(self, free=closer, start_neutral=False)

    def rescaled(self, log_density: FloatArray, theta: FloatArray) -> "JointHypothesis[C] | None":
        """Rescale the free one."""
        if not isinstance(self.free, Rescaled):
            return None
        closer = self.free.rescaled(self._allowed(log_density), theta[:, : len(self.free.prior_std)])
        return None if closer is None else replace(self, free=closer, start_neutral=False)

    def _allowed(self, log_density: FloatArray) -> FloatArray:
        """Return log densities without those of alternatives that another cause excludes."""
        return np.where(np.isneginf(self.log_prior), -np.inf, log_density)

    def of_free(self, fit: "Fit[JointHypothesis[C]]") -> Fit[C]:
        """Return the fit of the free cause alone, the others' uncertainty included."""
        n = len(self.free.prior_std)
        return Fit(
            hypotheses=self.free,
            theta=fit.theta[:, :n],
            covariance=fit.covariance[:, :n, :n],
            chi_square=fit.chi_square,
            log_density=fit.log_density,
            freedom=fit.freedom,
            frequency_residual=fit.frequency_residual,
        )

    def best(self, fit: "Fit[JointHypothesis[C]]") -> tuple[SelectedCause, ...]:
        """Return the best alternatives of all causes, the free one first."""
        theta = fit.theta[fit.best]
        own = SelectedCause(self.free, fit.best, theta[: len(self.free.prior_std)])
        return own, *(replace(c, theta=theta[columns]) for c, columns in self._columns())


def joint_opening(part: Fit[Any], others: Sequence[Fit[Any]]) -> FloatArray:
    """Return the log likelihood ratio of the signals (n,) [-] that the density of each alternative of a fit contains.

    It is the ratio for a loss of stiffness that opens and closes; of several such causes the largest counts.

    Parameters
    ----------
    part : fit of one cause (n alternatives)
    others : fits of the other causes of the same joint fit
    """
    n = len(part.theta)
    found = [
        np.broadcast_to(one.hypotheses.opening(one.theta[rows], rows), n)
        for one, rows in [(part, np.arange(n)), *((other, np.array([other.best])) for other in others)]
        if isinstance(one.hypotheses, MayOpen)
    ]
    return np.max(found, axis=0) if found else np.zeros(n)


def prediction(data: Comparison, chosen: Sequence[SelectedCause] | None) -> Prediction:
    """Return the prediction of one alternative, chosen causes together; without causes, the modes before."""
    if not chosen:
        nothing = np.zeros((1, len(data.log_ratio)))
        nobody = np.empty((1, 0, data.base.shape[1]))
        value, vector = (2 * np.pi * data.frequency) ** -2.0, np.eye(len(data.frequency))
        with_mass = tuple(
            test.predict(value[None, data.paired], vector[None, :, data.paired]) for test in data.mass_tests
        )
        ratio, shape = (data.nominal.log_ratio[None], data.nominal.shape) if data.nominal else (nothing, data.base)
        return Prediction(
            ratio, shape[None], data.baseline_imaginary[None], nothing, nobody[:, :, 0], nobody, with_mass=with_mass
        )
    effect = effect_of(chosen)
    return predict(data, *picked(reanalyse(data, effect)), effect)


def effect_of(chosen: Sequence[SelectedCause]) -> Effect:
    """Return the joint effect of chosen causes, as one alternative."""
    together = JointHypothesis(chosen[0].cause, tuple(chosen[1:]))
    return together.effect(np.concatenate([c.theta for c in chosen])[None], np.array([chosen[0].row]))


def mac_of(data: Comparison, shape: FloatArray) -> FloatArray:
    """Return the modal assurance criterion (n_modes,) [-] of measured and other shapes; NaN if not measured.

    Parameters
    ----------
    data : with the measured shapes
    shape : (n_modes, n_channels) others, one per measured mode [-]
    """
    mac = (data.shape * shape).sum(1) ** 2 / (shape**2).sum(1)
    return np.where(data.shaped, mac, np.nan)
