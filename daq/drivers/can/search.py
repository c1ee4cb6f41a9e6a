"""An SLCAN adapter at a serial port, and the accelerometers on its bus."""

import re
import time

import canopen
from canopen.sdo.exceptions import SdoError

from daq.drivers.base import OURS, CanAddress, CanPlace, Found, PortAnswer
from daq.drivers.can.bus import bus_reason
from daq.drivers.can.epson_can_setup import identify
from daq.drivers.can.hub import join_bus, leave_bus
from daq.drivers.serial.base import PORT_ERRORS
from daq.drivers.serial.line import open_line
from daq.errors import DriverError
from daq.protocol import slcan
from daq.protocol.can_library import can
from daq.types import DeviceIdentity

_ACCELEROMETER = "A552"  # in the name of a node that the driver epson-can is for
_ADAPTER_SECONDS = 0.4
_NODES_SECONDS = 0.5
_IS_ADAPTER = re.compile(rb"(?:^|[\r\a])(V[0-9A-Fa-f]{4}|[^\r\a]*CANable[^\r\a]*)\r")


def search(path: str, bitrate: int) -> PortAnswer | None:
    """Search for an adapter, and for nodes on its bus."""
    version = _adapter(path)
    if version is None:
        return None
    nodes = find_nodes(CanPlace(interface=OURS, channel=path, bitrate=bitrate))
    return PortAnswer(who=f"SLCAN adapter {version}", devices=tuple(nodes))


def _adapter(path: str) -> str | None:
    """Return the version of an SLCAN adapter, None if there is no adapter."""
    try:
        with open_line(path, 115_200, timeout=0.05) as line:
            line.reset_input_buffer()
            line.write(b"\r\r" + slcan.CLOSE + b"V\r")
            received, end = b"", time.monotonic() + _ADAPTER_SECONDS
            while time.monotonic() < end and not _IS_ADAPTER.search(received):
                received += line.read(256)
    except PORT_ERRORS:
        return None
    found = _IS_ADAPTER.search(received)
    return found[1].decode("ascii", "replace") if found else None


def find_nodes(bus: CanPlace) -> list[Found]:
    """Query all 127 CANopen nodes of a bus, and return the accelerometers among those that respond.

    Raises
    ------
    DriverError
        If the bus cannot be opened.
    """
    member = join_bus(bus, frozenset())
    try:
        network = member.hub.network
        network.scanner.search()
        time.sleep(_NODES_SECONDS)
        found = []
        for number in sorted(network.scanner.nodes):
            identity = _node_identity(member.hub.add_node(number))
            del network[number]
            if identity and _ACCELEROMETER in identity.product:
                address = CanAddress(interface=bus.interface, channel=bus.channel, bitrate=bus.bitrate, node=number)
                found.append(Found(driver="epson-can", place=address, identity=identity))
        return found
    except (can.CanError, OSError) as error:
        raise DriverError(f"{bus.interface}:{bus.channel}", f"nodes cannot be queried: {bus_reason(error)}") from error
    finally:
        leave_bus(member)


def _node_identity(node: canopen.RemoteNode) -> DeviceIdentity | None:
    """Return the identity of a node, None if it does not answer."""
    try:
        return identify(node)
    except SdoError:
        return None
