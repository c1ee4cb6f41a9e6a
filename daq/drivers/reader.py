"""Reading of any device: one thread per port, detection of silence, reconnection, reported gaps."""

import contextlib
from collections.abc import Callable
from typing import TypeVar

from daq.drivers.base import Driver
from daq.drivers.block_builder import BlockBuilder
from daq.errors import DeviceLost, DriverError
from daq.events import (
    DeviceFailed,
    DeviceOpened,
    DeviceRecovered,
    DeviceWarning,
    EventPayload,
    ScansMissing,
    WrongDevice,
    WrongRate,
)
from daq.supervision import SupervisedThread
from daq.timing.host_clock import HostClock
from daq.types import Block, DeviceIdentity, Flag, Item

T = TypeVar("T")


class DriverCrashedError(DriverError):
    """Error that no driver should raise: the device is lost, and must not be lost for good."""

    def __init__(self, device: str, error: Exception) -> None:
        super().__init__(device, str(error))
        self._error = error

    def __str__(self) -> str:
        return f"{type(self._error).__name__}: {self._error}"


def guarded(device: str, work: Callable[[], T]) -> T:
    """Return the result of an action of a driver; every exception becomes a loss of the device.

    Raises
    ------
    DriverError
        Whatever it raised.
    """
    try:
        return work()
    except DriverError:
        raise
    except Exception as error:
        raise DriverCrashedError(device, error) from error


def guarded_open(device: str, driver: Driver) -> DeviceIdentity:
    """Open a device; a driver by others may return anything.

    Raises
    ------
    DriverError
        Whatever it raised, or if it returns no identity.
    """
    identity: object = guarded(device, driver.open)
    if not isinstance(identity, DeviceIdentity):
        raise DriverError(device, f"its driver returns no DeviceIdentity: {identity!r:.80}")
    return identity


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
    rate : expected, scans per second [Hz]
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


_RETRY_SECONDS = 0.1


class DeviceReader(SupervisedThread):
    """Reader of one device until it is stopped, with automatic reconnection.

    Parameters
    ----------
    device : its name
    driver : of the device, not opened yet
    rate : scans per second [Hz]
    clock : of the host
    sink : takes blocks and events, from this thread
    block_seconds : length of a block [s of data]
    silent_seconds : without a scan, of wall time, after which a device counts as lost
    delay : group delay of the device [s], subtracted from its times. Default: the driver's value.
    after : stopped reader of the same device and rate, whose indices are continued so that one log can hold both
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
        super().__init__(f"reader {device}", self._read)
        self.device, self._driver, self._rate, self._clock, self._sink = device, driver, rate, clock, sink
        self._silent_seconds = silent_seconds
        self._delay: float = getattr(driver, "delay", 0.0) if delay is None else delay
        self.bad_bytes = 0  #: dropped since the start, as no whole frame held them
        self._n_scans = max(1, round(block_seconds * rate))
        self._blocks: BlockBuilder = after._blocks if after else self._new_blocks()
        self._pace = RateCheck(rate, clock)
        self._end: int = after._end if after else 0  # index after the last block handed on
        self._shared: str = after._shared if after else ""  # clock of the last block, if devices share it
        self._identity: DeviceIdentity | None = None  # of the device that was there at the start
        self._lost: DriverError | None = None  # why it is not open

    def connect(self) -> None:
        """Open the device before the thread starts.

        Raises
        ------
        DriverError
            If it does not answer.
        """
        identity = guarded_open(self.device, self._driver)
        self._know(identity)
        self._report(DeviceOpened(device=self.device, identity=identity, filter_delay=self._delay or None))

    def lose(self, why: DriverError) -> None:
        """Begin as if the device had been lost: the first one that answers at its address is taken for it."""
        self._lost = why

    def _know(self, identity: DeviceIdentity) -> None:
        """Take a device for the one that is meant."""
        self._identity, before = identity, self._blocks
        self._blocks = self._new_blocks()  # some devices report their scale when they are opened
        self._blocks.continue_from(before, self._moved())

    def _new_blocks(self) -> BlockBuilder:
        return BlockBuilder(self.device, self._rate, self._driver.scale, self._driver.modulus, self._n_scans)

    def stop(self) -> None:
        """Request the end of the thread."""
        self.ending.set()

    def _read(self) -> None:
        """Read until stopped; the device must be connected."""
        while not self.ending.is_set():
            try:
                if self._lost is not None:
                    raise self._lost
                guarded(self.device, self._stream)
            except DriverError as error:
                self._lost = None
                self._flush()
                self._report(DeviceFailed(device=self.device, why=str(error)))
                self._close()
                self._reconnect()
        self._flush()
        self._close()

    def _close(self) -> None:
        """Close the device and ignore errors: it is opened again afterwards."""
        with contextlib.suppress(DriverError):
            guarded(self.device, self._driver.close)

    def _stream(self) -> None:
        last_moved = self._moved()
        while not self.ending.is_set():
            scans = self._driver.read()
            self.bad_bytes += scans.bad_bytes
            now = self._moved(scans.age)
            if scans.warning:
                self._report(DeviceWarning(device=self.device, what=scans.warning))
            for block in self._blocks.add(scans, now):
                self._hand_on(block)
            if len(scans.counts):
                last_moved = now
            elif now - last_moved > self._silent_seconds * 1e9 * self._clock.speed:
                raise DeviceLost(self.device, f"silent for {self._silent_seconds:g} s")

    def _moved(self, age: int = 0) -> int:
        """Return when the motion was that arrived `age` ns of wall time ago [ns UTC]."""
        return self._clock.now(age) - round(self._delay * 1e9)

    def _flush(self) -> None:
        for block in self._blocks.flush(self._moved()):
            self._hand_on(block)

    def _hand_on(self, block: Block) -> None:
        """Pass on a block, preceded by the number of missing scans; by the host's clock if the device has restarted."""
        shared = block.clock != "" and block.clock == self._shared
        began = block.clock != "" and self._shared == ""  # others have sampled by it before
        missing = block.first_index - self._end
        if missing > 0 and not began:
            exact = shared or not block.flags & Flag.RESTARTED
            self._report(ScansMissing(device=self.device, first_index=self._end, missing=missing, exact=exact))
        self._end, self._shared = block.end_index, block.clock
        self._sink(block)
        if found := self._pace.differs(block):
            self._report(WrongRate(device=self.device, expected=self._rate, found=round(found, 3)))

    def _reconnect(self) -> None:
        """Wait for the same device: another one may be connected to the port meanwhile."""
        refused: DeviceIdentity | None = None
        while not self.ending.wait(_RETRY_SECONDS):
            try:
                identity = guarded_open(self.device, self._driver)
            except DriverError:
                self._close()
                continue
            if self._identity is not None and identity != self._identity:
                self._close()
                if identity != refused:
                    expected, found = self._identity.payload(), identity.payload()
                    self._report(WrongDevice(device=self.device, expected=expected, found=found))
                refused = identity
                continue
            if self._identity is not None:
                self._blocks.restart(self._moved())
            else:
                self._know(identity)
            self._report(DeviceRecovered(device=self.device, identity=identity))
            return

    def _report(self, payload: EventPayload) -> None:
        self._sink(payload.event(self._clock.now()))
