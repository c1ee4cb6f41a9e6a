"""The SYNC frames of a CAN bus as one clock of all nodes that sample on them (CiA 301, section 7.2.5).

SYNC frames have no number; scans have the counter of their node. On the bus, each scan follows its SYNC. The host
receives both. It numbers every SYNC, and assigns to each scan the number of its SYNC.
"""

import numpy as np

from daq.drivers.can.bus import Chunk
from daq.protocol.epson_can import MODULUS, SYNC
from daq.types import IndexArray, IntArray

_PAUSE = 0.5e9  # pause without SYNC, longer than a delayed read, after which sampling has restarted [ns]
_MIN_SPAN = 0.5e9  # span of SYNC from which the period is estimated [ns]
_OFF_READS = 5  # consecutive reads whose scans do not match their SYNC


class SyncCount:
    """Numbers of the SYNC frames of one bus during the life of the process.

    After a restart (of the host's side of the bus, of the producer, or after a pause) `clock` has another name, and the
    numbers continue by the clock of the host.

    Parameters
    ----------
    name : of the bus
    """

    def __init__(self, name: str) -> None:
        self._name, self._starts = name, 0
        self.number = 0  #: of the last SYNC
        self._restart = True
        self._first: tuple[int, int] | None = None  # (number, time [ns]) of this start's first SYNC
        self._last = 0  # time of the last one [ns]

    @property
    def clock(self) -> str:
        """Name of the clock of the numbers."""
        return f"{self._name} {self._starts}"

    def restart(self) -> None:
        """Mark that later frames are not related to earlier ones."""
        self._restart = True

    def count(self, chunk: Chunk, rate: float) -> IndexArray:
        """Take the next frames of the bus; return the number of the last SYNC before each (n,).

        Parameters
        ----------
        chunk : frames
        rate : of SYNC [Hz]
        """
        passed = np.cumsum(chunk.frames.ids == SYNC)
        if len(passed) and passed[-1]:
            self._go_on(int(passed[-1]), chunk.arrived, rate)
            self.number += int(passed[-1])
            self._first = self._first or (self.number, chunk.arrived)
            self._last = chunk.arrived
            return np.asarray(self.number - passed[-1] + passed, np.intp)
        return np.full(len(passed), self.number, np.intp)

    def _go_on(self, n: int, arrived: int, rate: float) -> None:
        """Restart the numbers if `n` new SYNC frames do not continue the previous ones."""
        if self._first is None:
            self._starts, self._restart = self._starts + 1, False
            return
        period, since = self._period(self._first, rate), arrived - self._last
        if self._restart or since - n * period > _PAUSE:
            self.number += max(0, round(since / period) - n)
            self._starts, self._restart, self._first = self._starts + 1, False, None

    def _period(self, first: tuple[int, int], rate: float) -> float:
        """Return the time between two SYNC [ns of the host]: as this start has shown it, until then the nominal one."""
        span = self._last - first[1]
        return span / (self.number - first[0]) if span > _MIN_SPAN else 1e9 / rate


class SyncedCounter:
    """From one node's counter to the number of the SYNC that each scan was taken on, from one start to the next.

    The two numbers differ by a constant. It is determined from most scans of the first read, because on a full bus a
    frame may arrive after the next SYNC.
    """

    def __init__(self) -> None:
        self._offset: int | None = None
        self._off_reads = 0

    def numbers(self, counter: IntArray, syncs: IndexArray) -> IndexArray:
        """Return numbers (n,) from counter (n,) and the last SYNC received before each scan (n,).

        Raises
        ------
        ValueError
            If scans do not fit SYNC for several reads: SYNC frames were lost on the way to the host.
        """
        apart = np.remainder(syncs - counter, MODULUS)
        if self._offset is None:
            self._offset = _most_frequent(apart)
        off = np.remainder(self._offset - apart + MODULUS // 2, MODULUS) - MODULUS // 2
        self._off_reads = self._off_reads + 1 if _most_frequent(off) else 0
        if self._off_reads >= _OFF_READS:
            raise ValueError(f"its scans and SYNC are {_most_frequent(off)} apart: SYNC frames were lost")
        return np.asarray(syncs + off, np.intp)


def _most_frequent(values: IndexArray) -> int:
    found, times = np.unique(values, return_counts=True)
    return int(found[np.argmax(times)])
