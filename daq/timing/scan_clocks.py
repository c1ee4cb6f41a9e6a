"""Sampling times of single scans for viewers: devices that share a clock get one time per index.

A clock is fitted again with every block, so the time of a scan depends on when it is evaluated. Here each second of a
clock is evaluated once, and times in between are interpolated linearly.
"""

import numpy as np

from daq.timing.clock_fit import ClockFit
from daq.types import Block, Flag, IndexArray

_KEPT = 64  # seconds of a clock, and shared clocks, that are kept: more than lie between the first and the last use


class ScanClock:
    """Times of scans by one clock, from one start to the next.

    Parameters
    ----------
    rate : nominal scans per second [Hz]
    """

    def __init__(self, rate: float) -> None:
        self._fit, self._spacing = ClockFit(rate), max(1, round(rate))
        self._known: dict[int, int] = {}  # second, by its number -> time of its first scan [ns UTC]

    def add(self, block: Block) -> None:
        """Add the (index, time) pair of a block."""
        self._fit.add(block.arrival_index, block.arrival_time)

    def times(self, index: IndexArray) -> IndexArray:
        """Return times [ns UTC] of scans by their indices (n,); they ascend where these do, also across gaps."""
        second, within = np.divmod(index, self._spacing)
        numbers = np.unique(np.concatenate((second, second + 1)))
        known = np.array([self._time(int(number)) for number in numbers], np.int64)
        place = np.searchsorted(numbers, second)  # the next number is the next second
        begin = known[place]
        return np.asarray(begin + within * (known[place + 1] - begin) // self._spacing, np.intp)

    def _time(self, number: int) -> int:
        known = self._known.get(number)
        if known is not None:
            return known
        time = self._fit.time_at(number * self._spacing)
        before, behind = self._known.get(number - 1), self._known.get(number + 1)
        if before is not None:
            time = max(time, before + self._spacing)
        if behind is not None:
            time = min(time, behind - self._spacing)
        self._known[number] = time
        if len(self._known) > _KEPT:
            del self._known[next(iter(self._known))]
        return time


class ScanClocks:
    """The clocks of a run's devices: each its own, from one start to the next, or one that they share."""

    def __init__(self) -> None:
        self._own: dict[str, ScanClock] = {}
        self._ends: dict[str, int] = {}  # device -> index after its last block
        self._shared: dict[str, ScanClock] = {}

    def add(self, block: Block) -> ScanClock:
        """Add a block, those of each device in order; return the clock of its indices."""
        if block.clock:
            clock = self._shared.setdefault(block.clock, ScanClock(block.rate))
            if len(self._shared) > _KEPT:
                del self._shared[next(iter(self._shared))]
        else:
            if block.flags & Flag.RESTARTED or block.first_index < self._ends.get(block.device, 0):
                self._own.pop(block.device, None)  # restarted, also in a block that did not arrive
            self._ends[block.device] = block.end_index
            if block.device not in self._own:
                self._own[block.device] = ScanClock(block.rate)
            clock = self._own[block.device]
        clock.add(block)
        return clock
