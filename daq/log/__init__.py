"""The MCAP log of a run: writers, readers, repair and retention.

The analysis process is fed by the writer thread: all analysed data are logged.
"""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from daq.log.channel_map import CHANNELS as CHANNELS
    from daq.log.channel_map import ChannelMap as ChannelMap
    from daq.log.format.progress import progress_reported_to as progress_reported_to
    from daq.log.format.progress import report_progress as report_progress
    from daq.log.mcap_log import log_span as log_span
    from daq.log.mcap_log import log_start as log_start
    from daq.log.mcap_log import read_attachments as read_attachments
    from daq.log.mcap_log import read_log as read_log
    from daq.log.mcap_log import read_part as read_part
    from daq.log.naming import as_logs as as_logs
    from daq.log.naming import newest_log as newest_log
    from daq.log.parts import BEGINNING as BEGINNING
    from daq.log.parts import END as END
    from daq.log.parts import LogExcerpt as LogExcerpt
    from daq.log.parts import PartedLog as PartedLog
    from daq.log.parts import files_of as files_of
    from daq.log.recordings import HOW_TO_PLACE as HOW_TO_PLACE
    from daq.log.recordings import absent_devices as absent_devices
    from daq.log.recordings import load_recordings as load_recordings
    from daq.log.recordings import read_channel_map as read_channel_map
    from daq.log.recordings import used_axes as used_axes
    from daq.log.repair import LogState as LogState
    from daq.log.repair import has_end as has_end
    from daq.log.repair import repair_folder as repair_folder
    from daq.log.resilient_writer import ResilientWriter as ResilientWriter
    from daq.log.retention import DiskGuard as DiskGuard
    from daq.log.retention import Retention as Retention
    from daq.log.rotating_writer import RotatingWriter as RotatingWriter
    from daq.log.rotating_writer import Rotation as Rotation
    from daq.log.summary import DeviceInfo as DeviceInfo
    from daq.log.summary import LogInfo as LogInfo
    from daq.log.summary import log_info as log_info
    from daq.log.writer_thread import WriterThread as WriterThread
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
