"""Drivers of devices: ports, time-outs, reconnection, and blocks from scans."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from daq.drivers.base import (
        CanPlace,
        DaqmxAddress,
        Driver,
        Found,
        PortAnswer,
        Scans,
        TextAddress,
    )
    from daq.drivers.can.dbc_file import read_layout
    from daq.drivers.discovery import SerialPortInfo, can_adapters, serial_ports
    from daq.drivers.ni_daqmx import daqmx_devices
    from daq.drivers.registry import can_interfaces, driver_names, low_grade
    from daq.protocol.epson import SCALE as EPSON_SCALE
    from daq.protocol.text_line import LineFormat
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "EPSON_SCALE",
    "CanPlace",
    "DaqmxAddress",
    "Driver",
    "Found",
    "LineFormat",
    "PortAnswer",
    "Scans",
    "SerialPortInfo",
    "TextAddress",
    "can_adapters",
    "can_interfaces",
    "daqmx_devices",
    "driver_names",
    "low_grade",
    "read_layout",
    "serial_ports",
]
