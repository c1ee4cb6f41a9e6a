"""Epson M-A552AC1x on a CAN bus that several devices share."""

import time

import canopen
import numpy as np
from canopen.sdo.exceptions import SdoAbortedError, SdoError

from daq.drivers.base import CanAddress, Scans, known_rate
from daq.drivers.can.bus import bus_reason
from daq.drivers.can.epson_can_setup import configure, end_sync, identify, produce_sync
from daq.drivers.can.heartbeat import HeartbeatConsumer
from daq.drivers.can.hub import GATHER_SECONDS, DeviceFrames, Member, SyncPart, join_bus, leave_bus
from daq.drivers.can.sync_count import SyncedCounter
from daq.errors import DeviceLost, DriverError
from daq.protocol import epson_can as epson
from daq.protocol.can_library import can
from daq.protocol.epson import temperature_celsius
from daq.protocol.epson_filters import FILTERS, group_delay
from daq.protocol.frames import concatenate
from daq.types import DeviceIdentity, IndexArray, IntArray

PERIOD = 10.0  #: s between questions
_ASK, _ANSWER = 0x40, 0x43  # SDO commands: read an object; its four bytes


class Thermometer:
    """One node's temperature, requested at intervals while it samples, without waiting for the reply.

    A message with every scan (TPDO4) has no room on a bus of four nodes at 1000 Hz. Answers come in the bus's thread,
    questions from the driver's.

    Parameters
    ----------
    node : queried at once, which takes the time of one reply

    Raises
    ------
    canopen.SdoCommunicationError
        If it does not answer.
    """

    def __init__(self, node: canopen.RemoteNode) -> None:
        self._node, self._due = node, time.monotonic() + PERIOD
        self.celsius = float("nan")  #: last temperature [degC], NaN if the node has no such object
        try:
            self._take(bytes(node.sdo.upload(*epson.TEMPERATURE)))
        except SdoAbortedError:
            self._due = float("inf")
        self._network = node.network
        self._network.subscribe(node.sdo.tx_cobid, self._hear)

    def ask_if_due(self) -> None:
        """Send a request if it is due; errors of the bus."""
        if time.monotonic() >= self._due:
            self._due = time.monotonic() + PERIOD
            self._network.send_message(self._node.sdo.rx_cobid, _message(_ASK).ljust(8, b"\0"))

    def _hear(self, _: int, data: bytearray, __: float) -> None:
        if data[:4] == _message(_ANSWER):
            self._take(bytes(data[4:8]))

    def _take(self, value: bytes) -> None:
        self.celsius = float(temperature_celsius(int.from_bytes(value, "little", signed=True)))

    def close(self) -> None:
        """Stop receiving its frames."""
        self._network.unsubscribe(self._node.sdo.tx_cobid, self._hear)


def _message(command: int) -> bytes:
    index, subindex = epson.TEMPERATURE
    return bytes([command]) + index.to_bytes(2, "little") + bytes([subindex])


_READ_SECONDS = 0.1
_QUIET_SECONDS = 0.03
_SYNC_SECONDS = 1.0  # time limit without SYNC while the heartbeat continues [s]; the slowest SYNC has 50 Hz
_START, _PRE_OPERATIONAL = 1, 128  # NMT commands
_ERRORS = (SdoError, can.CanError, OSError, ValueError)


