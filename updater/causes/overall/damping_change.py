"""Damping has changed, of all modes alike or of one; frequencies and shapes have not.

Friction in a loose bolt, a damper, attached objects, wind. The beam model has no damping, so that the extended
structure is the same structure.
"""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause, Discrete
from updater.inference import Comparison, Effect, Fit, no_effect
from updater.quantities import Quantity
from updater.reference import Reference
from updater.structure import Structure

_STD = 0.7  # of the factor's logarithm: half to twice the damping
_ALL = 0.5  # prior probability that it is all modes


@dataclass(frozen=True, eq=False, kw_only=True)
class DampingChange(Discrete):
    """Alternatives are all modes and each by itself; the parameter is the logarithm of the factor."""

    chosen: FloatArray  #: (n_alternatives, n) 1 for the modes that each alternative changes
    name: str = "damping_change"
    place_free: bool = True
    advice: str = "Look for rubbing or loose parts. Record again at another amplitude and in other weather."

    @property
    def log_prior(self) -> FloatArray:
        """All modes with probability a half, each by itself alike."""
        n = len(self.chosen) - 1
        return np.asarray(np.log(np.append(_ALL, np.full(n, (1 - _ALL) / n))))

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return changes of log damping."""
        log_damping = np.zeros((len(rows), len(self.comparison.frequency)))
        log_damping[:, self.comparison.paired] = theta * self.chosen[rows]
        return replace(no_effect(len(rows), self.comparison), log_damping=log_damping)

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the factor, and the mode's frequency if it is one mode only."""
        factor = float(np.exp(fit.theta[fit.best, 0]))
        found = {"factor": Quantity(value=factor, std=factor * float(fit.covariance[fit.best, 0, 0] ** 0.5), unit="-")}
        if fit.best:
            data, mode = self.comparison, int(np.argmax(self.chosen[fit.best]))
            frequency = float(data.frequency[data.paired[mode]] * np.exp(data.log_ratio[mode]))
            std = frequency * float(data.log_frequency_std[mode])
            found["frequency"] = Quantity(value=frequency, std=std, unit="Hz")
        return found

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Return the same structure: its model has no damping."""
        del row, theta
        return structure


def propose_damping_change(reference: Reference, comparison: Comparison) -> DampingChange | None:
    """Return all modes and each with known damping before and now; None if there are fewer than two."""
    del reference
    known = comparison.damping_weight > 0
    if known.sum() < 2:
        return None
    single = np.eye(len(known))[known]
    chosen = np.concatenate([known[None].astype(float), single])
    return DampingChange(
        prior_std=np.array([_STD]),
        lower=np.full((len(chosen), 1), -np.inf),
        comparison=comparison,
        chosen=chosen,
    )
