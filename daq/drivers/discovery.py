"""Search for connected hardware: serial ports, CAN adapters and the devices that respond on them."""

import logging
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from serial.tools import list_ports

from daq.drivers.base import PortAnswer
from daq.drivers.network.ports import network_address
from daq.drivers.serial.line import open_line
from daq.errors import DriverError, system_reason

_BAUD = 9600  # of a line that is opened as a test only [bit/s]
_BY_ID = Path("/dev/serial/by-id")
#: devices searched for at a port, in this order; modules are imported when used
_SEARCHES = (
    "daq.drivers.serial.epson_uart",
    "daq.drivers.can.search",
    "daq.drivers.serial.node",
    "daq.drivers.serial.witmotion",
    "daq.drivers.serial.text_search",
)
#: devices searched for at an address of a network
_NETWORK_SEARCHES = ("daq.drivers.network.raspberry_shake", "daq.drivers.serial.text_search")
#: adapters that python-can finds without waiting for a network
_INTERFACES = ("socketcan", "pcan", "kvaser", "vector", "ixxat", "neovi")


@dataclass(frozen=True, kw_only=True)
class SerialPortInfo:
    """A serial port of this machine."""

    device: str  #: path that the system gave it, which may change when something is plugged in
    by_id: str | None  #: path that stays with the device, if there is one
    description: str
    is_usb: bool

    @property
    def path(self) -> str:
        """The path to write into settings."""
        return self.by_id or self.device


def serial_ports(by_id: Path = _BY_ID) -> list[SerialPortInfo]:
    """Return the serial ports of this machine.

    Parameters
    ----------
    by_id : folder with links that stay with a device, as Linux makes them
    """
    links = {str(link.resolve()): str(link) for link in sorted(by_id.glob("*"))}
    return [
        SerialPortInfo(
            device=port.device,
            by_id=links.get(str(Path(port.device).resolve())),
            description="" if port.description == "n/a" else port.description,
            is_usb=port.vid is not None,
        )
        for port in sorted(list_ports.comports(), key=lambda port: str(port.device))
    ]


def can_adapters() -> list[tuple[str, str]]:
    """Return (interface, channel) of the CAN adapters that python-can finds; those on serial ports are found there."""
    logging.getLogger("can").addHandler(logging.NullHandler())  # vendors' libraries that are missing are no news
    found = import_module("daq.protocol.can_library").can.detect_available_configs(interfaces=_INTERFACES)
    return [(str(config["interface"]), str(config["channel"])) for config in found]


def search_port(path: str, bitrate: int = 1_000_000) -> PortAnswer | None:
    """Query a port for every known kind of device; None if none answers.

    Each type is queried in its own protocol, which the others ignore as noise. A device that was sampling may stop.

    Parameters
    ----------
    path : of the port, or its address on a network
    bitrate : at which nodes are sought, behind a CAN adapter [bit/s]

    Raises
    ------
    DriverError
        If the port cannot be opened, or is in use.
    """
    try:
        if address := network_address(path):
            address.open().close()
        else:
            open_line(path, _BAUD).close()
    except (OSError, ValueError) as error:
        raise DriverError(path, f"cannot be opened: {system_reason(error)}") from error
    for module in _NETWORK_SEARCHES if address else _SEARCHES:
        answer: PortAnswer | None = import_module(module).search(path, bitrate)
        if answer is not None:
            return answer
    return None
