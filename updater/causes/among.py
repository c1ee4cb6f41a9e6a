"""One mass at any position, beside others that are known about."""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.added_mass import AddedMass
from updater.causes.bodies import Bodies
from updater.reanalysis import Effect


@dataclass(frozen=True, eq=False, kw_only=True)
class Among:
    """One mass at any position, beside others that stay near where they are; all parameters are fitted together."""

    free: AddedMass
    others: Bodies  #: one alternative

    @property
    def prior_std(self) -> FloatArray:
        """Of all, those of the free mass first."""
        return np.concatenate([self.free.prior_std, self.others.prior_std])

    @property
    def lower(self) -> FloatArray:
        """Of all."""
        return self._beside(self.free.lower, self.others.lower)

    @property
    def start(self) -> FloatArray:
        """Of all."""
        return self._beside(self.free.start, self.others.start)

    def _beside(self, own: FloatArray, others: FloatArray) -> FloatArray:
        return np.concatenate([own, np.tile(others, (len(own), 1))], axis=1)

    @property
    def log_prior(self) -> FloatArray:
        """Of the free mass."""
        return self.free.log_prior

    @property
    def drifting(self) -> bool:
        """As with one mass."""
        return self.free.drifting

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return all masses together."""
        n = len(self.free.prior_std)
        others = self.others.effect(theta[:, n:], np.zeros(len(rows), np.intp))
        return self.free.effect(theta[:, :n], rows).then(others)

    def log_ratio(self, theta: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return those of all masses together."""
        n = len(self.free.prior_std)
        of_free = self.free.log_ratio(theta[:, :n], covariance[:, :n, :n])
        return of_free + self.others.log_ratio(theta[:, n:], covariance[:, n:, n:])

    def finer(self, log_density: FloatArray, theta: FloatArray) -> "Among | None":
        """Refine the free mass."""
        closer = self.free.finer(log_density, theta[:, : len(self.free.prior_std)])
        return None if closer is None else replace(self, free=closer)
