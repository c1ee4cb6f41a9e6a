"""Drivers of devices: ports, time-outs, reconnection, and blocks from scans."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from daq.drivers.base import CanPlace as CanPlace
    from daq.drivers.base import DaqmxAddress as DaqmxAddress
    from daq.drivers.base import Driver as Driver
    from daq.drivers.base import Found as Found
    from daq.drivers.base import PortAnswer as PortAnswer
    from daq.drivers.base import Scans as Scans
    from daq.drivers.base import TextAddress as TextAddress
    from daq.drivers.can.dbc_file import read_layout as read_layout
    from daq.drivers.discovery import SerialPortInfo as SerialPortInfo
    from daq.drivers.discovery import can_adapters as can_adapters
    from daq.drivers.discovery import serial_ports as serial_ports
    from daq.drivers.ni_daqmx import daqmx_devices as daqmx_devices
    from daq.drivers.registry import can_interfaces as can_interfaces
    from daq.drivers.registry import driver_names as driver_names
    from daq.drivers.registry import low_grade as low_grade
    from daq.protocol.epson import EPSON_SCALE as EPSON_SCALE
    from daq.protocol.text_line import LineFormat as LineFormat
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
