"""A sensor at rest."""

import numpy as np

from daq import IntArray


class AtRest:
    """Gravity along z, in counts, with noise of one count."""

    def __init__(self, gravity: int) -> None:
        self._gravity = gravity

    def start(self, time: int, rate: float) -> None:
        """Begin."""

    def read(self, index: int, n: int) -> IntArray:
        """Return counts (n, 3)."""
        noise = np.random.default_rng(index).normal(0, 1, (n, 3))
        return np.asarray(np.rint(noise + np.array([0, 0, self._gravity])), np.int32)
