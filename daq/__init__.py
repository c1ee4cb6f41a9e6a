"""Bytes in, recordings out: drivers, emulators, the MCAP log, and blocks of many devices on one grid."""

from daq.assembly import Assembler
from daq.drivers.base import DeviceReader, Driver, Scans
from daq.emulator.epson import EmulatedEpson, SampleSource, serve_all, unplugging
from daq.errors import DaqError, DeviceLost, DriverError, LogError
from daq.hostclock import HostClock, ScaledClock, SystemClock
from daq.log import Event, Item, LogThread, LogWriter, read_attachments, read_log
from daq.protocol.epson import SCALE as EPSON_SCALE
from daq.recording import Block, Channel, Flag, FloatArray, Gap, IndexArray, IntArray, Recording
from daq.registry import driver_names, make_driver
from daq.timebase import ClockFit

__all__ = [
    "EPSON_SCALE",
    "Assembler",
    "Block",
    "Channel",
    "ClockFit",
    "DaqError",
    "DeviceLost",
    "DeviceReader",
    "Driver",
    "DriverError",
    "EmulatedEpson",
    "Event",
    "Flag",
    "FloatArray",
    "Gap",
    "HostClock",
    "IndexArray",
    "IntArray",
    "Item",
    "LogError",
    "LogThread",
    "LogWriter",
    "Recording",
    "SampleSource",
    "ScaledClock",
    "Scans",
    "SystemClock",
    "driver_names",
    "make_driver",
    "read_attachments",
    "read_log",
    "serve_all",
    "unplugging",
]
