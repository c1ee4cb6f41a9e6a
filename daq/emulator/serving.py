"""Common part of emulated hardware: a signal to measure, served in turns over a line with faults."""

import array
import fcntl
import os
import termios
import time
import tty
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Literal, Protocol, TypeVar

import numpy as np

from daq.protocol.frames import CanFrames
from daq.types import IntArray

PORT_BUFFER = 640 * 1024  # bytes that Linux keeps of a real port's before it loses some; a pty alone keeps 4 kB


class SampleSource(Protocol):
    """Signal that an emulated device measures."""

    def start(self, time: int, rate: float) -> None:
        """Begin: scan k is taken at time + k / rate [ns UTC, Hz]."""

    def read(self, index: int, n: int) -> IntArray:
        """Return scans index .. index + n - 1 as counts (n, 3); called in order, each scan once."""


Frame = tuple[int, bytes]  #: identifier and data


@dataclass(frozen=True)
class Syncs:
    """SYNC frames that a node of a bus sends at once."""

    since: int = 0  #: when the first of all was due [ns UTC]
    rate: float = 0.0  #: rate by the simulated clock [Hz]
    first: int = 0  #: number of scans sent before
    n: int = 0  #: number of scans sent now


NO_SYNCS = Syncs()


class EmulatedBusNode(Protocol):
    """Emulated hardware on a CAN bus."""

    bytes_a_scan: int  #: size of SLCAN lines
    sent: int  #: scans handed to the adapter
    dropped: int  #: scans that found it full or closed

    @property
    def synced(self) -> bool:
        """True if it samples on SYNC."""

    def receive(self, can_id: int, data: bytes) -> list[Frame]:
        """Take a frame from the bus; return those that answer it."""

    def beats(self) -> list[Frame]:
        """Return unprompted frames: a heartbeat that is due, emergencies."""

    def syncs(self) -> Syncs:
        """Return the SYNC frames that it has to send by now."""

    def scans(self, room: int, syncs: Syncs = NO_SYNCS) -> CanFrames:
        """Return the process data that are due, of as many scans as there is room for; the others are dropped.

        Parameters
        ----------
        room : scans
        syncs : SYNC frames received now
        """

    def disturbed(self, frames: CanFrames) -> CanFrames:
        """Return the frames of a bus that arrive if this node has faults: some of its own may be lost."""


class EmulatedPort(Protocol):
    """Emulated hardware behind one port."""

    port: str  #: path to open on the host's side

    @property
    def unread(self) -> int:
        """Number of bytes that the host's side has not read, as far as the terminal counts them: zero is certain."""

    def serve(self) -> None:
        """Answer commands and send data that are due, without blocking. No effect once unplugged."""

    def close(self) -> None:
        """Unplug: the host's side reads an error from now on; once is enough."""


def bytes_to_read(descriptor: int) -> int:
    """Return how many bytes a read of a terminal would find; a pty shows 4 kB of them at most."""
    found = array.array("i", [0])
    fcntl.ioctl(descriptor, termios.FIONREAD, found)
    return found[0]


_Port = TypeVar("_Port", bound=EmulatedPort)


@contextmanager
def unplugging(ports: list[_Port]) -> Iterator[list[_Port]]:
    """Close emulated hardware at the end, whatever happens."""
    try:
        yield ports
    finally:
        for port in ports:
            port.close()


def serve_all(ports: Sequence[EmulatedPort], turn: int) -> None:
    """Serve each port once, in an order that changes with `turn`: no port is always served last."""
    first = turn % len(ports)
    for port in (*ports[first:], *ports[:first]):
        port.serve()


class Pty:
    """The device side of a pseudo terminal: bytes wait until there is room for them."""

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        weakref.finalize(self, os.close, self._slave)  # keeps its number from the next pty, which a host may look for
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)  #: path to open on the host's side
        self._pending, self._unplugged = bytearray(), False

    @property
    def unread(self) -> int:
        """Number of bytes that the host's side has not read, as far as the terminal counts them: zero is certain."""
        return len(self._pending) + bytes_to_read(self._slave)

    def _drain(self) -> None:
        """Write what is pending, as far as there is room: a real line would hold the rest too."""
        if self._pending:
            with suppress(OSError):
                del self._pending[: os.write(self._master, self._pending)]


class SilentNode:
    """Node on a CAN bus that sends scans by a timer of its own, and nothing else."""

    synced = False

    def beats(self) -> list[Frame]:
        """Return nothing: it has no heartbeat."""
        return []

    def syncs(self) -> Syncs:
        """Return none."""
        return NO_SYNCS


