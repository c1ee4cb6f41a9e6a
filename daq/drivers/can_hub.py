"""Several devices on one CAN bus: one thread reads blocks of frames and splits them by node.

Process data go to a queue a node, as blocks; service data, heartbeats and emergencies to `canopen`, which does the
CANopen side. The first device that joins a bus opens it, the last one that leaves closes it. Where the bus is gone all
who had joined are told, leave, and the first to come back opens it anew.
"""

import logging
import queue
import threading
import time
from dataclasses import dataclass, field

import can
import canopen
import numpy as np

from daq.can_address import OURS, CanAddress
from daq.can_bus import Chunk, SlcanBus, read_frames
from daq.errors import DeviceLost, DriverError
from daq.protocol.epson_can import TPDO1, TPDO2
from daq.protocol.frames import CanFrames

_WAIT = 0.1  # s
_MOST_CHUNKS = 4096  # that wait for a device's thread; beyond it they are lost, and the counter tells
_REPLY_SECONDS = 0.5
_FUNCTION = 0x780  # bits of an id that say what it is for; the others are the node
#: what canopen is told, and the least data that it can read: emergencies, service data, heartbeats
_SERVICES = {0x080: 8, 0x580: 8, 0x700: 1}
_BUS_ERRORS = (can.CanError, OSError, ValueError)
#: python-can's backends raise the others where a vendor's library is missing
_OPEN_ERRORS = (*_BUS_ERRORS, ImportError, NameError, AttributeError, TypeError, NotImplementedError)
for _name in ("can", "canopen"):
    logging.getLogger(_name).addHandler(logging.NullHandler())  # what goes wrong is raised, not printed


@dataclass(eq=False)
class Member:
    """One device's side of a hub."""

    hub: "CanHub"
    address: CanAddress
    node: canopen.RemoteNode
    inbox: "queue.Queue[Chunk]" = field(default_factory=lambda: queue.Queue(_MOST_CHUNKS))

    def take(self, timeout: float) -> list[Chunk]:
        """Wait for process data and return all that are there; none after `timeout` [s].

        Raises
        ------
        DeviceLost
            If the bus is gone.
        """
        chunks: list[Chunk] = []
        try:
            chunks.append(self.inbox.get(timeout=timeout))
            while True:
                chunks.append(self.inbox.get_nowait())
        except queue.Empty:
            pass
        if not chunks and self.hub.failure is not None:
            raise DeviceLost(str(self.address), f"the bus is gone: {self.hub.failure}")
        return chunks


class CanHub:
    """One open bus and its reading thread."""

    def __init__(self, address: CanAddress) -> None:
        self.bitrate = address.bitrate
        self.failure: Exception | None = None  #: why the thread has ended by itself
        self._bus = _open_bus(address)
        self.network = canopen.Network(self._bus)
        self.members: dict[int, Member] = {}
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"can {address.channel}", daemon=True)
        self._thread.start()

    def add(self, address: CanAddress) -> Member:
        """Take a node in."""
        node = canopen.RemoteNode(address.node, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
        node.sdo.RESPONSE_TIMEOUT = _REPLY_SECONDS
        self.network.add_node(node)
        member = Member(self, address, node)
        self.members = {**self.members, address.node: member}  # the thread may be looking at the old ones
        return member

    def remove(self, node: int) -> None:
        """Let a node go."""
        self.members = {number: member for number, member in self.members.items() if number != node}
        del self.network[node]

    def close(self) -> None:
        """End the thread and close the bus."""
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self._ending.is_set():
                chunk = read_frames(self._bus, _WAIT)
                if len(chunk.frames):
                    self._split(chunk.frames, chunk.arrived)
        except _BUS_ERRORS as error:
            self._shutdown()
            self.failure = error
        else:
            self._shutdown()

    def _shutdown(self) -> None:
        try:
            self._bus.shutdown()
        except _BUS_ERRORS:
            return  # it was gone

    def _split(self, frames: CanFrames, arrived: int) -> None:
        """Give process data to their devices, service data to canopen."""
        function, number = frames.ids & ~np.uint32(0x7F), frames.ids & 0x7F
        process = (function == TPDO1) | (function == TPDO2)
        for node, member in self.members.items():
            own = process & (number == node)
            if own.any() and not member.inbox.full():
                member.inbox.put_nowait(Chunk(frames[own], arrived))
        if not process.all():
            now = time.time()
            for can_id, data in frames[~process]:
                if len(data) >= _SERVICES.get(can_id & ~0x7F, 9):
                    self.network.notify(can_id, bytearray(data), now)


def _open_bus(address: CanAddress) -> can.BusABC:
    try:
        if address.interface == OURS:
            return SlcanBus(address.channel, address.bitrate)
        return can.Bus(interface=address.interface, channel=address.channel, bitrate=address.bitrate)
    except _OPEN_ERRORS as error:
        raise DriverError(str(address), f"the bus cannot be opened: {error}") from error


_HUBS: dict[tuple[str, str], CanHub] = {}  # a bus can be opened once in a process
_LOCK = threading.Lock()


def join_bus(address: CanAddress) -> Member:
    """Return a device's side of the hub of its bus, which is opened if it is not.

    Raises
    ------
    DriverError
        If the bus cannot be opened, runs at another bit rate, or has this node already.
    """
    with _LOCK:
        hub = _HUBS.get(address.bus)
        if hub is None or hub.failure is not None:
            hub = _HUBS[address.bus] = CanHub(address)
        if hub.bitrate != address.bitrate:
            raise DriverError(str(address), f"the bus is open at {hub.bitrate} bit/s, expected {address.bitrate}")
        if address.node in hub.members:
            raise DriverError(str(address), "this node is read already")
        return hub.add(address)


def leave_bus(member: Member) -> None:
    """Let a device go; closes the bus after the last one."""
    hub, bus = member.hub, member.address.bus
    with _LOCK:
        hub.remove(member.address.node)
        if not hub.members:
            hub.close()
            if _HUBS.get(bus) is hub:
                del _HUBS[bus]
