"""Files of measurements to recordings."""

import itertools
from collections import Counter
from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from daq.errors import DataError
from daq.files.arrays import read_arrays
from daq.files.columns.headings import Signal, factors, signals_of, temperatures_of, unit_remark
from daq.files.columns.temperatures import known_mean, mean_temperature, temperature_remark
from daq.files.columns.time_column import (
    TIME_UNITS,
    date_column,
    date_remark,
    in_seconds,
    no_times,
    time_column,
    time_remark,
)
from daq.files.columns.time_grid import UnevenError, even_grid
from daq.files.csv import csv_head, csv_origin, read_csv
from daq.files.differentiation import differentiated
from daq.files.origin import Origin
from daq.files.uff import read_universal
from daq.types import Channel, FloatArray, Recording, find_gaps

UNIVERSAL = {".uff", ".unv"}  #: endings of universal files
_MAX_VALUE = 1e20  # m/s2
_MAX_TIME = 4.6e18  # ns since 1970
_MIN_RATE, _MAX_RATE = 1e-6, 1e6  # Hz
_DEVICE = "import"


@dataclass(frozen=True, kw_only=True)
class DataOptions:
    """Properties of a file of measurements that the user states."""

    rate: float | None = None  #: samples per second [Hz], if not in the file
    factor: float | None = None  #: m/s2 per unit of the file. Default: by the names of its columns, or 1
    start: int | None = None  #: time of the first sample [ns UTC]. Default: from a column of dates, else 0
    time: str | None = None  #: name of the column of times. Default: found by `time_column`
    time_unit: str | None = None  #: unit of `TIME_UNITS`. Default: that of the column's name, or s
    columns: Mapping[str, str] | None = None  #: columns to read -> names of their channels; see `signals_of`
    velocities: Collection[str] = ()  #: channels that hold velocities [m/s, after `factor`]
    temperature: str | None = None  #: column of temperatures. Default: found by `temperatures_of`
    transposed: bool | None = None  #: whether rows of an array are channels; see `read_arrays`

    def __post_init__(self) -> None:
        """Refuse invalid options."""
        if not all(number is None or number > 0 for number in (self.rate, self.factor)):
            raise ValueError(f"rate and factor: expected positive numbers, found {self.rate} and {self.factor}")
        if self.time_unit is not None and self.time_unit not in TIME_UNITS:
            raise ValueError(f"time_unit: expected one of {', '.join(TIME_UNITS)}, found {self.time_unit!r}")
        if self.columns is not None and len(set(self.columns.values())) < len(self.columns):
            raise ValueError(f"columns: expected different names, found {', '.join(self.columns.values())}")


@dataclass(frozen=True, eq=False, kw_only=True)
class Measured:
    """Contents of a file of measurements."""

    recording: Recording  #: its temperature is the mean
    temperature: FloatArray  #: (n_samples,) mean of all columns of temperatures [degC], NaN where unknown
    remarks: tuple[str, ...]  #: interpretation of the names of columns
    dated: bool = False  #: whether the start time is in the file


def read_data(
    path: Path,
    *,
    rate: float | None = None,
    factor: float | None = None,
    start: int | None = None,
    time: str | None = None,
    time_unit: str | None = None,
    columns: Mapping[str, str] | None = None,
    velocities: Collection[str] = (),
    temperature: str | None = None,
) -> Recording:
    """Read the recording of a file of measurements: `read_measured` with `DataOptions` of the same names."""
    options = DataOptions(
        rate=rate,
        factor=factor,
        start=start,
        time=time,
        time_unit=time_unit,
        columns=columns,
        velocities=velocities,
        temperature=temperature,
    )
    return read_measured(path, options).recording


def read_measured(path: Path, options: DataOptions) -> Measured:
    """Read a file of measurements: .npz, .mat, universal (.uff, .unv), anything else as a table of text.

    Parameters
    ----------
    path : see `read_csv`, `read_arrays` and `read_universal` for the formats
    options : DataOptions

    Returns
    -------
    Measured
        Accelerations [m/s2]; velocities were differentiated. NaN and empty cells are gaps, and so is a missing stretch
        of times.

    Raises
    ------
    DataError
        Naming the file, and line or field.
    ValueError
        If a channel of `options.velocities` is none.
    """
    found = read_undifferentiated(path, options)
    if not options.velocities:
        return found
    return replace(found, recording=differentiated(found.recording, options.velocities))


