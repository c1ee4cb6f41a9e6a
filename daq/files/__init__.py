"""Files of measurements of other programs: read into recordings, and written."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from daq.files.archive_size import DAMAGED_FILE, check_archive
    from daq.files.can.traffic import CAN_LOGS, ImportedSensor, LoggedSensor, import_can_log
    from daq.files.columns.headings import ACCELERATIONS, acceleration
    from daq.files.columns.time_column import TIME_UNITS
    from daq.files.dataframe import read_dataframe
    from daq.files.differentiation import differentiated
    from daq.files.export import export_recording, with_channels, write_recording, write_recordings
    from daq.files.measurement_file import DataOptions, Measured, read_data, read_measured
    from daq.files.message_export import expand_log
    from daq.files.sequence import in_order, read_in_order
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "ACCELERATIONS",
    "CAN_LOGS",
    "DAMAGED_FILE",
    "TIME_UNITS",
    "DataOptions",
    "ImportedSensor",
    "LoggedSensor",
    "Measured",
    "acceleration",
    "check_archive",
    "differentiated",
    "expand_log",
    "export_recording",
    "import_can_log",
    "in_order",
    "read_data",
    "read_dataframe",
    "read_in_order",
    "read_measured",
    "with_channels",
    "write_recording",
    "write_recordings",
]
