"""What every driver does alike: blocks out of scans, gaps, reconnection, one thread a port."""

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from daq.errors import DeviceLost, DriverError
from daq.hostclock import HostClock
from daq.log import Event, Item
from daq.recording import Block, Flag, IndexArray, IntArray
from daq.timebase import unwrap

_RETRY_SECONDS = 0.5


@dataclass(frozen=True, eq=False)
class Scans:
    """What one read brought."""

    counts: IntArray  #: (n, n_axes) [-]
    counter: IntArray  #: (n,) as the device counts, wrapping [-]
    temperature: float  #: [degC]
    bad_bytes: int  #: dropped while these were read


class Driver(Protocol):
    """One kind of device: what hardware asks for, and nothing else."""

    scale: float  #: m/s2 a count
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


class _Blocks:
    """Cuts scans into blocks: no gap inside, the earliest arrival as the (counter, host time) pair."""

    def __init__(self, device: str, rate: float, scale: float, modulus: int, n_scans: int) -> None:
        self._device, self._rate, self._scale, self._modulus, self._n_scans = device, rate, scale, modulus, n_scans
        self._last: int | None = None
        self._last_time = 0
        self._counts: list[IntArray] = []
        self._first = self._have = 0
        self._pair = (0, 0)
        self._flags = Flag.NONE

    def restart(self, now: int) -> None:
        """Note that the device begins to count anew; indices go on where the host's clock says."""
        if self._last is not None:
            self._last += max(1, round((now - self._last_time) * 1e-9 * self._rate))
        self._flags = Flag.RESTARTED

    def add(self, scans: Scans, now: int) -> Iterator[Block]:
        """Take what was read until `now` [ns UTC]; yield full blocks."""
        if scans.bad_bytes:
            self._flags |= Flag.BAD_FRAMES
        if not len(scans.counts):
            return
        index = self._index(scans, now)
        last_time = now
        for part in np.split(np.arange(len(index)), np.flatnonzero(np.diff(index) != 1) + 1):
            if self._have and int(index[part[0]]) != self._first + self._have:
                yield from self._take(scans.temperature)
                self._flags |= Flag.AFTER_GAP
            if not self._have:
                self._first = int(index[part[0]])
            self._counts.append(scans.counts[part])
            self._have += len(part)
        self._consider_pair(int(index[-1]), last_time)
        self._last, self._last_time = int(index[-1]), now
        if self._have >= self._n_scans:
            yield from self._take(scans.temperature)

    def _index(self, scans: Scans, now: int) -> IndexArray:
        if self._flags & Flag.RESTARTED:
            origin = 0 if self._last is None else self._last
            return np.asarray(origin + unwrap(scans.counter, None, 0, self._modulus) - int(scans.counter[0]))
        expected = 0 if self._last is None else self._last + round((now - self._last_time) * 1e-9 * self._rate)
        return np.asarray(unwrap(scans.counter, self._last, expected - len(scans.counter) + 1, self._modulus))

    def _consider_pair(self, index: int, time: int) -> None:
        lateness = time - round(index / self._rate * 1e9)
        if self._pair == (0, 0) or lateness < self._pair[1] - round(self._pair[0] / self._rate * 1e9):
            self._pair = (index, time)

    def _take(self, temperature: float) -> Iterator[Block]:
        if self._pair == (0, 0):  # a gap cut the block before any read ended in it
            self._pair = (self._first + self._have - 1, self._last_time)
        yield Block(
            device=self._device,
            rate=self._rate,
            first_index=self._first,
            counts=np.ascontiguousarray(np.concatenate(self._counts)),
            scale=self._scale,
            pair_index=self._pair[0],
            pair_time=self._pair[1],
            temperature=temperature,
            flags=self._flags,
        )
        self._counts, self._have, self._pair, self._flags = [], 0, (0, 0), Flag.NONE


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
    """

    def __init__(
        self,
        device: str,
        driver: Driver,
        rate: float,
        clock: HostClock,
        sink: Callable[[Item], None],
        *,
        block_seconds: float = 0.25,
        silent_seconds: float = 2.0,
    ) -> None:
        super().__init__(name=f"reader {device}", daemon=True)
        self._device, self._driver, self._rate, self._clock, self._sink = device, driver, rate, clock, sink
        self._silent_seconds = silent_seconds
        self._blocks = _Blocks(device, rate, driver.scale, driver.modulus, max(1, round(block_seconds * rate)))
        self._ending = threading.Event()

    def connect(self) -> None:
        """Open the device before the thread starts.

        Raises
        ------
        DriverError
            If it does not answer.
        """
        self._sink(self._event("device_open", self._driver.open()))

    def stop(self) -> None:
        """Ask the thread to end."""
        self._ending.set()

    def run(self) -> None:
        """Read until stopped; the device must be connected."""
        while not self._ending.is_set():
            try:
                self._stream()
            except DriverError as error:
                self._sink(self._event("device_lost", {"why": str(error)}))
                self._driver.close()
                self._reconnect()
        self._driver.close()

    def _stream(self) -> None:
        heard = self._clock.now()
        while not self._ending.is_set():
            scans = self._driver.read()
            now = self._clock.now()
            for block in self._blocks.add(scans, now):
                self._sink(block)
            if len(scans.counts):
                heard = now
            elif now - heard > self._silent_seconds * 1e9 * self._clock.speed:
                raise DeviceLost(self._device, f"silent for {self._silent_seconds:g} s")

    def _reconnect(self) -> None:
        while not self._ending.wait(_RETRY_SECONDS):
            try:
                identity = self._driver.open()
            except DriverError:
                self._driver.close()
                continue
            self._blocks.restart(self._clock.now())
            self._sink(self._event("device_back", identity))
            return

    def _event(self, what: str, payload: dict[str, Any]) -> Event:
        return Event(topic=f"/event/{what}", time=self._clock.now(), payload={"device": self._device, **payload})
