"""Several devices on one CAN bus: one thread reads blocks of frames and splits them by identifier.

Process data are queued per device, in blocks. Service data, heartbeats and emergencies are passed to `canopen`. The
first device that joins a bus opens it, the last one that leaves closes it. If the bus fails, all devices are notified
and leave; the first one to return opens it again.
"""

import contextlib
import logging
import queue
import threading
import time
from dataclasses import dataclass, field

import canopen
import numpy as np
import numpy.typing as npt

from daq.drivers.base import OURS, CanPlace
from daq.drivers.can.bus import Chunk, SlcanBus, bus_reason, read_frames
from daq.drivers.can.sync_count import SyncCount
from daq.errors import DeviceLost, DriverError
from daq.protocol.can_library import can
from daq.protocol.frames import NUMBER
from daq.supervision import FAILURES, SupervisedThread
from daq.types import IndexArray

_WAIT = 0.1  # s
GATHER_SECONDS = 0.19  #: between a driver's reads: decoding costs by the read more than by the frame
_ENOUGH = 400  # frames of a device that are worth a read
_MAX_CHUNKS = 4096  # capacity of a device's queue; further data are lost, and the counter shows it
_REPLY_SECONDS = 1.0  # a node replies within milliseconds, but a busy host may be late in reading it
#: messages passed to canopen, with their minimum length: emergencies, service data, heartbeats
_SERVICES = {0x080: 8, 0x580: 8, 0x700: 1}
_SERVICE_IDS = np.array(list(_SERVICES), np.uint32)
_BUS_ERRORS = (can.CanError, OSError, ValueError)
#: other exceptions of python-can's backends: kvaser a missing name of the vendor's library, neovi its own import error,
#: socketcand missing arguments
_BACKEND_ERRORS = (*_BUS_ERRORS, NameError, ImportError, TypeError)
for _name in ("can", "canopen"):
    logging.getLogger(_name).addHandler(logging.NullHandler())  # errors are raised, not printed


@dataclass(frozen=True)
class SyncPart:
    """Part of a device in the SYNC of its bus."""

    rate: float  #: rate of SYNC frames [Hz]
    produces: bool  #: it sends them itself


@dataclass(frozen=True, eq=False)
class DeviceFrames(Chunk):
    """Frames of one device in a chunk."""

    syncs: IndexArray  #: (n,) number of the last SYNC before each frame, if the device samples on it
    clock: str  #: name of the clock of these numbers


@dataclass(eq=False)
class Member:
    """One device's side of a hub."""

    hub: "CanHub"
    place: CanPlace
    identifiers: frozenset[int]  #: identifiers of its process data, with the bit EXTENDED
    sync: SyncPart | None = None  #: if it samples on that
    inbox: "queue.Queue[DeviceFrames]" = field(default_factory=lambda: queue.Queue(_MAX_CHUNKS))
    waiting: int = 0  #: frames that came since they were taken, about
    enough: threading.Event = field(default_factory=threading.Event)  #: they are worth a read, or none will come

    def take(self, timeout: float) -> list[DeviceFrames]:
        """Wait for process data and return all that are there; none after `timeout` [s].

        Raises
        ------
        DeviceLost
            If the bus is gone.
        """
        chunks: list[DeviceFrames] = []
        self.enough.clear()
        self.waiting = 0
        try:
            chunks.append(self.inbox.get(timeout=timeout if self.hub.failure is None else 0.0))
            while True:
                chunks.append(self.inbox.get_nowait())
        except queue.Empty:
            pass
        if not chunks and self.hub.failure is not None:
            raise DeviceLost(str(self.place), f"the bus is not available: {bus_reason(self.hub.failure)}")
        return chunks

    def gather(self, seconds: float) -> None:
        """Let frames gather for some seconds, until they are enough, or until the bus is gone."""
        if self.hub.failure is None:
            self.enough.wait(seconds)

    def pick(self, chunk: DeviceFrames) -> npt.NDArray[np.bool_]:
        """Select the frames of this device; return which (n,)."""
        own = np.zeros(len(chunk.frames), bool)
        for identifier in self.identifiers:  # few: each takes a tenth of the time of np.isin
            own |= chunk.frames.ids == identifier
        if own.any() and not self.inbox.full():
            self.inbox.put_nowait(DeviceFrames(chunk.frames[own], chunk.arrived, chunk.syncs[own], chunk.clock))
            self.waiting += int(np.count_nonzero(own))
            if self.waiting >= _ENOUGH:
                self.enough.set()
        return own


