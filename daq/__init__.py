"""Bytes in, recordings out: drivers, emulators, the MCAP log, and blocks of many devices on one grid."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from daq.drivers.base import CanAddress as CanAddress
    from daq.drivers.base import DbcAddress as DbcAddress
    from daq.drivers.base import DbcSensor as DbcSensor
    from daq.drivers.base import Driver as Driver
    from daq.drivers.base import LogAddress as LogAddress
    from daq.drivers.base import Scans as Scans
    from daq.drivers.discovery import search_port as search_port
    from daq.drivers.discovery import serial_ports as serial_ports
    from daq.drivers.reader import DeviceReader as DeviceReader
    from daq.drivers.registry import driver_names as driver_names
    from daq.drivers.registry import make_driver as make_driver
    from daq.errors import DaqError as DaqError
    from daq.errors import DataError as DataError
    from daq.errors import DbcError as DbcError
    from daq.errors import DeviceLost as DeviceLost
    from daq.errors import DriverError as DriverError
    from daq.errors import LogError as LogError
    from daq.files.export import export_recording as export_recording
    from daq.files.export import write_recording as write_recording
    from daq.files.export import write_recordings as write_recordings
    from daq.files.measurement_file import read_data as read_data
    from daq.files.measurement_file import read_measured as read_measured
    from daq.files.options import DataOptions as DataOptions
    from daq.log.mcap_log import McapWriter as McapWriter
    from daq.log.mcap_log import read_attachments as read_attachments
    from daq.log.mcap_log import read_events as read_events
    from daq.log.mcap_log import read_log as read_log
    from daq.log.parts import AnyLog as AnyLog
    from daq.log.parts import LogExcerpt as LogExcerpt
    from daq.log.recordings import load_recordings as load_recordings
    from daq.log.repair import inspect_log as inspect_log
    from daq.log.repair import repair_log as repair_log
    from daq.timing.host_clock import HostClock as HostClock
    from daq.timing.host_clock import ScaledClock as ScaledClock
    from daq.timing.host_clock import SystemClock as SystemClock
    from daq.timing.resampling import Assembler as Assembler
    from daq.types import Block as Block
    from daq.types import BoolArray as BoolArray
    from daq.types import Channel as Channel
    from daq.types import ComplexArray as ComplexArray
    from daq.types import DeviceIdentity as DeviceIdentity
    from daq.types import Event as Event
    from daq.types import Flag as Flag
    from daq.types import FloatArray as FloatArray
    from daq.types import Gap as Gap
    from daq.types import IndexArray as IndexArray
    from daq.types import IntArray as IntArray
    from daq.types import Item as Item
    from daq.types import Recording as Recording
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
