"""Levels of blocks of signals, learned while the structure is calm."""

import numpy as np

from daq import FloatArray
from monitor.results.windows import WindowResult

_LEAST_LEVELS = 60  # blocks before a deviation is computed
# Least standard deviation of a level. Residuals: below that of noise at all 0.4 * 2048 lines of the longest block,
# 0.5 / sqrt(819) = 0.017. Innovations: below that of the cube root of a mean power of n lines, 1 / (3 sqrt(n)), for
# n < 1111.
_LEAST_STD = 0.01


class CalmLevels:
    """Mean and standard deviation of levels, with exponential memory; the newest are held.

    Parameters
    ----------
    n : number of levels of a block
    memory : number of blocks over which older ones are forgotten
    """

    def __init__(self, n: int, memory: float) -> None:
        self._kept = 1 - 1 / memory
        self._weight = 0.0
        self._sum, self._square = np.zeros((2, n))
        self._held: list[FloatArray] = []
        self._pending: list[FloatArray] = []

    def add(self, level: FloatArray) -> None:
        """Add the levels (n,) of a block, which are not learned yet."""
        self._pending.append(level)

    def learn(self) -> None:
        """Learn the levels that were added before the last call, and hold those added since."""
        for level in self._held:
            self._weight = self._kept * self._weight + 1
            self._sum = self._kept * self._sum + level
            self._square = self._kept * self._square + level**2
        self._held, self._pending = self._pending, []

    def discard(self) -> None:
        """Discard the levels that are not learned yet."""
        self._held, self._pending = [], []

    @property
    def n_blocks(self) -> float:
        """Number of blocks that are learned, older ones with less weight."""
        return self._weight

    @property
    def known(self) -> bool:
        """True once a deviation can be computed."""
        return self._weight >= _LEAST_LEVELS

    @property
    def mean(self) -> FloatArray:
        """Mean (n,)."""
        return np.asarray(self._sum / self._weight)

    @property
    def std(self) -> FloatArray:
        """Standard deviation from block to block (n,)."""
        return np.asarray(np.sqrt(np.maximum(self._square / self._weight - self.mean**2, _LEAST_STD**2)))


def is_calm(window: WindowResult) -> bool:
    """Return whether a window belongs to the baseline, or is consistent with it."""
    if window.problem or window.phase == "alarm":
        return False
    return window.phase == "learning" or (window.novelty is not None and not window.novelty.level > 1)