class CanHub:
    """One open bus and its reading thread."""

    def __init__(self, place: CanPlace) -> None:
        self.bitrate = place.bitrate
        self.failure: Exception | None = None  #: why the thread has ended by itself
        self._bus = _open_bus(place)
        self.network = canopen.Network(self._bus)
        self.members: tuple[Member, ...] = ()  #: replaced, never changed: the thread may be looking at the old one
        self.syncs = _SYNCS.setdefault(place.bus, SyncCount(f"SYNC of {place.interface}:{place.channel}"))
        self.syncs.restart()
        self._thread = SupervisedThread(f"can {place.channel}", self._run)
        self._thread.start()

    def add_node(self, number: int) -> canopen.RemoteNode:
        """Give a device its CANopen side, until it leaves with `del network[number]`."""
        node = canopen.RemoteNode(number, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
        node.sdo.RESPONSE_TIMEOUT = _REPLY_SECONDS
        self.network.add_node(node)
        return node

    def close(self) -> None:
        """End the thread and close the bus."""
        self._thread.ending.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self._thread.ending.is_set():
                chunk = read_frames(self._bus, _WAIT)
                if len(chunk.frames):
                    self._split(chunk)
        except Exception as error:  # noqa: BLE001 - its members open the bus anew, whatever has ended this thread
            self._shutdown()
            self.failure = error
            if not isinstance(error, _BUS_ERRORS):
                FAILURES.add(self._thread.name, error)
            for member in self.members:
                member.enough.set()
        else:
            self._shutdown()

    def _shutdown(self) -> None:
        with contextlib.suppress(Exception):  # it was gone
            self._bus.shutdown()

    def _split(self, chunk: Chunk) -> None:
        """Give process data to their devices, service data to canopen."""
        taken = np.zeros(len(chunk.frames), bool)
        members = self.members
        rate = next((member.sync.rate for member in members if member.sync), None)
        syncs = self.syncs.count(chunk, rate) if rate else np.zeros(len(chunk.frames), np.intp)
        share = DeviceFrames(chunk.frames, chunk.arrived, syncs, self.syncs.clock)
        for member in members:
            taken |= member.pick(share)
        if taken.all():
            return
        services = ~taken & np.isin(chunk.frames.ids & ~np.uint32(0x7F), _SERVICE_IDS)
        if services.any():
            now = time.time()
            for can_id, data in chunk.frames[services]:
                if len(data) >= _SERVICES[can_id & ~0x7F]:
                    self.network.notify(can_id, bytearray(data), now)


def _open_bus(place: CanPlace) -> can.BusABC:
    raised = _BUS_ERRORS if place.interface == OURS else _BACKEND_ERRORS
    try:
        if place.interface == OURS:
            return SlcanBus(place.channel, place.bitrate)
        channel = int(place.channel) if place.interface == "gs_usb" and place.channel.isdigit() else place.channel
        return can.Bus(interface=place.interface, channel=channel, bitrate=place.bitrate)
    except raised as error:
        raise DriverError(str(place), f"the bus cannot be opened: {bus_reason(error)}") from error


_HUBS: dict[tuple[str, str], CanHub] = {}  # a bus can be opened once in a process
_SYNCS: dict[tuple[str, str], SyncCount] = {}  # counts of the process: the numbers continue
_LOCK = threading.Lock()


def join_bus(place: CanPlace, identifiers: frozenset[int], sync: SyncPart | None = None) -> Member:
    """Return a device's side of the hub of its bus, which is opened if it is not.

    Parameters
    ----------
    place : where the device is
    identifiers : of its process data, with the bit EXTENDED
    sync : its part in the SYNC of the bus, if it samples on that

    Raises
    ------
    DriverError
        If the bus cannot be opened, runs at another bit rate, another device has one of the identifiers already, or
        produces SYNC, or has it at another rate.
    """
    with _LOCK:
        hub = _HUBS.get(place.bus)
        if hub is None or hub.failure is not None:
            hub = _HUBS[place.bus] = CanHub(place)
        if hub.bitrate != place.bitrate:
            raise DriverError(str(place), f"the bus is open at {hub.bitrate} bit/s, expected {place.bitrate}")
        for other in hub.members:
            if common := sorted(other.identifiers & identifiers):
                raise DriverError(str(place), f"identifier {common[0] & NUMBER:#x} is read already, by {other.place}")
            if sync and other.sync and (why := _conflict(sync, other.sync)):
                raise DriverError(str(place), f"{why}, that of {other.place}")
        member = Member(hub, place, identifiers, sync)
        hub.members = (*hub.members, member)
        return member


def _conflict(sync: SyncPart, other: SyncPart) -> str:
    """Return why two devices cannot have these parts in one SYNC, empty if they can."""
    if sync.rate != other.rate:
        return f"SYNC: expected one rate on a bus, found {sync.rate:g} Hz and {other.rate:g} Hz"
    return "SYNC: expected one producer per bus, found a second one" if sync.produces and other.produces else ""


def leave_bus(member: Member) -> None:
    """Let a device go; closes the bus after the last one."""
    hub, bus = member.hub, member.place.bus
    with _LOCK:
        hub.members = tuple(other for other in hub.members if other is not member)
        if not hub.members:
            hub.close()
            if _HUBS.get(bus) is hub:
                del _HUBS[bus]
