"""Numbers of scans that have no counter, from time stamps by the clock of their device."""

import math

import numpy as np

from daq.types import FloatArray, IndexArray

_GAIN = 0.05  # of the phase, per scan: jitter is averaged over 20 scans


class StampCount:
    """Counts periods between time stamps.

    The number of a scan is the nearest whole number of periods since the first one. The phase follows the stamps of
    scans that continue the previous one, so that neither their jitter, below half a period, nor an error of the rate,
    up to about 2 %, adds up. A single false stamp gives a single false number.

    Parameters
    ----------
    rate : scans a second by the clock of the device [Hz]
    wrap : after which that clock begins again [s]
    most : longest step between two scans of which one continues the other [scans]
    """

    def __init__(self, rate: float, *, wrap: float = math.inf, most: int = 8) -> None:
        self._rate, self._wrap, self._most = rate, wrap, most
        self._reference: float | None = None  # time of the scan `_number` without jitter [s]
        self._number = self._previous = 0

    def numbers(self, time: FloatArray) -> IndexArray:
        """Return the numbers (n,) of the next scans by their stamps (n,) [s]."""
        return np.array([self._next(stamp) for stamp in time.tolist()], np.intp)

    def _next(self, stamp: float) -> int:
        if self._reference is None:
            self._reference = stamp
        passed = stamp - self._reference
        if math.isfinite(self._wrap):
            passed = (passed + self._wrap / 2) % self._wrap - self._wrap / 2
        periods = passed * self._rate
        step = round(periods)
        number = self._number + step
        if 1 <= number - self._previous <= self._most:
            self._reference += (step + _GAIN * (periods - step)) / self._rate
            self._number = number
        self._previous = number
        return number
