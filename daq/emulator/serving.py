"""Common part of emulated hardware: a signal to measure, served in turns."""

import array
import fcntl
import termios
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol, TypeVar

from daq.protocol.frames import CanFrames
from daq.types import IntArray

PORT_BUFFER = 640 * 1024  # bytes that Linux keeps of a real port's before it loses some; a pty alone keeps 4 kB


class SampleSource(Protocol):
    """Signal that an emulated device measures."""

    def start(self, time: int, rate: float) -> None:
        """Begin: scan k is taken at time + k / rate [ns UTC, Hz]."""
        ...

    def read(self, index: int, n: int) -> IntArray:
        """Return scans index .. index + n - 1 as counts (n, 3); called in order, each scan once."""
        ...


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
        ...

    def receive(self, can_id: int, data: bytes) -> list[Frame]:
        """Take a frame from the bus; return those that answer it."""
        ...

    def beats(self) -> list[Frame]:
        """Return unprompted frames: a heartbeat that is due, emergencies."""
        ...

    def syncs(self) -> Syncs:
        """Return the SYNC frames that it has to send by now."""
        ...

    def scans(self, room: int, syncs: Syncs = NO_SYNCS) -> CanFrames:
        """Return the process data that are due, of as many scans as there is room for; the others are dropped.

        Parameters
        ----------
        room : scans
        syncs : SYNC frames received now
        """
        ...

    def disturbed(self, frames: CanFrames) -> CanFrames:
        """Return the frames of a bus that arrive if this node has faults: some of its own may be lost."""
        ...


class EmulatedPort(Protocol):
    """Emulated hardware behind one port."""

    port: str  #: path to open on the host's side

    @property
    def unread(self) -> int:
        """Number of bytes that the host's side has not read, as far as the terminal counts them: zero is certain."""
        ...

    def serve(self) -> None:
        """Answer commands and send data that are due, without blocking. No effect once unplugged."""
        ...

    def close(self) -> None:
        """Unplug: the host's side reads an error from now on; once is enough."""
        ...


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
    """Serve each port once, in an order that moves on with `turn`, so that none is always the latest."""
    first = turn % len(ports)
    for port in (*ports[first:], *ports[:first]):
        port.serve()


class SilentNode:
    """Node on a CAN bus that sends scans by a timer of its own, and nothing else."""

    synced = False

    def beats(self) -> list[Frame]:
        """Return nothing: it has no heartbeat."""
        return []

    def syncs(self) -> Syncs:
        """Return none."""
        return NO_SYNCS
