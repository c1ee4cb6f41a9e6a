"""Derivatives of the modes of re-analysed alternatives.

With left vectors M' x: d mu_i = (M' x_i)^T dF (M' x_i) + mu_i x_i^T dM x_i, and the component of d x_i along x_k is
((M' x_k)^T dF (M' x_i) + mu_k x_k^T dM x_i) / (mu_i - mu_k).
"""

from functools import cached_property

import numpy as np

from daq import FloatArray
from updater.reanalysis import Changed, Effect

_Slope = tuple[FloatArray, FloatArray]


class Tangent:
    """Derivatives of the modes picked, d value (..., n_alternatives, n + n_own), d vector (..., n_all, n + n_own)."""

    def __init__(self, changed: Changed, effect: Effect) -> None:
        """Derive at alternatives that an effect changed so."""
        self._changed, self._effect = changed, effect
        n_alternatives, n = changed.pick.shape
        self._at = np.arange(n_alternatives)[:, None], changed.pick, np.arange(n)  # row and column of each mode picked
        pick = changed.pick[:, None, :]
        self._vector, self._weighed = (
            np.take_along_axis(each, pick, axis=2) for each in (changed.vector, changed.weighed)
        )
        gap = np.take_along_axis(changed.value, changed.pick, axis=1)[:, None, :] - changed.value[:, :, None]
        gap[self._at] = np.inf
        self._gap = np.where(gap == 0, np.inf, gap)

    def by(self, mass: FloatArray, flexibility: FloatArray) -> _Slope:
        """Return the derivatives by something of which dM and dF (..., n_alternatives or 1, n_all, n_all) are."""
        changed = self._changed
        numerator = by_mass = np.zeros(self._vector.shape)  # (..., p, k, i)
        if mass.any():
            by_mass = changed.vector.transpose(0, 2, 1) @ (mass @ self._vector)
            numerator = changed.value[:, :, None] * by_mass
        if flexibility.any():
            numerator = numerator + changed.weighed.transpose(0, 2, 1) @ (flexibility @ self._weighed)
        return self._of(numerator, np.broadcast_to(by_mass, numerator.shape))

    def by_compliance(self, compliance: FloatArray) -> _Slope:
        """Return the derivatives by so much of a compliance (n_modes + n_stress, same) everywhere [s2, -]."""
        every, picked = self._with_stress
        return self._of(every.transpose(0, 2, 1) @ (compliance @ picked), np.zeros(self._vector.shape))

    @cached_property
    def _with_stress(self) -> _Slope:
        """Left vectors (n_alternatives, n_modes + n_stress, n_all) with the self-stress they shift, and those picked.

        F = C_mm + C_ms S with S = -(I + C_ss)^-1 C_sm has the derivative [I; S]^T dC [I; S].
        """
        n, shifted = self._effect.mass.shape[1], self._effect.shifted
        both = [
            np.concatenate([each[:, :n], shifted @ each[:, :n]], axis=1)
            for each in (self._changed.weighed, self._weighed)
        ]
        return both[0], both[1]

    def _of(self, numerator: FloatArray, by_mass: FloatArray) -> _Slope:
        picked = (..., *self._at)
        component = numerator / self._gap
        component[picked] = -0.5 * by_mass[picked]
        return numerator[picked], self._changed.vector @ component
