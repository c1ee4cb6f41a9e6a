"""Files of measurements to recordings, and recordings to logs."""

import csv
import io
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import IO

import numpy as np

from daq.arrayfile import read_arrays
from daq.channelmap import CHANNELS, ChannelMap
from daq.csvfile import csv_names, read_csv
from daq.derivative import differentiated
from daq.errors import DataError
from daq.log import LogWriter
from daq.matfile import write_mat
from daq.recording import Block, Channel, FloatArray, Recording, find_gaps
from daq.sampling import UnevenError, even_grid
from daq.timecolumn import no_times, time_column
from daq.universalfile import read_universal, write_universal

_LARGEST = (1 << 30) - 1  # count
_LEAST_SCALE = float(np.finfo(float).tiny)  # m/s2 a count: what is less has no quotients
_BLOCK_SECONDS = 1.0
_DEVICE = "import"
_UNIVERSAL = {".uff", ".unv"}


def read_data(
    path: Path,
    *,
    rate: float | None = None,
    factor: float = 1.0,
    start: int = 0,
    time: str | None = None,
    columns: Mapping[str, str] | None = None,
    velocities: Collection[str] = (),
) -> Recording:
    """Read a file of measurements: .npz, .mat, universal (.uff, .unv), anything else as a table of text.

    Parameters
    ----------
    path : of the file; see `read_csv`, `read_arrays` and `read_universal` for what it may hold
    rate : samples a second [Hz], if the file does not say
    factor : m/s2 a unit of the file
    start : time of the first sample [ns UTC]
    time : name of the column of times [s]; ``t`` or ``time``, with or without ``(s)``, unless given
    columns : columns to read -> names of their channels; all under their own names unless given
    velocities : channels that hold velocities [m/s, after `factor`]; they become accelerations (`differentiated`)

    Returns
    -------
    Recording
        [m/s2]. NaN and empty cells are gaps, and so is a missing stretch of times.

    Raises
    ------
    DataError
        Naming the file, and line or field.
    ValueError
        If `rate` or `factor` is not positive, two columns get the same name, or a channel of `velocities` is none.
    """
    if not factor > 0 or not (rate is None or rate > 0):
        raise ValueError(f"rate and factor: expected positive numbers, found {rate} and {factor}")
    if columns is not None and len(set(columns.values())) < len(columns):
        raise ValueError(f"columns: expected different names, found {', '.join(columns.values())}")
    read = _arrays if path.suffix.lower() in {".npz", ".mat", *_UNIVERSAL} else _table
    names, values, rate = read(path, rate, time, columns)
    if columns is not None:
        names = tuple(columns[name] for name in names)
    channels = _channels(names, values)
    data = values * factor
    recording = Recording(channels=channels, data=data, rate=rate, start=start, gaps=find_gaps(channels, data))
    return differentiated(recording, velocities) if velocities else recording


Columns = tuple[tuple[str, ...], FloatArray, float]  # names, values on an even grid, rate [Hz]


def _table(path: Path, rate: float | None, asked: str | None, columns: Mapping[str, str] | None) -> Columns:
    every = csv_names(path)
    time = time_column(every, asked)
    table = read_csv(path, None if columns is None else {*columns, *([time] if time is not None and not rate else [])})
    if time is None or time not in table.names:
        return table.names, table.values, _known(path, rate, None, no_times(every, asked))
    place = table.names.index(time)
    names = tuple(name for name in table.names if name != time)
    if not names:
        raise DataError(path, f"has no column beside {time!r}")
    if rate is not None:
        raise DataError(path, f"has a column {time!r} of times: leave out --rate")
    values = np.delete(table.values, place, axis=1)
    try:
        return names, *_on_grid(table.values[:, place], values)
    except UnevenError as error:
        raise DataError(path, f"line {table.line[error.row]}: {error.why}") from error


def _arrays(path: Path, rate: float | None, time: str | None, columns: Mapping[str, str] | None) -> Columns:
    universal = path.suffix.lower() in _UNIVERSAL
    arrays = read_universal(path, columns) if universal else read_arrays(path, time)
    for name in columns or ():
        if name not in arrays.names:
            raise DataError(path, f"expected a channel {name!r}, found {', '.join(arrays.names)}")
    chosen = [place for place, name in enumerate(arrays.names) if columns is None or name in columns]
    names, values = tuple(arrays.names[place] for place in chosen), arrays.values[:, chosen]
    if arrays.t is None:
        return names, values, _known(path, rate, arrays.rate, f"has neither 'rate' nor {arrays.t_name!r}: give --rate")
    if len(arrays.t) != len(values):
        raise DataError(path, f"{arrays.t_name}: expected {len(values)} times, found {len(arrays.t)}")
    try:
        return names, *_on_grid(arrays.t, values)
    except UnevenError as error:
        raise DataError(path, f"{arrays.t_name}[{error.row}]: {error.why}") from error


def _known(path: Path, given: float | None, found: float | None, otherwise: str) -> float:
    """Return the rate that is given or stands in the file."""
    rate = given if given is not None else found
    if rate is None:
        raise DataError(path, otherwise)
    if not rate > 0:
        raise DataError(path, f"rate: expected a positive number of Hz, found {rate}")
    return rate


def _on_grid(t: FloatArray, values: FloatArray) -> tuple[FloatArray, float]:
    """Return rows at their places on an even grid, NaN between, and its rate."""
    grid = even_grid(t)
    data = np.full((int(grid.index[-1]) + 1, values.shape[1]), np.nan)
    data[grid.index] = values
    return data, grid.rate


