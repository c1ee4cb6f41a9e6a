"""Model parameters as causes, with and without exact derivatives, for tests of these."""

import numpy as np

from daq import FloatArray
from updater.causes.model.parameters import ModelParameters


class Moved(ModelParameters):
    """Fits begin half a deviation from the file's values."""

    @property
    def start(self) -> FloatArray:
        return np.maximum(0.5 * self.prior_std, self.lower)


class Differenced(Moved):
    """Nothing is known of the derivatives."""

    def compliance_increments(self, theta: FloatArray) -> dict[int, tuple[FloatArray, FloatArray]]:
        return {}
