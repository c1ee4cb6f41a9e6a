"""Options of reading a file of measurements."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from daq.files.columns.calibration import Calibration
from daq.files.columns.date_cells import DATE_ORDERS
from daq.files.columns.time_column import TIME_UNITS
from daq.files.columns.units import Sensitivity, parse_unit


@dataclass(frozen=True, kw_only=True)
class DataOptions:
    """Properties of a file of measurements that the user states."""

    rate: float | None = None  #: samples per second [Hz], if not in the file
    factor: float | None = None  #: `unit` per number of the file. Default: by the names of its columns, or 1
    unit: str | None = None  #: unit of all channels. Default: by the names of the columns, or m/s2
    sensitivity: Sensitivity | None = None  #: of all channels in volts or counts
    calibration: Mapping[str, Calibration] = field(default_factory=dict)  #: by channel
    start: int | None = None  #: time of the first sample [ns UTC]. Default: from a column of dates, else 0
    time: str | None = None  #: name of the column of times. Default: found by `time_column`
    time_unit: str | None = None  #: unit of `TIME_UNITS`. Default: that of the column's name, or s
    date_order: str | None = None  #: of dates as 01/02/2026. Default: by the dates, where one order is possible
    names: Sequence[str] | None = None  #: names of all columns of a table in their order, "" for one to leave out
    columns: Mapping[str, str] | None = None  #: columns to read -> names of their channels; see `signals_of`
    velocities: Collection[str] = ()  #: channels that hold velocities [m/s, after `factor`]
    temperature: str | None = None  #: column of temperatures. Default: found by `temperatures_of`
    transposed: bool | None = None  #: whether rows of an array are channels; see `read_arrays`
    high_pass: float | None = None  #: cut-off frequency of a high-pass filter [Hz]. Default: none
    resample: float | None = None  #: samples per second to convert to [Hz]. Default: those of the file

    def __post_init__(self) -> None:
        """Refuse invalid options."""
        if not all(number is None or number > 0 for number in (self.rate, self.factor)):
            raise ValueError(f"rate and factor: expected positive numbers, found {self.rate} and {self.factor}")
        if not all(number is None or number > 0 for number in (self.high_pass, self.resample)):
            raise ValueError(
                f"high_pass and resample: expected positive numbers, found {self.high_pass} and {self.resample}"
            )
        if self.unit is not None and parse_unit(self.unit) is None:
            raise ValueError(f"unit: expected a unit of motion, V, mV or counts, found {self.unit!r}")
        if self.time_unit is not None and self.time_unit not in TIME_UNITS:
            raise ValueError(f"time_unit: expected one of {', '.join(TIME_UNITS)}, found {self.time_unit!r}")
        if self.date_order is not None and self.date_order not in DATE_ORDERS:
            raise ValueError(f"date_order: expected one of {', '.join(DATE_ORDERS)}, found {self.date_order!r}")
        if self.columns is not None and len(set(self.columns.values())) < len(self.columns):
            raise ValueError(f"columns: expected different names, found {', '.join(self.columns.values())}")
        if self.names is not None:
            named = [name for name in self.names if name]
            if len(set(named)) < len(named) or not named:
                raise ValueError(f"names: expected different names, found {', '.join(self.names)}")
