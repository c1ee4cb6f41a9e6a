"""Files of measurements of other programs: read into recordings, and written."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from daq.files.archive_size import DAMAGED_FILE, check_archive
    from daq.files.can.traffic import CAN_LOGS, LoggedSensor, import_can_log
    from daq.files.columns.calibration import Calibration, read_calibration
    from daq.files.columns.time_column import TIME_UNITS, date_column, header_unit, time_column
    from daq.files.columns.units import ACCELERATIONS, Sensitivity, acceleration, parse_sensitivity, parse_unit
    from daq.files.dataframe import read_dataframe
    from daq.files.export import with_channels, write_recording
    from daq.files.formats.mat import read_mat
    from daq.files.formats.registry import FORMATS
    from daq.files.formats.universal.geometry import Geometry, read_geometry
    from daq.files.formats.universal.header import Header, header_set, read_header
    from daq.files.formats.universal.responses import FrequencyResponses, read_responses, write_responses
    from daq.files.measured import Measured, differentiated
    from daq.files.measurement_file import read_data
    from daq.files.message_export import expand_log
    from daq.files.sequence import in_order, read_in_order
    from daq.files.tables.text_table import is_table, read_rows, table_layout
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "ACCELERATIONS",
    "CAN_LOGS",
    "DAMAGED_FILE",
    "FORMATS",
    "TIME_UNITS",
    "Calibration",
    "FrequencyResponses",
    "Geometry",
    "Header",
    "LoggedSensor",
    "Measured",
    "Sensitivity",
    "acceleration",
    "check_archive",
    "date_column",
    "differentiated",
    "expand_log",
    "header_set",
    "header_unit",
    "import_can_log",
    "in_order",
    "is_table",
    "parse_sensitivity",
    "parse_unit",
    "read_calibration",
    "read_data",
    "read_dataframe",
    "read_geometry",
    "read_header",
    "read_in_order",
    "read_mat",
    "read_responses",
    "read_rows",
    "table_layout",
    "time_column",
    "with_channels",
    "write_recording",
    "write_responses",
]
