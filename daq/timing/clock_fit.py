"""Device ticks to UTC: counters unwrapped, and the line that arrival times cannot beat.

A scan can only arrive late. So the device's clock is the lower envelope of (arrival - index/rate): its level is the
fastest arrival, its slope the drift of the device's oscillator (DEVICES of many makes drift by up to 100 ppm).
"""

from collections import deque

import numpy as np

from daq.types import FloatArray, IndexArray

_SPAN = 120.0  # s of data that the envelope looks back on
_MIN_FOR_DRIFT = 30.0  # s before a slope is fitted
_LARGEST_DRIFT = 200e-6
_BIN = 1.0  # s: one pair, the earliest, is kept of each


def unwrap(counter: IndexArray, expected: int, modulus: int = 1 << 16) -> IndexArray:
    """Return indices (n,) nearest to the expected one, from counters (n,) that wrap at `modulus`.

    Each is found by itself: a false counter does not move those after it.

    Parameters
    ----------
    counter : (n,)
    expected : index that the host's clock expects, right within half of `modulus`: it decides how often a counter
        wrapped in a gap
    """
    half = modulus // 2
    return np.asarray(expected - half + np.remainder(counter - expected + half, modulus), np.intp)


class ClockFit:
    """Time of a device's scans from the (index, arrival time) pairs seen so far; depends on nothing else.

    Parameters
    ----------
    rate : nominal scans per second [Hz]
    """

    def __init__(self, rate: float) -> None:
        self._rate, self._scans = rate, max(int(_BIN * rate), 1)  # scans: of a bin
        self._pairs: deque[tuple[int, int]] = deque()  # (index, lateness [ns]) of the earliest arrival of each second
        self._origin: int | None = None  # arrival of index 0 at the nominal rate [ns UTC]
        self._line: tuple[float, float] | None = None  # fit of the present pairs, once requested

    @property
    def span(self) -> float:
        """Length of the data of the fit [s]."""
        return (self._pairs[-1][0] - self._pairs[0][0]) / self._rate if self._pairs else 0.0

    def add(self, index: int, time: int) -> None:
        """Add one pair: a scan and the time by which it had arrived [ns UTC]."""
        if self._origin is None:
            self._origin = time - round(index / self._rate * 1e9)
        late, pairs = time - self._origin - round(index / self._rate * 1e9), self._pairs
        same = pairs and index // self._scans == pairs[-1][0] // self._scans
        if not same or late < pairs[-1][1]:
            if same:
                pairs.pop()
            pairs.append((index, late))
            self._line = None
        while (index - pairs[0][0]) / self._rate > _SPAN:
            pairs.popleft()
            self._line = None

    def line(self) -> tuple[float, float, int]:
        """Return (delay at index 0 [ns], drift [ns per scan], origin [ns UTC]).

        Raises
        ------
        ValueError
            Before the first pair.
        """
        if self._origin is None:
            raise ValueError("clock fit: expected at least one (index, time) pair, found none")
        if self._line is None:
            index = np.array([p[0] for p in self._pairs], float)
            late = np.array([p[1] for p in self._pairs], float)
            slope = self._slope(index, late)
            self._line = float((late - slope * index).min()), slope
        return *self._line, self._origin

    def _slope(self, index: FloatArray, late: FloatArray) -> float:
        """Return the drift of the lower envelope: blind to late arrivals, zero until there is enough data."""
        if self.span < _MIN_FOR_DRIFT:
            return 0.0
        slope = 0.0
        middle = index.mean()
        limit = _LARGEST_DRIFT * 1e9 / self._rate
        for _ in range(20):  # the line that touches the envelope on both sides of its middle
            rest = late - slope * index
            left, right = (np.flatnonzero(side) for side in (index <= middle, index > middle))
            a, b = left[np.argmin(rest[left])], right[np.argmin(rest[right])]
            new = float(np.clip((late[b] - late[a]) / (index[b] - index[a]), -limit, limit))
            if new == slope:
                break
            slope = new
        return slope

    def index_at(self, time: int) -> tuple[float, float]:
        """Return the (fractional) index at a time [ns UTC], and scans per second of UTC there."""
        late, slope, origin = self.line()
        period = 1e9 / self._rate + slope
        return (time - origin - late) / period, 1e9 / period

    def time_at(self, index: int) -> int:
        """Return the time of a scan [ns UTC]."""
        late, slope, origin = self.line()
        return origin + round(late + slope * index + index / self._rate * 1e9)
