"""What every driver does alike: blocks out of scans, gaps, reconnection, one thread a port."""

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from daq.drivers.guarded import guarded
from daq.drivers.pace import Pace
from daq.errors import DeviceLost, DriverError
from daq.hostclock import HostClock
from daq.log import Event, Item
from daq.recording import Block, Flag, IndexArray, IntArray
from daq.timebase import unwrap

_RETRY_SECONDS = 0.1


@dataclass(frozen=True, eq=False)
class Scans:
    """What one read brought."""

    counts: IntArray  #: (n, n_axes) [-]
    counter: (
        IntArray | IndexArray
    )  #: (n,) as the device counts, wrapping; as `clock` counts, for good, if it has one [-]
    temperature: float  #: [degC]
    bad_bytes: int  #: dropped while these were read
    age: int = 0  #: since the bytes were here [ns of wall time]
    clock: str = ""  #: that the counter is of, if other devices sample by it too; a new name where it began anew
    warning: str = ""  #: what the device has said of itself, or is to be told of it though it sends


class Driver(Protocol):
    """One kind of device: what hardware asks for, and nothing else.

    One that filters has `delay` as well: how long after the motion a scan is that its filter lets through [s].
    """

    scale: float  #: m/s2 a count; known once it is open
    modulus: int  #: at which the device's counter wraps

    def open(self) -> dict[str, Any]:
        """Configure the device and start it; return its identity.

        Raises
        ------
        DriverError
            If it does not answer as its protocol says.
        """
        ...

    def read(self) -> Scans:
        """Wait for scans, at most a short time.

        Raises
        ------
        DeviceLost
            If the port is gone.
        """
        ...

    def close(self) -> None:
        """Stop the device if it still listens, and free the port."""
        ...


class Blocks:
    """Cuts scans into blocks: no gap inside, the earliest arrival as the (counter, host time) pair.

    A damaged frame passes its checksum once in 2^16: a false counter costs the scans around it, and nothing else. So
    only reads that go on where the last one ended tell the time.
    """

    def __init__(self, device: str, rate: float, scale: float, modulus: int, n_scans: int) -> None:
        self._device, self._rate, self._scale, self._modulus, self._n_scans = device, rate, scale, modulus, n_scans
        self._next = 0  # index that goes on without a gap
        self._offset = 0  # from counters to indices, modulo the modulus
        self._anchor: tuple[int, int] | None = None  # (index, time) of the last read without a gap
        self._counts: list[IntArray] = []
        self._first = self._have = 0
        self._pair: tuple[int, int] | None = None
        self._temperature = float("nan")
        self._flags = Flag.NONE
        self._clock = ""  # that is shared, if one is: then counters are indices

    def restart(self, now: int) -> None:
        """Note that the device counts anew, after `flush`; indices go on where the host's or the shared clock says."""
        if self._anchor is not None and not self._clock:
            elapsed = round((now - self._anchor[1]) * 1e-9 * self._rate)
            self._next = max(self._next, self._anchor[0] + elapsed) + 1
        self._anchor = None
        self._flags = Flag.RESTARTED

    def go_on_from(self, before: "Blocks", now: int) -> None:
        """Begin where another reader of the same device and rate has ended, if it has read anything."""
        if before._anchor is not None:
            self._next, self._anchor, self._clock = before._next, before._anchor, before._clock
            self.restart(now)

    def add(self, scans: Scans, now: int) -> Iterator[Block]:
        """Take what was read until `now` [ns UTC]; yield full blocks."""
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
        """Go on by a clock that devices share; it is another one where their sampling began anew."""
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
        """Return indices: without a gap as the counter says, however late; beyond one nearest to the expected."""
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
        """Take scans whose indices ascend, but may have gaps."""
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
        """Yield what has been taken since the last block, if anything."""
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
            pair_index=pair[0],
            pair_time=pair[1],
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