What = Literal["lost", "repeated", "cut", "silent"]


@dataclass(frozen=True, kw_only=True)
class LineSpell:
    """Fault of all frames during an interval."""

    what: What  #: the frame is lost; repeated; cut in half; or the device is silent and ignores commands
    at: float  #: time since the first sample of the device [s of data]
    seconds: float  #: duration [s of data]

    def __post_init__(self) -> None:
        """Refuse invalid values."""
        if self.what not in ("lost", "repeated", "cut", "silent"):
            raise ValueError(f"what: expected lost, repeated, cut or silent, found {self.what!r}")
        if self.at < 0 or self.seconds <= 0:
            raise ValueError(f"at, seconds: expected a time and a length, found {self.at:g}, {self.seconds:g}")


@dataclass(frozen=True, kw_only=True)
class LineFaults:
    """Faults of one line; faults of bytes and frames affect samples, not replies to the host."""

    flipped: float = 0.0  #: share of bytes with one wrong bit
    lost: float = 0.0  #: share of bytes that never arrive
    babble: int = 0  #: random bytes before anything else, as at power-on
    latency: float = 0.0  #: wall time between transfers [s]; USB adapters have 0.001 or 0.016
    spells: tuple[LineSpell, ...] = ()  #: faults of frames over time; if two overlap, the first one applies
    counter: int = 0  #: initial value of the device counter, to test its wrap
    baud: int | None = None  #: baud rate of the device; a host at another rate receives noise, and so does the device
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse invalid shares and times."""
        for name in ("flipped", "lost"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name}: expected a share of 0 to 1, found {getattr(self, name):g}")
        if self.babble < 0 or self.latency < 0 or self.counter < 0:
            found = f"{self.babble}, {self.latency:g}, {self.counter}"
            raise ValueError(f"babble, latency, counter: expected none negative, found {found}")


NO_FAULTS = LineFaults()


class FaultyLine:
    """A line on which faults happen."""

    def __init__(self, faults: LineFaults) -> None:
        self._faults = faults
        self._random = np.random.default_rng(faults.seed)
        self._next = 0.0  # hand-over, by time.monotonic [s]
        self.harmed = 0  #: bytes that were flipped or lost, so far
        self.missing = 0  #: scans of which no whole frame arrived for a spell, so far

    def babble(self) -> bytes:
        """Return the random bytes at power-on."""
        return self._random.bytes(self._faults.babble)

    @property
    def counter(self) -> int:
        """Number of the first scan of all."""
        return self._faults.counter

    @property
    def baud(self) -> int | None:
        """Baud rate of the device, None if it is that of the host [bit/s]."""
        return self._faults.baud

    def noise(self, n: int) -> bytes:
        """Return the bytes received at another baud rate."""
        return self._random.bytes(n)

    def happening(self, scan: int, rate: float) -> What | None:
        """Return the fault of a scan, counted since the first sample, at a rate [Hz]."""
        spells = (s for s in self._faults.spells if round(s.at * rate) <= scan < round((s.at + s.seconds) * rate))
        return next((s.what for s in spells), None)

    def runs(self, first: int, n: int, rate: float) -> Iterator[tuple[int, int, What | None]]:
        """Yield (start, stop, fault) of scans `first` + start .. stop - 1, of n in all.

        Parameters
        ----------
        first : scans since the device first sampled
        n : how many
        rate : of them [Hz]
        """
        if not self._faults.spells:
            yield 0, n, None
            return
        what = [self.happening(first + k, rate) for k in range(n)]
        start = 0
        for stop in range(1, n + 1):
            if stop == n or what[stop] != what[start]:
                self.missing += (stop - start) * (what[start] not in (None, "repeated"))
                yield start, stop, what[start]
                start = stop

    def carried(self, data: bytes) -> bytes:
        """Return the part of sampled data that arrives."""
        if not self._faults.flipped and not self._faults.lost:
            return data
        line = np.frombuffer(data, np.uint8).copy()
        flipped = self._random.random(len(line)) < self._faults.flipped
        line[flipped] ^= (1 << self._random.integers(0, 8, len(line)))[flipped].astype(np.uint8)
        lost = self._random.random(len(line)) < self._faults.lost
        self.harmed += int(np.count_nonzero(flipped | lost))
        return line[~lost].tobytes()

    def hands_over(self) -> bool:
        """Return whether received bytes are to be forwarded now."""
        if time.monotonic() < self._next:
            return False
        self._next = time.monotonic() + self._faults.latency
        return True