def read_undifferentiated(path: Path, options: DataOptions) -> Measured:
    """Read a file as `read_measured` does, but do not differentiate velocities [m/s]."""
    read = _arrays if path.suffix.lower() in {".npz", ".mat", *UNIVERSAL} else _table
    return as_measured(path, read(path, options), options)


def as_measured(path: Path, found: "Columns", options: DataOptions) -> Measured:
    """Return columns in m/s2 (velocities in m/s), with the channels and devices they belong to."""
    by_hand = options.factor
    factor = factors(path, found.signals, options.velocities) if by_hand is None else by_hand
    channels = _channels(found)
    data = found.values * factor
    _check_magnitude(path, found.signals, data)
    temperature = mean_temperature(path, found.warm, found.warmth, found.rate)
    stated = found.origin.start if found.origin else None
    start = next((start for start in (options.start, found.began, stated) if start is not None), 0)
    if not 0 <= start <= _MAX_TIME - len(data) / found.rate * 1e9:
        raise DataError(path, f"time: expected dates from 1970 to 2115, found {start * 1e-9:.6g} s after 1970")
    recording = Recording(
        channels=channels,
        data=data,
        rate=found.rate,
        start=start,
        temperature=known_mean(temperature),
        gaps=find_gaps(channels, data),
    )
    texts = [
        date_remark(found.time, found.began) if found.time and found.began is not None else None,
        time_remark(found.time, options.time_unit) if found.time and found.began is None else None,
        unit_remark(found.signals, options.velocities, by_hand),
        temperature_remark(found.warm, temperature),
        found.origin.remark if found.origin else None,
    ]
    return Measured(
        recording=recording,
        temperature=temperature,
        remarks=tuple(remark for remark in texts if remark),
        dated=found.began is not None or stated is not None,
    )


def _check_magnitude(path: Path, signals: Sequence[Signal], data: FloatArray) -> None:
    """Refuse values that are not accelerations in any unit, whose squares would overflow."""
    largest = np.fmax.reduce(np.abs(data), axis=0, initial=0.0)
    for signal, value in zip(signals, largest.tolist(), strict=True):
        if value > _MAX_VALUE:
            raise DataError(path, f"column {signal.column!r}: expected up to {_MAX_VALUE:g} m/s2, found {value:g}")


@dataclass(frozen=True, eq=False)
class Columns:
    """Signals and temperatures on an even grid, in the units of their source."""

    signals: tuple[Signal, ...]
    warm: tuple[str, ...]  #: columns of temperatures
    every: FloatArray  #: (n_samples, n_signals + n_warm)
    rate: float  #: [Hz]
    time: str | None = None  #: name of the column of times; None if the rate was given
    began: int | None = None  #: when its first date was [ns UTC], if it holds dates
    origin: Origin | None = None  #: origin of an exported file

    @property
    def values(self) -> FloatArray:
        """Signals (n_samples, n_signals)."""
        return self.every[:, : len(self.signals)]

    @property
    def warmth(self) -> FloatArray:
        """Temperatures (n_samples, n_warm)."""
        return self.every[:, len(self.signals) :]


def columns_to_read(
    path: Path, names: Sequence[str], options: DataOptions
) -> tuple[tuple[Signal, ...], tuple[str, ...]]:
    """Return the columns to read in addition to the times: signals and temperatures."""
    warm = temperatures_of(path, [name for name in names if name not in (options.columns or ())], options.temperature)
    others = temperatures_of(path, names, None) if options.columns is None else ()
    signals = signals_of(path, [name for name in names if name not in (*warm, *others)], options.columns)
    return signals, warm


def _table(path: Path, options: DataOptions) -> Columns:
    (every, first), rate, origin = csv_head(path), options.rate, csv_origin(path)
    time = time_column(every, options.time)
    day = date_column(every, first, time)
    signals, warm = columns_to_read(path, [name for name in every if name not in (time, day)], options)
    columns = [*(signal.column for signal in signals), *warm]
    timed = time is not None and (options.columns is None or rate is None)
    known = rate if timed else known_rate(path, rate, None, no_times(every, options.time))
    wanted = None if options.columns is None else {*columns, *(name for name in (time, day) if name and timed)}
    table = read_csv(path, wanted, *((time, day) if timed else ()))
    if not signals:
        raise DataError(path, f"has no column of a channel, but {', '.join(every)}")
    values = table.values[:, [table.names.index(name) for name in columns]]
    if known is not None and not timed:
        return Columns(signals, warm, values, known, origin=origin)
    if time is None or known is not None:
        raise DataError(path, f"has a column {time!r} of times: leave out --rate")
    try:
        t = table.values[:, table.names.index(time)]
        if table.dated:
            name = time if day is None else f"{day} {time}"
            return Columns(signals, warm, *on_grid(t, values), name, 1000 * round(1e6 * float(t[0])), origin)
        t = in_seconds(path, time, t, options.time_unit)
        data, even_rate = on_grid(t, values)
        if origin:  # rows may have been taken out of the beginning
            origin = replace(origin, start=origin.start + round(1e9 * float(t[0])))
        return Columns(signals, warm, data, even_rate, time, origin=origin)
    except UnevenError as error:
        raise DataError(path, f"line {table.line[error.row]}: {error.why}") from error