class EpsonCan:
    """Driver of one device.

    By its own timer its scans are numbered by its counter. On SYNC they are numbered by that: the same number is the
    same instant on all nodes of the bus.

    Parameters
    ----------
    address : bus and node
    rate : scans per second, one of 50, 100, 200, 500, 1000 [Hz]

    Raises
    ------
    ValueError
        If the device has no such rate.
    """

    scale = epson.SCALE
    modulus = epson.MODULUS

    def __init__(self, address: CanAddress, rate: float) -> None:
        self._address, self._rate = address, known_rate(rate, epson.RATES, address)
        self.delay = group_delay(FILTERS[self._rate])  #: group delay of the filter [s]
        self._member: Member | None = None
        self._heartbeat: HeartbeatConsumer | None = None
        self._thermometer: Thermometer | None = None
        self._decoder = epson.ScanDecoder(address.node)
        self._synced, self._clock = SyncedCounter(), ""
        self._held: list[DeviceFrames] = []  # of another start of SYNC than those before
        self._was_open = False

    def open(self) -> DeviceIdentity:
        """Join the bus, check who answers, set rate, filter, process data and heartbeat, start it."""
        number = self._address.node
        part = SyncPart(self._rate, self._address.sync == "producer") if self._address.sync else None
        member = join_bus(self._address, frozenset({epson.TPDO1 + number, epson.TPDO2 + number}), part)
        self._member, node = member, member.hub.add_node(number)
        try:
            identity = self._begin(member, node)
        except _ERRORS as error:
            self.close()
            raise DriverError(str(self._address), f"no M-A552 answers: {bus_reason(error)}") from error
        self._was_open = True
        return identity

    def _begin(self, member: Member, node: canopen.RemoteNode) -> DeviceIdentity:
        node.nmt.send_command(_PRE_OPERATIONAL)
        end = time.monotonic() + 1.0
        while member.take(_QUIET_SECONDS):  # data that are still sent by an earlier run
            if time.monotonic() > end:
                raise ValueError("it does not stop sampling")
        identity = identify(node)
        configure(node, self._address, self._rate)
        self._thermometer = Thermometer(node)
        self._decoder = epson.ScanDecoder(self._address.node)
        self._synced, self._clock, self._held = SyncedCounter(), "", []
        if self._address.sync == "consumer" and self._was_open:
            self._wait_for_sync(member)
        self._heartbeat = HeartbeatConsumer(node)
        node.nmt.send_command(_START)
        if self._address.sync == "producer":
            member.hub.syncs.restart()
            produce_sync(node)
        return identity

    @staticmethod
    def _wait_for_sync(member: Member) -> None:
        """Take no device back that would be silent: at the start only, its producer may be the next to be opened."""
        before, end = member.hub.syncs.number, time.monotonic() + _SYNC_SECONDS
        while member.hub.syncs.number == before:
            if time.monotonic() > end:
                raise ValueError("it answers, but no SYNC is received")
            time.sleep(0.01)

    def read(self) -> Scans:
        """Return the scans that have arrived; none if nothing came within 0.1 s."""
        if self._member is None or self._heartbeat is None or self._thermometer is None:
            raise DeviceLost(str(self._address), "is not open")
        self._ask(self._thermometer)
        self._member.gather(GATHER_SECONDS)
        chunks = self._chunks(self._member)
        if chunks:
            self._heartbeat.note_scans()
        if trouble := self._heartbeat.trouble() or self._missing_sync(self._heartbeat):
            raise DeviceLost(str(self._address), trouble)
        warning = self._heartbeat.warning()
        if not chunks:
            return Scans(np.empty((0, 3), np.int32), np.empty(0, np.int32), float("nan"), 0, warning=warning)
        before = self._decoder.bad_frames
        counts, counter = self._decoded(chunks)
        return Scans(
            counts=counts,
            counter=counter,
            temperature=self._thermometer.celsius,
            bad_bytes=8 * (self._decoder.bad_frames - before),
            age=time.perf_counter_ns() - chunks[-1].arrived,
            clock=self._clock,
            warning=warning,
        )

    def _ask(self, thermometer: Thermometer) -> None:
        try:
            thermometer.ask_if_due()
        except _ERRORS as error:
            raise DeviceLost(str(self._address), f"its temperature cannot be read: {bus_reason(error)}") from error

    def _chunks(self, member: Member) -> list[DeviceFrames]:
        """Wait for frames and return those that are numbered by one start of SYNC."""
        chunks = [*self._held, *member.take(0.0 if self._held else _READ_SECONDS)]
        same = [chunk for chunk in chunks if chunk.clock == chunks[0].clock]
        self._held = chunks[len(same) :]  # starts follow one another
        return same

    def _decoded(self, chunks: list[DeviceFrames]) -> tuple[IntArray, IntArray | IndexArray]:
        """Return counts (n, 3), and the counter (n,) or on SYNC the number of that."""
        syncs = np.concatenate([chunk.syncs for chunk in chunks])
        counts, counter, syncs = self._decoder.feed_synced(concatenate([chunk.frames for chunk in chunks]), syncs)
        if not self._address.sync or not len(counts):
            return counts, counter
        if self._clock != chunks[0].clock:
            self._synced, self._clock = SyncedCounter(), chunks[0].clock
        try:
            return counts, self._synced.numbers(counter, syncs)
        except ValueError as error:
            raise DeviceLost(str(self._address), str(error)) from error

    def _missing_sync(self, heartbeat: HeartbeatConsumer) -> str:
        """Return that there is no SYNC, if so; empty if there is, or it needs none."""
        silent = self._address.sync and heartbeat.alive and heartbeat.silence > _SYNC_SECONDS
        return "the device is alive, but no SYNC is received: its producer has failed" if silent else ""

    def close(self) -> None:
        """Stop the device if it still listens, and leave the bus."""
        member, self._member, self._heartbeat = self._member, None, None
        if self._thermometer is not None:
            self._thermometer.close()
            self._thermometer = None
        if member is None:
            return
        try:
            member.hub.network[self._address.node].nmt.send_command(_PRE_OPERATIONAL)
            if self._address.sync == "producer":
                end_sync(member.hub.network, self._address.node)
        except _ERRORS:
            pass  # it is gone: nothing to stop
        finally:
            del member.hub.network[self._address.node]
            leave_bus(member)
