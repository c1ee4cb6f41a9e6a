"""Epson M-A552AC1x on a CAN bus that several devices share."""

import time
from typing import Any

import can
import canopen
import numpy as np
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError, SdoError

from daq.can_address import CanAddress
from daq.drivers.base import Scans
from daq.drivers.can_hub import Member, join_bus, leave_bus
from daq.drivers.heartbeat import PERIOD_MS, HeartbeatConsumer
from daq.errors import DeviceLost, DriverError
from daq.protocol import epson_can as epson
from daq.protocol.frames import concatenate

_READ_SECONDS = 0.1
_QUIET_SECONDS = 0.03
_APPLY_SECONDS = 4.0  # a device takes about one
_START, _PRE_OPERATIONAL = 1, 128  # NMT commands
_ERRORS = (SdoError, can.CanError, OSError, ValueError)


class EpsonCan:
    """Driver of one device.

    Parameters
    ----------
    address : bus and node
    rate : scans a second, one of 50, 100, 200, 500, 1000 [Hz]

    Raises
    ------
    ValueError
        If the device has no such rate.
    """

    scale = epson.SCALE
    modulus = epson.MODULUS

    def __init__(self, address: CanAddress, rate: float) -> None:
        if rate not in epson.RATES:
            raise ValueError(f"rate of {address}: expected one of {sorted(epson.RATES)} Hz, found {rate:g}")
        self._address, self._rate = address, int(rate)
        self._member: Member | None = None
        self._heartbeat: HeartbeatConsumer | None = None
        self._decoder = epson.ScanDecoder(address.node)

    def open(self) -> dict[str, Any]:
        """Join the bus, check who answers, set rate, filter, process data and heartbeat, start it."""
        number = self._address.node
        member = join_bus(self._address, frozenset({epson.TPDO1 + number, epson.TPDO2 + number}))
        self._member, node = member, member.hub.add_node(number)
        try:
            identity = self._configure(member, node)
        except _ERRORS as error:
            self.close()
            raise DriverError(str(self._address), f"no M-A552 answers: {error}") from error
        return identity

    def _configure(self, member: Member, node: canopen.RemoteNode) -> dict[str, Any]:
        node.nmt.send_command(_PRE_OPERATIONAL)
        self._wait_until_quiet(member)
        identity = identify(node)
        period, taps = epson.RATES[self._rate]
        _write(node, epson.PERIOD, period, 4)
        _write(node, epson.FILTER, taps, 1)
        _write(node, epson.TRANSMISSION, epson.BY_TIMER, 1)
        _write(node, epson.TPDO1_COB, epson.COB_NO_RTR | epson.TPDO1 + self._address.node, 4)
        _write(node, epson.TPDO2_COB, epson.COB_NO_RTR | epson.TPDO2 + self._address.node, 4)
        self._apply(node, period, taps)
        _write(node, epson.HEARTBEAT, PERIOD_MS, 2)
        self._decoder = epson.ScanDecoder(self._address.node)
        self._heartbeat = HeartbeatConsumer(node)
        node.nmt.send_command(_START)
        return identity

    @staticmethod
    def _wait_until_quiet(member: Member) -> None:
        """Throw away what an earlier run's sampling still sends."""
        end = time.monotonic() + 1.0
        while member.take(_QUIET_SECONDS):
            if time.monotonic() > end:
                raise ValueError("it does not stop sampling")

    @staticmethod
    def _apply(node: canopen.RemoteNode, period: int, taps: int) -> None:
        """Make the device take what it was told, and wait until it answers again."""
        _write(node, epson.APPLY, epson.APPLY_NOW, 1)
        end = time.monotonic() + _APPLY_SECONDS
        while True:
            try:
                found = _number(node, epson.PERIOD), _number(node, epson.FILTER)
                break
            except SdoCommunicationError:
                if time.monotonic() > end:
                    raise
        if found != (period, taps):
            raise ValueError(f"period and filter: expected {(period, taps)}, found {found}")

    def read(self) -> Scans:
        """Return the scans that have arrived; none if nothing came within 0.1 s."""
        if self._member is None or self._heartbeat is None:
            raise DeviceLost(str(self._address), "is not open")
        chunks = self._member.take(_READ_SECONDS)
        if chunks:
            self._heartbeat.note_scans()
        if trouble := self._heartbeat.trouble():
            raise DeviceLost(str(self._address), trouble)
        warning = self._heartbeat.warning()
        if not chunks:
            return Scans(np.empty((0, 3), np.int32), np.empty(0, np.int32), float("nan"), 0, warning=warning)
        before = self._decoder.bad_frames
        counts, counter = self._decoder.feed(concatenate([chunk.frames for chunk in chunks]))
        return Scans(
            counts=counts,
            counter=counter,
            temperature=float("nan"),  # its process data carry none
            bad_bytes=8 * (self._decoder.bad_frames - before),
            age=time.perf_counter_ns() - chunks[-1].arrived,
            warning=warning,
        )

    def close(self) -> None:
        """Stop the device if it still listens, and leave the bus."""
        member, self._member, self._heartbeat = self._member, None, None
        if member is None:
            return
        try:
            member.hub.network[self._address.node].nmt.send_command(_PRE_OPERATIONAL)
        except _ERRORS:
            pass  # it is gone: nothing to stop
        finally:
            del member.hub.network[self._address.node]
            leave_bus(member)


def identify(node: canopen.RemoteNode) -> dict[str, Any]:
    """Ask a node who it is; a `canopen.SdoError` if it does not say."""
    return {
        "product": _text(node, epson.DEVICE_NAME),
        "hardware": _text(node, epson.HARDWARE),
        "version": _text(node, epson.SOFTWARE),
        "serial": _serial(node),
    }


def _text(node: canopen.RemoteNode, place: tuple[int, int]) -> str:
    return bytes(node.sdo.upload(*place)).decode("ascii", "replace").strip("\0 ")


def _number(node: canopen.RemoteNode, place: tuple[int, int]) -> int:
    return int.from_bytes(node.sdo.upload(*place), "little")


def _serial(node: canopen.RemoteNode) -> str:
    """Return the serial number, empty if the device keeps none (CiA 301 does not ask for it)."""
    try:
        return str(_number(node, epson.SERIAL))
    except SdoAbortedError:
        return ""


def _write(node: canopen.RemoteNode, place: tuple[int, int], value: int, size: int) -> None:
    node.sdo.download(*place, value.to_bytes(size, "little"))