def _arrays(path: Path, options: DataOptions) -> Columns:
    universal = path.suffix.lower() in UNIVERSAL  # units are in the file itself
    arrays = read_universal(path, options.columns) if universal else read_arrays(path, options.time, options.transposed)
    if universal:
        signals, warm = signals_of(path, arrays.names, options.columns, united=False), tuple[str, ...]()
    else:
        signals, warm = columns_to_read(path, arrays.names, options)
    columns = [*(signal.column for signal in signals), *warm]
    for name in columns:
        if name not in arrays.names:
            raise DataError(path, f"expected a channel {name!r}, found {', '.join(arrays.names)}")
    values = arrays.values[:, [arrays.names.index(name) for name in columns]]
    if arrays.t is None:
        otherwise = f"has neither 'rate' nor {arrays.t_name!r}: give --rate"
        known = known_rate(path, options.rate, arrays.rate, otherwise)
        return Columns(signals, warm, values, known, origin=arrays.origin)
    if len(arrays.t) != len(values):
        raise DataError(path, f"{arrays.t_name}: expected {len(values)} times, found {len(arrays.t)}")
    try:
        t = in_seconds(path, arrays.t_name, arrays.t, options.time_unit)
        return Columns(signals, warm, *on_grid(t, values), arrays.t_name, origin=arrays.origin)
    except UnevenError as error:
        raise DataError(path, f"{arrays.t_name}[{error.row}]: {error.why}") from error


def known_rate(path: Path, given: float | None, found: float | None, otherwise: str) -> float:
    """Return the rate that is given or in the file."""
    rate = given if given is not None else found
    if rate is None:
        raise DataError(path, otherwise)
    if not _MIN_RATE <= rate <= _MAX_RATE:
        raise DataError(path, f"rate: expected a positive number of Hz, {_MIN_RATE:g} to {_MAX_RATE:g}, found {rate:g}")
    return rate


def on_grid(t: FloatArray, values: FloatArray) -> tuple[FloatArray, float]:
    """Return rows at their places on an even grid, NaN between, and its rate."""
    grid = even_grid(t)
    data = np.full((int(grid.index[-1]) + 1, values.shape[1]), np.nan)
    data[grid.index] = values
    return data, grid.rate


def _channels(found: Columns) -> tuple[Channel, ...]:
    """Return the channels on the devices that the file states, else on one; see `devices_of`."""
    places = [found.origin.channel(signal.column) if found.origin else None for signal in found.signals]
    taken = {place.axis for place in places if place and place.device == _DEVICE}
    free = (axis for axis in itertools.count() if axis not in taken)
    stated = [
        replace(place or Channel(name="", device=_DEVICE, axis=next(free)), name=signal.channel)
        for place, signal in zip(places, found.signals, strict=True)
    ]
    return devices_of(stated, [np.packbits(missing).tobytes() for missing in np.isnan(found.values).T])


def devices_of(stated: Sequence[Channel], patterns: Sequence[Hashable]) -> tuple[Channel, ...]:
    """Return channels with devices assigned by their missing samples: one device per pattern."""
    together: dict[tuple[str, Hashable], list[int]] = {}
    for column, (channel, pattern) in enumerate(zip(stated, patterns, strict=True)):
        together.setdefault((channel.device, pattern), []).append(column)
    parts = Counter(device for device, _ in together)
    taken: set[str] = set()
    found: dict[int, Channel] = {}
    for (device, _), columns in together.items():
        others = (f"{device}-{number}" for number in itertools.count(2))
        name = next(name for name in itertools.chain([device], others) if name not in taken | parts.keys() - {device})
        taken.add(name)
        whole = parts[device] == 1  # and so its axes are its own
        for axis, column in enumerate(columns):
            found[column] = replace(stated[column], device=name, axis=stated[column].axis if whole else axis)
    return tuple(found[column] for column in range(len(stated)))
