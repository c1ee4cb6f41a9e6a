"""The MCAP log of a run: writers, readers, repair and retention.

The analysis process is fed by the writer thread: all analysed data are logged.
"""

from daq.log.channel_map import CHANNELS, ChannelMap
from daq.log.format.progress import progress_reported_to, report_progress
from daq.log.mcap_log import log_span, log_start, read_attachments, read_log
from daq.log.naming import as_logs, newest_log
from daq.log.parts import BEGINNING, END, LogExcerpt, PartedLog, files_of
from daq.log.recordings import HOW_TO_PLACE, absent_devices, load_recordings, read_channel_map
from daq.log.repair import LogState, has_end
from daq.log.resilient_writer import ResilientWriter
from daq.log.retention import DiskGuard, Retention
from daq.log.rotating_writer import RotatingWriter, Rotation
from daq.log.summary import DeviceInfo, LogInfo, log_info
from daq.log.writer_thread import WriterThread

__all__ = [
    "BEGINNING",
    "CHANNELS",
    "END",
    "HOW_TO_PLACE",
    "ChannelMap",
    "DeviceInfo",
    "DiskGuard",
    "LogExcerpt",
    "LogInfo",
    "LogState",
    "PartedLog",
    "ResilientWriter",
    "Retention",
    "RotatingWriter",
    "Rotation",
    "WriterThread",
    "absent_devices",
    "as_logs",
    "files_of",
    "has_end",
    "load_recordings",
    "log_info",
    "log_span",
    "log_start",
    "newest_log",
    "progress_reported_to",
    "read_attachments",
    "read_channel_map",
    "read_log",
    "report_progress",
]
