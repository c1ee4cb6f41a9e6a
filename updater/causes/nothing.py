"""Nothing has changed: the hypothesis that every cause must beat."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from updater.comparison import Comparison
from updater.reanalysis import Effect, no_effect


@dataclass(frozen=True, eq=False, kw_only=True)
class Nothing:
    """One alternative without parameters."""

    comparison: Comparison
    drifting: bool = False

    @property
    def prior_std(self) -> FloatArray:
        """No parameters."""
        return np.zeros(0)

    @property
    def lower(self) -> FloatArray:
        """No parameters."""
        return np.zeros((1, 0))

    @property
    def start(self) -> FloatArray:
        """No parameters."""
        return np.zeros((1, 0))

    @property
    def log_prior(self) -> FloatArray:
        """One alternative."""
        return np.zeros(1)

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return none."""
        del theta
        return no_effect(len(rows), self.comparison)

    def log_ratio(self, theta: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return zeros (n_alternatives,): the prior is Gaussian."""
        del covariance
        return np.zeros(len(theta))

    def finer(self, log_density: FloatArray, theta: FloatArray) -> None:
        """There is nothing to refine."""
        del log_density, theta
