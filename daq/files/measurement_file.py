"""Files of measurements to recordings."""

import itertools
import re
from collections import Counter
from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from daq.errors import DataError
from daq.files.columns.date_cells import CLOCK, DAY, MOMENT, reads
from daq.files.columns.headings import Signal, parted, signals_of, temperatures_of
from daq.files.columns.scaling import calibration_remark, differentiation_remark, foreign, scalings, unit_remark
from daq.files.columns.stated_start import StatedStart, UnclearDate
from daq.files.columns.temperatures import known_mean, mean_temperature, temperature_remark
from daq.files.columns.time_column import (
    date_column,
    date_remark,
    is_further_time,
    nanoseconds,
    no_times,
    time_column,
    time_column_by_cells,
    time_remark,
    times_and_start,
)
from daq.files.columns.time_grid import UnevenError, even_grid
from daq.files.formats.registry import Format, format_of, read_format
from daq.files.measured import Measured, processed
from daq.files.options import DataOptions
from daq.files.origin import Origin
from daq.files.tables.layout import Kind, Layout
from daq.files.tables.preamble import stated_start, stated_unit
from daq.files.tables.text_table import read_rows, table_layout
from daq.types import Channel, FloatArray, Recording, find_gaps

_MAX_VALUE = 1e20  # m/s2
_MAX_TIME = 4.6e18  # ns since 1970
_MIN_RATE, _MAX_RATE = 1e-6, 1e6  # Hz
_NICE = 1e-3  # relative: a requested rate may be the nominal one of a file
_DEVICE = "import"
_COUNTER = re.compile(r"count(er)?|index|idx|samples?|no\.|nr\.?|#|row|id|packet|seq(uence)?", re.IGNORECASE)


def read_data(
    path: Path | str,
    *,
    rate: float | None = None,
    factor: float | None = None,
    start: int | None = None,
    time: str | None = None,
    time_unit: str | None = None,
    columns: Mapping[str, str] | None = None,
    velocities: Collection[str] = (),
    temperature: str | None = None,
    names: Sequence[str] | None = None,
    date_order: str | None = None,
) -> Recording:
    """Read a file of measurements as one recording [m/s2].

    Parameters
    ----------
    path : of the file
    rate : samples per second [Hz], for a file without times
    factor : of all channels [m/s2 per unit of the file]
    start : time of the first sample [ns UTC], for a file without dates
    time, time_unit : name and unit of the column of times
    columns : column -> name of its channel, of those to read. Default: all with a unit of motion
    velocities : channels that contain velocities, which are differentiated
    temperature : name of the column of temperatures
    names : of the columns of a file without headings
    date_order : order of day and month in dates that leave it open

    Raises
    ------
    DataError
        Naming the file, and the line or column that cannot be read.
    ValueError
        If an argument is wrong.
    """
    options = DataOptions(
        rate=rate,
        factor=factor,
        start=start,
        time=time,
        time_unit=time_unit,
        columns=columns,
        velocities=velocities,
        temperature=temperature,
        names=names,
        date_order=date_order,
    )
    return read_measured(Path(path), options).recording


