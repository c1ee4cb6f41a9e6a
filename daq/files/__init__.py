"""Files of measurements of other programs: read into recordings, and written."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from daq.files.archive_size import DAMAGED_FILE as DAMAGED_FILE
    from daq.files.archive_size import check_archive as check_archive
    from daq.files.can.traffic import CAN_LOGS as CAN_LOGS
    from daq.files.can.traffic import LoggedSensor as LoggedSensor
    from daq.files.can.traffic import import_can_log as import_can_log
    from daq.files.columns.calibration import Calibration as Calibration
    from daq.files.columns.calibration import read_calibration as read_calibration
    from daq.files.columns.headings import temperatures_of as temperatures_of
    from daq.files.columns.temperatures import celsius as celsius
    from daq.files.columns.time_column import TIME_UNITS as TIME_UNITS
    from daq.files.columns.time_column import date_column as date_column
    from daq.files.columns.time_column import header_unit as header_unit
    from daq.files.columns.time_column import time_column as time_column
    from daq.files.columns.units import ACCELERATIONS as ACCELERATIONS
    from daq.files.columns.units import Sensitivity as Sensitivity
    from daq.files.columns.units import acceleration as acceleration
    from daq.files.columns.units import parse_sensitivity as parse_sensitivity
    from daq.files.columns.units import parse_unit as parse_unit
    from daq.files.export import with_channels as with_channels
    from daq.files.export import write_recording as write_recording
    from daq.files.formats.mat import read_mat as read_mat
    from daq.files.formats.registry import FORMATS as FORMATS
    from daq.files.formats.universal.geometry import Geometry as Geometry
    from daq.files.formats.universal.geometry import read_geometry as read_geometry
    from daq.files.formats.universal.header import Header as Header
    from daq.files.formats.universal.header import header_set as header_set
    from daq.files.formats.universal.header import read_header as read_header
    from daq.files.formats.universal.responses import FrequencyResponses as FrequencyResponses
    from daq.files.formats.universal.responses import read_responses as read_responses
    from daq.files.formats.universal.responses import write_responses as write_responses
    from daq.files.measured import Measured as Measured
    from daq.files.measured import differentiated as differentiated
    from daq.files.measurement_file import read_data as read_data
    from daq.files.message_export import expand_log as expand_log
    from daq.files.sequence import in_order as in_order
    from daq.files.sequence import read_in_order as read_in_order
    from daq.files.tables.text_table import is_table as is_table
    from daq.files.tables.text_table import read_rows as read_rows
    from daq.files.tables.text_table import table_layout as table_layout
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
