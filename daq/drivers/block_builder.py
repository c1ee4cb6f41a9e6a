"""Blocks out of scans: counters unwrapped, gaps exact, false counters harmless."""

from collections.abc import Iterator

import numpy as np

from daq.drivers.base import Scans
from daq.timing.clock_fit import unwrap
from daq.types import Block, Flag, IndexArray, IntArray


class BlockBuilder:
    """Cuts scans into blocks: no gap inside, the earliest arrival as the (counter, host time) pair.

    A damaged frame has a valid checksum once in 2^16. A false counter then costs only the adjacent scans. Only reads
    that continue the previous one are used for the time.
    """

    def __init__(self, device: str, rate: float, scale: float, modulus: int, n_scans: int) -> None:
        self._device, self._rate, self._scale, self._modulus, self._n_scans = device, rate, scale, modulus, n_scans
        self._next = 0  # next index of a stream without a gap
        self._offset = 0  # from counters to indices, modulo the modulus
        self._anchor: tuple[int, int] | None = None  # (index, time) of the last read without a gap
        self._counts: list[IntArray] = []
        self._first = self._have = 0
        self._pair: tuple[int, int] | None = None
        self._temperature = float("nan")
        self._flags = Flag.NONE
        self._clock = ""  # that is shared, if one is: then counters are indices

    def restart(self, now: int) -> None:
        """Note that the counter has restarted, after `flush`; indices continue by the host's or the shared clock."""
        if self._anchor is not None and not self._clock:
            elapsed = round((now - self._anchor[1]) * 1e-9 * self._rate)
            self._next = max(self._next, self._anchor[0] + elapsed) + 1
        self._anchor = None
        self._flags = Flag.RESTARTED

    def continue_from(self, before: "BlockBuilder", now: int) -> None:
        """Begin where another reader of the same device and rate has ended, if it has read anything."""
        if before._anchor is not None:
            self._next, self._anchor, self._clock = before._next, before._anchor, before._clock
            self.restart(now)

    def add(self, scans: Scans, now: int) -> Iterator[Block]:
        """Add the scans that were read until `now` [ns UTC]; yield full blocks."""
        if scans.bad_bytes:
            self._flags |= Flag.BAD_FRAMES
        if not len(scans.counts):
            return
        if scans.clock != self._clock:
            yield from self._change_clock(scans.clock, int(scans.counter[0]), now)
        expected = self._expected(scans, now)
        index = self._index(scans.counter, expected)
        kept = _in_order(index, self._next)
        index = index[kept]
        if not len(index):
            return
        last = int(index[-1])
        whole = int(index[0]) == self._next and last == self._next + len(index) - 1
        yield from self._append_runs(index, scans.counts[kept], now)
        self._temperature = scans.temperature
        if self._anchor is None or (whole and abs(last - expected) < self._modulus // 4):
            self._anchor = last, now
            self._consider_pair(*self._anchor)
        if self._have + len(index) // 2 >= self._n_scans:  # one more read like this one would make it too long
            yield from self.flush(now)

    def _change_clock(self, clock: str, first: int, now: int) -> Iterator[Block]:
        """Continue by a shared clock, which is another one after a restart of sampling."""
        yield from self.flush(now)
        if self._clock:
            self._flags |= Flag.RESTARTED
        self._clock, self._anchor, self._offset = clock, None, 0
        self._next = max(self._next, first)

    def _expected(self, scans: Scans, now: int) -> int:
        """Return the index of a read's last scan by the host's clock, or by the one that is shared."""
        if self._clock:
            return int(scans.counter[-1])
        if self._anchor is None:
            self._offset = self._next - int(scans.counter[0])
            return self._next + len(scans.counter) - 1
        return self._anchor[0] + round((now - self._anchor[1]) * 1e-9 * self._rate)

    def _index(self, counter: IntArray | IndexArray, expected: int) -> IndexArray:
        """Return indices: by the counter without a gap, whatever the delay; after a gap nearest to the expected one."""
        raw = counter.astype(np.intp) + self._offset
        if self._clock:
            return raw
        onward = self._next + np.arange(len(raw))
        gap = np.flatnonzero((raw - onward) % self._modulus)
        if not len(gap):
            return onward
        index = unwrap(raw, expected, self._modulus)
        index[: gap[0]] = onward[: gap[0]]
        return index

    def _append_runs(self, index: IndexArray, counts: IntArray, now: int) -> Iterator[Block]:
        """Add scans with ascending indices and possible gaps."""
        if int(index[-1]) - int(index[0]) == len(index) - 1:
            yield from self._append(int(index[0]), counts, now)
            return
        for run in np.split(np.arange(len(index)), np.flatnonzero(np.diff(index) != 1) + 1):
            yield from self._append(int(index[run[0]]), counts[run], now)

    def _append(self, first: int, counts: IntArray, now: int) -> Iterator[Block]:
        if first != self._next:
            yield from self.flush(now)
            self._flags |= Flag.AFTER_GAP
        if not self._have:
            self._first = first
        self._counts.append(counts)
        self._have += len(counts)
        self._next = first + len(counts)

    def _consider_pair(self, index: int, time: int) -> None:
        if self._pair is None or self._lateness(index, time) < self._lateness(*self._pair):
            self._pair = (index, time)

    def _lateness(self, index: int, time: int) -> int:
        return time - round(index / self._rate * 1e9)

    def flush(self, now: int) -> Iterator[Block]:
        """Yield the scans since the last block, if any."""
        if not self._have:
            return
        last = self._first + self._have - 1
        pair = self._pair if self._pair is not None else (last, self._not_before(last, now))
        yield Block(
            device=self._device,
            rate=self._rate,
            first_index=self._first,
            counts=np.ascontiguousarray(np.concatenate(self._counts)),
            scale=self._scale,
            arrival_index=pair[0],
            arrival_time=pair[1],
            temperature=self._temperature,
            flags=self._flags,
            clock=self._clock,
        )
        self._counts, self._have, self._pair, self._flags = [], 0, None, Flag.NONE

    def _not_before(self, index: int, now: int) -> int:
        """Return `now`, or later: a scan between gaps must not look earlier than those that arrived in order."""
        if self._anchor is None:
            return now
        return max(now, self._anchor[1] + round((index - self._anchor[0]) / self._rate * 1e9))


def _in_order(index: IndexArray, following: int) -> IndexArray | slice:
    """Return which scans of a read ascend, none before `following` unless all are: then that one was false."""
    if int(index[0]) == following and not np.any(np.diff(index) != 1):
        return slice(None)
    later = np.minimum.accumulate(index[::-1])[::-1]
    ascending = np.append(index[:-1] < later[1:], True) & (index >= 0)
    if index[-1] >= following:
        ascending &= index >= following
    return np.flatnonzero(ascending)