def read_measured(path: Path, options: DataOptions) -> Measured:
    """Read a file of measurements: one of `FORMATS` by its ending, anything else as a table of text.

    Parameters
    ----------
    path : see `table_layout`, `read_rows` and the modules of `daq.files.formats`
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
    return processed(path, (read_unprocessed(path, options),), options)[0]


def read_unprocessed(path: Path, options: DataOptions) -> Measured:
    """Read a file as `read_measured` does, but do not differentiate, filter or resample."""
    known = format_of(path)
    found = _table(path, options) if known is None else _of_format(path, known, options)
    return as_measured(path, found, options)


def as_measured(path: Path, found: "Columns", options: DataOptions) -> Measured:
    """Return columns in m/s2 (m/s or m if still to be differentiated), with the channels and devices they belong to."""
    names = [signal.channel for signal in found.signals]
    for name in options.velocities:
        if name not in names:
            raise ValueError(f"channels: expected some of {', '.join(names)}, found {name!r}")
    scales = scalings(path, found.signals, options)
    channels = _channels(found)
    data = found.values - np.array([scale.offset for scale in scales])
    data *= [scale.factor for scale in scales]
    _check_magnitude(path, found.signals, data)
    _check_rates(path, found.rate, options)
    temperature = mean_temperature(path, found.warm, found.warmth, found.rate)
    stated = found.origin.start if found.origin else None
    certain = next((start for start in (options.start, found.began, stated) if start is not None), None)
    in_text = found.stated if isinstance(found.stated, StatedStart) else None
    start = certain if certain is not None else in_text.time if in_text else 0
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
        date_remark(found.time, found.began) if found.began is not None else None,
        time_remark(found.time, options.time_unit) if found.time and found.began is None else None,
        unit_remark(found.signals, options, found.unit_source),
        calibration_remark(found.signals, options),
        differentiation_remark(found.signals, scales, options.velocities),
        temperature_remark(found.warm, temperature),
        found.origin.remark if found.origin else None,
        found.stated.remark if found.stated and certain is None else None,
        *found.remarks,
        f"columns left out: {', '.join(found.left)}" if found.left else None,
    ]
    return Measured(
        recording=recording,
        temperature=temperature,
        remarks=tuple(remark for remark in texts if remark),
        dated=found.began is not None or stated is not None or (in_text is not None and in_text.with_clock),
        derivatives=tuple(scale.derivatives for scale in scales),
    )


def _check_rates(path: Path, rate: float, options: DataOptions) -> None:
    """Refuse frequencies that the rate of the file does not permit."""
    if options.high_pass is not None and options.high_pass >= rate / 2:
        raise DataError(path, f"--high-pass: expected less than half the rate of {rate:.6g} Hz")
    if options.resample is not None and options.resample > rate * (1 + _NICE):
        raise DataError(path, f"--resample: expected at most the rate of {rate:.6g} Hz")


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
    stated: StatedStart | UnclearDate | None = None  #: start that a text in the file states
    left: tuple[str, ...] = ()  #: descriptions of columns that are left out
    remarks: tuple[str, ...] = ()  #: on the place and the rate of the columns
    unit_source: str = "the columns"  #: place of the units in the file

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
) -> tuple[tuple[Signal, ...], tuple[str, ...], tuple[str, ...]]:
    """Return the columns to read in addition to the times: signals and temperatures; and those with foreign units."""
    warm = temperatures_of(path, [name for name in names if name not in (options.columns or ())], options.temperature)
    others = temperatures_of(path, names, None) if options.columns is None else ()
    signals = signals_of(path, [name for name in names if name not in (*warm, *others)], options.columns)
    left = tuple(signal for signal in signals if options.columns is None and foreign(signal, options))
    if len(left) == len(signals):
        return signals, warm, ()
    return (
        tuple(s for s in signals if s not in left),
        warm,
        tuple(f"{signal.column} (no unit of motion)" for signal in left),
    )


def _table(path: Path, options: DataOptions) -> Columns:
    layout, origin = table_layout(path, options.names)
    every, rate = tuple(name for name in layout.names if name), options.rate
    filled = [name for name, kind in zip(layout.names, layout.kinds, strict=True) if name and kind != "empty"]
    first = layout.head[0] if layout.head else ()
    time = time_column(filled, options.time)
    if time is None and options.time is None and rate is None:
        time = time_column_by_cells(layout.names, layout.head, rated=layout.rate is not None)
    stated = stated_start(layout.preamble, options.date_order)
    day = date_column(layout.names, first, time, dated=stated is not None)
    others = _foreign_columns(layout, {time, day}) if options.columns is None else {}
    untimed = no_times(every, options.time) + ("" if layout.named else ", and --columns to name them")
    rest = [name for name in every if name not in (time, day) and name not in others]
    signals, warm, left = columns_to_read(path, rest, options)
    unit = None if any(signal.unit for signal in signals) else stated_unit(layout.preamble)
    unit_source = "the columns"
    if unit is not None and unit.usable:
        signals, unit_source = tuple(replace(signal, unit=unit.text) for signal in signals), f"line {unit.line}"
    columns = [*(signal.column for signal in signals), *warm]
    timed = time is not None and (options.columns is None or rate is None)
    known = rate if timed else known_rate(path, rate, layout.rate, untimed)
    times = (time, day) if timed else (None, None)
    places = [_place(path, layout, name) for name in columns]
    time_place, day_place = (None if name is None else _place(path, layout, name) for name in times)
    wanted = [*([] if time_place is None else [time_place]), *places]
    table = read_rows(path, layout, wanted, time_place, day_place, options.date_order)
    if not signals:
        raise DataError(path, f"has no column of a channel, but {', '.join(every)}")
    preamble = f"sampling rate of the preamble: {known:.6g} Hz" if known is not None and rate is None else ""
    again = (f"{name} (repeated)" for name in dict.fromkeys(layout.repeated))
    left = (*(text for name, text in others.items() if name or options.names is None), *again, *left)
    texts: dict[str, Any] = {
        "left": left,
        "remarks": (layout.remark, preamble, "" if unit is None or unit.usable else unit.remark),
        "origin": origin,
        "stated": None if table.dated else stated,
        "unit_source": unit_source,
    }
    if known is not None and not timed:
        return Columns(signals, warm, table.values, known, **texts)
    if time is None or known is not None:
        raise DataError(path, f"has a column {time!r} of times: leave out --rate")
    t, values = table.values[:, 0], table.values[:, 1:]
    try:
        if table.dated:
            name = time if day is None else f"{day} {time}"
            return Columns(signals, warm, *on_grid(t, values), name, nanoseconds(t), **texts)
        t, began, remark = times_and_start(path, time, t, options.time_unit)
        data, even_rate = on_grid(t, values)
        if not origin and began is not None:
            texts["remarks"] = (remark, *texts["remarks"])
            return Columns(signals, warm, data, even_rate, None, began, **texts)
        if origin:  # rows may have been taken out of the beginning
            texts["origin"] = replace(origin, start=origin.start + round(1e9 * float(t[0])))
        return Columns(signals, warm, data, even_rate, time, **texts)
    except UnevenError as error:
        raise DataError(path, f"line {table.line[error.row]}: {error.why}") from error


def _foreign_columns(layout: Layout, used: Collection[str | None]) -> dict[str, str]:
    """Return columns that hold no numbers, or have no name, with a description of each."""
    found: dict[str, str] = {}
    for place, (name, kind) in enumerate(zip(layout.names, layout.kinds, strict=True)):
        cells = [row[place] for row in layout.head if place < len(row)]
        if not name and kind != "empty":
            found[""] = f"{found['']}, {place + 1}" if "" in found else f"without a name: {place + 1}"
        elif name not in used and (why := _no_signal(name, kind, cells)):
            found[name] = f"{name} ({why})"
    return found


def _no_signal(name: str, kind: Kind, cells: Sequence[str]) -> str:
    """Return the content of a column that is not of numbers of a sensor, "" for another one."""
    if kind == "empty":
        return "empty" if time_column([name], None) else ""
    if _counts(name, cells):
        return "counter"
    if is_further_time(name, cells):
        return "times"
    if kind == "text":
        return "text"
    return "dates" if any(reads(form, "".join(cells[:1])) for form in (MOMENT, DAY, CLOCK)) else ""


def _counts(name: str, cells: Sequence[str]) -> bool:
    """Return whether a column numbers the rows."""
    numbers = [int(cell) for cell in cells if cell.strip().isdecimal()]
    steps = {after - before for before, after in itertools.pairwise(numbers)}
    return bool(_COUNTER.fullmatch(name)) and len(numbers) == len(cells) and steps == {1}


def _place(path: Path, layout: Layout, name: str) -> int:
    """Return the place of a column that exists once."""
    if name not in layout.names:
        raise DataError(path, f"line {layout.header}: expected a column {name!r}, found {', '.join(layout.names)}")
    if layout.names.count(name) > 1:
        raise DataError(path, f"line {layout.header}: the column name {name!r} is given twice: name all by --columns")
    return layout.names.index(name)


def _of_format(path: Path, known: Format, options: DataOptions) -> Columns:
    arrays = read_format(known, path, options)
    left = arrays.left
    if arrays.units is not None:
        units = dict(zip(arrays.names, arrays.units, strict=True))
        named = signals_of(path, arrays.names, options.columns, united=False)
        signals, warm = tuple(replace(s, unit=units.get(s.column, "")) for s in named), tuple[str, ...]()
    else:
        signals, warm, foreign_units = columns_to_read(path, arrays.names, options)
        left = (*left, *foreign_units)
    columns = [*(signal.column for signal in signals), *warm]
    for name in columns:
        if name not in arrays.names:
            raise DataError(path, f"expected a channel {name!r}, found {', '.join(arrays.names)}")
    values = arrays.values[:, [arrays.names.index(name) for name in columns]]
    texts: dict[str, Any] = {
        "began": arrays.began,
        "origin": arrays.origin,
        "stated": arrays.stated,
        "left": left,
        "remarks": arrays.remarks,
    }
    if arrays.t is None:
        otherwise = f"has neither 'rate' nor {arrays.t_name!r}: give --rate"
        rate = known_rate(path, options.rate, arrays.rate, otherwise)
        return Columns(signals, warm, values, rate, **texts)
    if len(arrays.t) != len(values):
        raise DataError(path, f"{arrays.t_name}: expected {len(values)} times, found {len(arrays.t)}")
    try:
        t, began, remark = times_and_start(path, arrays.t_name, arrays.t, options.time_unit)
        if arrays.began is None and not arrays.origin and began is not None:
            texts |= {"began": began, "remarks": (remark, *arrays.remarks)}
            return Columns(signals, warm, *on_grid(t, values), **texts)
        return Columns(signals, warm, *on_grid(t, values), arrays.t_name, **texts)
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
    origin = found.origin
    places = [
        None if origin is None else origin.channel(signal.column) or origin.channel(parted(signal.column)[0])
        for signal in found.signals
    ]
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
