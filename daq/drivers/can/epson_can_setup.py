"""Setup of an M-A552 by service data before it samples."""

import time

import canopen
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from daq.drivers.base import CanAddress
from daq.drivers.can.heartbeat import PERIOD_MS
from daq.protocol import epson_can as epson
from daq.protocol.epson_filters import FILTERS
from daq.types import DeviceIdentity

_APPLY_SECONDS = 4.0  # a device takes about one
_ASK_SECONDS = 0.05
_EXPEDITED = 0x23  # SDO command: write four bytes
_SDO_REQUEST = 0x600


def configure(node: canopen.RemoteNode, address: CanAddress, rate: int) -> None:
    """Set rate [Hz], filter, sampling trigger, process data and heartbeat; errors of `canopen`, or ValueError."""
    period, number = epson.RATES[rate], FILTERS[rate]
    if address.sync:
        _write(node, epson.SYNC_COB, epson.SYNC, 4)  # an earlier run's SYNC ends
    if address.sync == "producer":
        _write(node, epson.SYNC_PERIOD, 1000 * period, 4)
    _write(node, epson.PERIOD, period, 4)
    _write(node, epson.FILTER, number, 1)
    _write(node, epson.TRANSMISSION, epson.BY_SYNC if address.sync else epson.BY_TIMER, 1)
    _write(node, epson.TPDO1_COB, epson.COB_NO_RTR | epson.TPDO1 + address.node, 4)
    _write(node, epson.TPDO2_COB, epson.COB_NO_RTR | epson.TPDO2 + address.node, 4)
    _apply(node, period, number)
    _write(node, epson.HEARTBEAT, PERIOD_MS, 2)


def _apply(node: canopen.RemoteNode, period: int, number: int) -> None:
    """Apply the settings of the device, and wait until it answers again."""
    _write(node, epson.APPLY, epson.APPLY_NOW, 1)
    end, patience = time.monotonic() + _APPLY_SECONDS, node.sdo.RESPONSE_TIMEOUT
    node.sdo.RESPONSE_TIMEOUT = _ASK_SECONDS  # requests are not answered during this time
    while True:
        try:
            found = _number(node, epson.PERIOD), _number(node, epson.FILTER)
            break
        except SdoCommunicationError:
            if time.monotonic() > end:
                raise
    node.sdo.RESPONSE_TIMEOUT = patience
    if found != (period, number):
        raise ValueError(f"period and filter: expected {(period, number)}, found {found}")


def produce_sync(node: canopen.RemoteNode) -> None:
    """Let a node send SYNC from now on."""
    _write(node, epson.SYNC_COB, epson.SYNC_PRODUCER | epson.SYNC, 4)


def end_sync(network: canopen.Network, number: int) -> None:
    """Stop the SYNC of a node without waiting for a reply, because it may be gone."""
    index, subindex = epson.SYNC_COB
    place = index.to_bytes(2, "little") + bytes([subindex])
    network.send_message(_SDO_REQUEST + number, bytes([_EXPEDITED]) + place + epson.SYNC.to_bytes(4, "little"))


def identify(node: canopen.RemoteNode) -> DeviceIdentity:
    """Read the identity of a node; `canopen.SdoError` if it does not answer."""
    return DeviceIdentity(
        product=_text(node, epson.DEVICE_NAME),
        hardware=_text(node, epson.HARDWARE),
        version=_text(node, epson.SOFTWARE),
        serial=_serial(node),
    )


def _text(node: canopen.RemoteNode, place: tuple[int, int]) -> str:
    return bytes(node.sdo.upload(*place)).decode("ascii", "replace").strip("\0 ")


def _number(node: canopen.RemoteNode, place: tuple[int, int]) -> int:
    return int.from_bytes(node.sdo.upload(*place), "little")


def _serial(node: canopen.RemoteNode) -> str:
    """Return the serial number, empty if the device has none (CiA 301 does not require it)."""
    try:
        return str(_number(node, epson.SERIAL))
    except SdoAbortedError:
        return ""


def _write(node: canopen.RemoteNode, place: tuple[int, int], value: int, size: int) -> None:
    node.sdo.download(*place, value.to_bytes(size, "little"))
