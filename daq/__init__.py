"""Bytes in, recordings out: drivers, emulators, the MCAP log, and blocks of many devices on one grid."""

from daq.bounded_text import one_line, parse_json, parse_toml, printable
from daq.drivers.addresses import CanAddress, CanPlace, DbcAddress, DbcSensor, Found, LogAddress, PortAnswer
from daq.drivers.base import Driver, Scans
from daq.drivers.can.dbc_file import read_layout
from daq.drivers.discovery import SerialPortInfo, can_adapters, search_port, serial_ports
from daq.drivers.reader import DeviceReader
from daq.drivers.registry import can_interfaces, driver_names, low_grade, make_driver
from daq.emulator.can_dbc import EmulatedDbc
from daq.emulator.epson import EmulatedEpson
from daq.emulator.epson_can import EmulatedEpsonCan
from daq.emulator.line_faults import LineFaults, LineSpell
from daq.emulator.node import EmulatedNode
from daq.emulator.serving import EmulatedPort, SampleSource, serve_all, unplugging
from daq.emulator.slcan import EmulatedSlcan
from daq.emulator.witmotion import EmulatedWitmotion
from daq.emulator.witmotion_can import EmulatedWitmotionCan
from daq.errors import DaqError, DataError, DbcError, DeviceLost, DriverError, LogError
from daq.files.archive_size import DAMAGED_FILE, check_archive
from daq.files.can.traffic import CAN_LOGS, ImportedSensor, LoggedSensor, import_can_log
from daq.files.columns.headings import ACCELERATIONS, acceleration
from daq.files.columns.time_column import TIME_UNITS
from daq.files.differentiation import differentiated
from daq.files.export import export_recording, with_channels, write_recording, write_recordings
from daq.files.measurement_file import DataOptions, Measured, read_data, read_measured
from daq.files.message_export import expand_log
from daq.files.sequence import in_order, read_in_order
from daq.log.channel_map import CHANNELS, ChannelMap
from daq.log.mcap_log import McapWriter, log_span, read_attachments, read_events, read_log
from daq.log.naming import as_logs, newest_log
from daq.log.parts import BEGINNING, END, AnyLog, LogExcerpt, PartedLog, files_of
from daq.log.recordings import HOW_TO_PLACE, absent_devices, load_recordings, read_channel_map
from daq.log.repair import LogState, has_end, inspect_log, repair_log
from daq.log.resilient_writer import ResilientWriter
from daq.log.retention import DiskGuard, Retention
from daq.log.rotating_writer import RotatingWriter, Rotation
from daq.log.summary import DeviceInfo, LogInfo, log_info
from daq.log.writer_thread import WriterThread
from daq.protocol.epson import SCALE as EPSON_SCALE
from daq.supervision import FAILURES, Backoff, Failures, SupervisedThread, error_text, short_line
from daq.timing.clock_fit import ClockFit
from daq.timing.host_clock import HostClock, ScaledClock, SystemClock
from daq.timing.resampling import Assembler
from daq.timing.scan_clocks import ScanClock, ScanClocks
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

__all__ = [
    "ACCELERATIONS",
    "BEGINNING",
    "CAN_LOGS",
    "CHANNELS",
    "DAMAGED_FILE",
    "END",
    "EPSON_SCALE",
    "FAILURES",
    "HOW_TO_PLACE",
    "TIME_UNITS",
    "AnyLog",
    "Assembler",
    "Backoff",
    "Block",
    "CanAddress",
    "CanPlace",
    "Channel",
    "ChannelMap",
    "ClockFit",
    "DaqError",
    "DataError",
    "DataOptions",
    "DbcAddress",
    "DbcError",
    "DbcSensor",
    "DeviceIdentity",
    "DeviceInfo",
    "DeviceLost",
    "DeviceReader",
    "DiskGuard",
    "Driver",
    "DriverError",
    "EmulatedDbc",
    "EmulatedEpson",
    "EmulatedEpsonCan",
    "EmulatedNode",
    "EmulatedPort",
    "EmulatedSlcan",
    "EmulatedWitmotion",
    "EmulatedWitmotionCan",
    "Event",
    "Failures",
    "Flag",
    "FloatArray",
    "Found",
    "Gap",
    "HostClock",
    "ImportedSensor",
    "IndexArray",
    "IntArray",
    "Item",
    "LineFaults",
    "LineSpell",
    "LogAddress",
    "LogError",
    "LogExcerpt",
    "LogInfo",
    "LogState",
    "LoggedSensor",
    "McapWriter",
    "Measured",
    "PartedLog",
    "PortAnswer",
    "Recording",
    "ResilientWriter",
    "Retention",
    "RotatingWriter",
    "Rotation",
    "SampleSource",
    "ScaledClock",
    "ScanClock",
    "ScanClocks",
    "Scans",
    "SerialPortInfo",
    "SupervisedThread",
    "SystemClock",
    "WriterThread",
    "absent_devices",
    "acceleration",
    "as_logs",
    "can_adapters",
    "can_interfaces",
    "check_archive",
    "differentiated",
    "driver_names",
    "error_text",
    "expand_log",
    "export_recording",
    "files_of",
    "has_end",
    "import_can_log",
    "in_order",
    "inspect_log",
    "load_recordings",
    "log_info",
    "log_span",
    "low_grade",
    "make_driver",
    "newest_log",
    "one_line",
    "parse_json",
    "parse_toml",
    "printable",
    "read_attachments",
    "read_channel_map",
    "read_data",
    "read_events",
    "read_in_order",
    "read_layout",
    "read_log",
    "read_measured",
    "repair_log",
    "search_port",
    "serial_ports",
    "serve_all",
    "short_line",
    "unplugging",
    "with_channels",
    "write_recording",
    "write_recordings",
]
