"""Check that a device sends at the expected rate, from arrival times that may be seconds late."""

from daq.timing.host_clock import HostClock
from daq.types import Block, Flag

_PART_SECONDS = 20.0  # of wall time
_TOLERANCE = 0.05  # of the rate: far more than a clock is off


class RateCheck:
    """Reports once that a device does not send at the expected rate.

    A device whose rate cannot be set, or that ignores it, would shift all frequencies by the same ratio.

    A host that has no processor for seconds takes scans late, never early. So of each 20 s only the promptest arrival
    counts, and three such parts must agree: at another rate each is later, or earlier, than the one before; by a host
    that was busy for all of a part it is later and then earlier.

    Parameters
    ----------
    rate : expected, scans a second [Hz]
    clock : of the host
    """

    def __init__(self, rate: float, clock: HostClock) -> None:
        self._rate, self._length = rate, round(_PART_SECONDS * clock.speed * 1e9)  # [ns of data]
        self._promptest: list[tuple[int, int]] = []  # (index, time) of each part
        self._ends = 0  # the last of them [ns UTC]
        self._told = False

    def differs(self, block: Block) -> float | None:
        """Return the rate found [Hz] if it is another one."""
        pair = block.arrival_index, block.arrival_time
        if block.flags & Flag.RESTARTED or not self._promptest or pair[1] >= self._ends + self._length:
            self._promptest, self._ends = [pair], pair[1] + self._length
        elif pair[1] < self._ends:
            self._promptest[-1] = min(self._promptest[-1], pair, key=self._lateness)
        else:
            found = self._found()
            self._promptest, self._ends = [*self._promptest[-2:], pair], self._ends + self._length
            return found
        return None

    def _found(self) -> float | None:
        if self._told or len(self._promptest) < 3:
            return None
        first, middle, last = (self._lateness(pair) for pair in self._promptest)
        later = (middle - first) / self._length, (last - middle) / self._length  # each 1 - found / expected
        self._told = min(later) > _TOLERANCE or max(later) < -_TOLERANCE
        (index, time), (last_index, last_time) = self._promptest[0], self._promptest[-1]
        return 1e9 * (last_index - index) / (last_time - time) if self._told else None

    def _lateness(self, pair: tuple[int, int]) -> float:
        return pair[1] - 1e9 * pair[0] / self._rate
