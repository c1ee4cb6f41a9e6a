"""Bytes in, recordings out: drivers, emulators, the MCAP log, and blocks of many devices on one grid."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from daq.drivers.base import CanAddress, DbcAddress, DbcSensor, Driver, LogAddress, Scans
    from daq.drivers.discovery import search_port, serial_ports
    from daq.drivers.reader import DeviceReader
    from daq.drivers.registry import driver_names, make_driver
    from daq.errors import DaqError, DataError, DbcError, DeviceLost, DriverError, LogError
    from daq.files.dataframe import read_dataframe
    from daq.files.export import export_recording, write_recording, write_recordings
    from daq.files.measurement_file import read_data, read_measured
    from daq.files.options import DataOptions
    from daq.log.mcap_log import McapWriter, read_attachments, read_events, read_log
    from daq.log.parts import AnyLog, LogExcerpt
    from daq.log.recordings import load_recordings
    from daq.log.repair import inspect_log, repair_log
    from daq.timing.host_clock import HostClock, ScaledClock, SystemClock
    from daq.timing.resampling import Assembler
    from daq.types import (
        Block,
        Channel,
        DeviceIdentity,
        Event,
        Flag,
        FloatArray,
        Gap,
        IndexArray,
        IntArray,
        Item,
        Recording,
    )
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "AnyLog",
    "Assembler",
    "Block",
    "CanAddress",
    "Channel",
    "DaqError",
    "DataError",
    "DataOptions",
    "DbcAddress",
    "DbcError",
    "DbcSensor",
    "DeviceIdentity",
    "DeviceLost",
    "DeviceReader",
    "Driver",
    "DriverError",
    "Event",
    "Flag",
    "FloatArray",
    "Gap",
    "HostClock",
    "IndexArray",
    "IntArray",
    "Item",
    "LogAddress",
    "LogError",
    "LogExcerpt",
    "McapWriter",
    "Recording",
    "ScaledClock",
    "Scans",
    "SystemClock",
    "driver_names",
    "export_recording",
    "inspect_log",
    "load_recordings",
    "make_driver",
    "read_attachments",
    "read_data",
    "read_dataframe",
    "read_events",
    "read_log",
    "read_measured",
    "repair_log",
    "search_port",
    "serial_ports",
    "write_recording",
    "write_recordings",
]