class DeviceReader(threading.Thread):
    """Reads one device for as long as asked, and takes it back by itself when it was lost.

    Parameters
    ----------
    device : its name
    driver : of the device, not opened yet
    rate : scans a second [Hz]
    clock : of the host
    sink : takes blocks and events, from this thread
    block_seconds : length of a block [s of data]
    silent_seconds : without a scan, of wall time, after which a device counts as lost
    delay : how long after the motion a scan is, of which times are told [s]; as the driver knows unless given
    after : stopped reader of the same device and rate, whose indices go on, so that one log can hold both
    """

    def __init__(
        self,
        device: str,
        driver: Driver,
        rate: float,
        clock: HostClock,
        sink: Callable[[Item], None],
        *,
        block_seconds: float = 0.2,
        silent_seconds: float = 1.7,  # with a read's wait seen within 2 s
        delay: float | None = None,
        after: "DeviceReader | None" = None,
    ) -> None:
        super().__init__(name=f"reader {device}", daemon=True)
        self.device, self._driver, self._rate, self._clock, self._sink = device, driver, rate, clock, sink
        self._silent_seconds = silent_seconds
        self._delay: float = getattr(driver, "delay", 0.0) if delay is None else delay
        self.bad_bytes = 0  #: dropped since the start, as no whole frame held them
        self._n_scans = max(1, round(block_seconds * rate))
        self._blocks: Blocks = after._blocks if after else self._new_blocks()
        self._pace = Pace(rate, clock)
        self._ending = threading.Event()
        self._end: int = after._end if after else 0  # index after the last block handed on
        self._shared: str = after._shared if after else ""  # clock of the last block, if devices share it
        self._identity: dict[str, Any] = {}  # of the device that was there at the start
        self._lost: DriverError | None = None  # why it is not open

    def connect(self) -> None:
        """Open the device before the thread starts.

        Raises
        ------
        DriverError
            If it does not answer.
        """
        self._know(self._driver.open())
        filtered = {"filter_delay": self._delay} if self._delay else {}
        self._sink(self._event("device_open", {**self._identity, **filtered}))

    def lose(self, why: DriverError) -> None:
        """Begin as if the device had been lost: the first to answer in its place is taken for it."""
        self._lost = why

    def _know(self, identity: dict[str, Any]) -> None:
        """Take a device for the one that is meant."""
        self._identity, before = identity, self._blocks
        self._blocks = self._new_blocks()  # some devices say their scale when they are asked
        self._blocks.go_on_from(before, self._moved())

    def _new_blocks(self) -> Blocks:
        return Blocks(self.device, self._rate, self._driver.scale, self._driver.modulus, self._n_scans)

    def stop(self) -> None:
        """Ask the thread to end."""
        self._ending.set()

    def run(self) -> None:
        """Read until stopped; the device must be connected."""
        while not self._ending.is_set():
            try:
                if self._lost is not None:
                    raise self._lost
                guarded(self.device, self._stream)
            except DriverError as error:
                self._lost = None
                self._flush()
                self._sink(self._event("device_lost", {"why": str(error)}))
                self._driver.close()
                self._reconnect()
        self._flush()
        self._driver.close()

    def _stream(self) -> None:
        heard = self._moved()
        while not self._ending.is_set():
            scans = self._driver.read()
            self.bad_bytes += scans.bad_bytes
            now = self._moved() - round(scans.age * self._clock.speed)
            if scans.warning:
                self._sink(self._event("device_warning", {"what": scans.warning}))
            for block in self._blocks.add(scans, now):
                self._hand_on(block)
            if len(scans.counts):
                heard = now
            elif now - heard > self._silent_seconds * 1e9 * self._clock.speed:
                raise DeviceLost(self.device, f"silent for {self._silent_seconds:g} s")

    def _moved(self) -> int:
        """Return when the motion was that arrives now [ns UTC]."""
        return self._clock.now() - round(self._delay * 1e9)

    def _flush(self) -> None:
        for block in self._blocks.flush(self._moved()):
            self._hand_on(block)

    def _hand_on(self, block: Block) -> None:
        """Put a block, and before it how many scans are missing; by the host's clock where the device began anew."""
        shared = block.clock != "" and block.clock == self._shared
        began = block.clock != "" and self._shared == ""  # others have sampled by it before
        missing = block.first_index - self._end
        if missing > 0 and not began:
            exact = shared or not block.flags & Flag.RESTARTED
            self._sink(self._event("gap", {"first_index": self._end, "missing": missing, "exact": exact}))
        self._end, self._shared = block.end_index, block.clock
        self._sink(block)
        if found := self._pace.differs(block):
            self._sink(self._event("wrong_rate", {"expected": self._rate, "found": round(found, 3)}))

    def _reconnect(self) -> None:
        """Wait for the same device: a port may be given to another one meanwhile, whose signals are not this one's."""
        refused: dict[str, Any] | None = None
        while not self._ending.wait(_RETRY_SECONDS):
            try:
                identity = guarded(self.device, self._driver.open)
            except DriverError:
                self._driver.close()
                continue
            if self._identity and identity != self._identity:
                self._driver.close()
                if identity != refused:
                    self._sink(self._event("wrong_device", {"expected": self._identity, "found": identity}))
                refused = identity
                continue
            if self._identity:
                self._blocks.restart(self._moved())
            else:
                self._know(identity)
            self._sink(self._event("device_back", identity))
            return

    def _event(self, what: str, payload: dict[str, Any]) -> Event:
        return Event(topic=f"/event/{what}", time=self._clock.now(), payload={"device": self.device, **payload})