def _channels(names: tuple[str, ...], values: FloatArray) -> tuple[Channel, ...]:
    """Give the columns to devices: those that lack the same samples to the same one."""
    patterns: dict[bytes, list[int]] = {}
    for column, missing in enumerate(np.isnan(values).T):
        patterns.setdefault(np.packbits(missing).tobytes(), []).append(column)
    place = {}
    for number, columns in enumerate(patterns.values(), 1):
        device = _DEVICE if number == 1 else f"{_DEVICE}-{number}"
        place.update({column: Channel(name=names[column], device=device, axis=i) for i, column in enumerate(columns)})
    return tuple(place[column] for column in range(len(names)))


def write_recording(path: Path, recording: Recording, attachments: Mapping[str, str] | None = None) -> None:
    """Write a recording to a new log, its channel map attached.

    Counts are at most 2^30, so that a value is kept to 1e-9 of its device's largest one. A sample that a device lacks
    of one of its channels is a gap of the device.

    Parameters
    ----------
    path : of the new file
    recording : Recording
    attachments : name -> text, beside the channel map

    Raises
    ------
    LogError
        If the file exists or cannot be made.
    ValueError
        If two channels stand on the same axis of a device.
    """
    places = [(channel.device, channel.axis) for channel in recording.channels]
    for device, axis in places:
        if places.count((device, axis)) > 1:
            raise ValueError(f"channels: expected one for axis {axis} of {device}, found more")
    known = ChannelMap(channels=recording.channels, on_grid=True)
    writer = LogWriter(path, {CHANNELS: known.to_json(), **(attachments or {})})
    blocks = [block for device in _devices(recording) for block in _blocks(recording, device)]
    for block in sorted(blocks, key=lambda block: block.first_index):
        writer.write(block)
    writer.close()


def _devices(recording: Recording) -> tuple[str, ...]:
    return tuple(dict.fromkeys(channel.device for channel in recording.channels))


def _blocks(recording: Recording, device: str) -> Iterator[Block]:
    """Yield the blocks of one device."""
    axes = {c.axis: i for i, c in enumerate(recording.channels) if c.device == device}
    data = np.zeros((len(recording.data), max(axes) + 1))
    data[:, list(axes)] = recording.data[:, list(axes.values())]
    there = np.asarray(np.isfinite(data).all(axis=1))
    largest = float(np.abs(data[there]).max(initial=0.0))
    scale = max(largest / _LARGEST, _LEAST_SCALE) if largest > 0 else 1.0
    counts = np.rint(np.where(there[:, None], data, 0.0) / scale).astype(np.int32)
    edges = np.flatnonzero(np.diff(np.r_[False, there, False].astype(np.int8)))
    length = max(1, round(_BLOCK_SECONDS * recording.rate))
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        for first in range(start, stop, length):
            yield Block(
                device=device,
                rate=recording.rate,
                first_index=first,
                counts=counts[first : min(first + length, stop)],
                scale=scale,
                pair_index=first,
                pair_time=recording.start + round(first / recording.rate * 1e9),
                temperature=recording.temperature,
            )


def export_recording(path: Path, recording: Recording) -> None:
    """Write a recording to a new file that `read_data` reads: .npz, .mat, .uff, .unv, else a table of text.

    Times count from the recording's start; a missing sample is NaN, which universal files do not have.

    Raises
    ------
    DataError
        If the file exists or cannot be written, or a universal file is asked for and samples are missing.
    """
    if path.suffix.lower() in _UNIVERSAL and (missing := np.count_nonzero(np.isnan(recording.data))):
        raise DataError(path, f"cannot hold a gap: {missing} samples are missing; .npz, .mat and .csv can")
    names = [channel.name for channel in recording.channels]
    arrays = {"data": recording.data, "rate": recording.rate, "channels": np.array(names), "start": recording.start}
    try:
        with path.open("xb") as file:
            if path.suffix.lower() == ".npz":
                np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
            elif path.suffix.lower() == ".mat":
                write_mat(file, arrays | {"channels": np.array(names, object)})
            elif path.suffix.lower() in _UNIVERSAL:
                write_universal(path, recording)
            else:
                _write_csv(file, recording, names)
    except OSError as error:
        raise DataError(path, f"cannot be written: {error.strerror}") from error


def _write_csv(file: IO[bytes], recording: Recording, names: list[str]) -> None:
    """Write times [s] to the nanosecond and values [m/s2] to nine digits."""
    row = io.StringIO(newline="")
    csv.writer(row, lineterminator="\n").writerow(["t", *names])
    file.write(row.getvalue().encode())
    t = np.arange(len(recording.data)) / recording.rate
    np.savetxt(file, np.column_stack([t, recording.data]), delimiter=",", fmt=["%.9f", *["%.9g"] * len(names)])


def with_channels(recording: Recording, channels: tuple[Channel, ...]) -> Recording:
    """Return a recording whose channels stand on the devices and axes of others of the same names.

    Raises
    ------
    ValueError
        If a name is missing among `channels`.
    """
    place = {channel.name: channel for channel in channels}
    for channel in recording.channels:
        if channel.name not in place:
            raise ValueError(f"channel {channel.name!r}: expected one of {', '.join(place)}")
    moved = tuple(place[channel.name] for channel in recording.channels)
    return replace(recording, channels=moved, gaps=find_gaps(moved, recording.data))
