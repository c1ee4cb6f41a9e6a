"""Parquet and Arrow (Feather) files, read and written with pyarrow."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import ipc, parquet

from daq.errors import DataError
from daq.files.archive_size import check_unpacked, damage_named
from daq.files.columns.headings import parted
from daq.files.columns.time_column import time_column
from daq.files.formats.arrays import ORIGIN, Arrays
from daq.files.formats.series import Series, TimeAxis, axis_of_seconds, axis_of_times, together
from daq.files.options import DataOptions
from daq.files.origin import Origin, parse_origin
from daq.types import Recording

_RATES, _UNITS = (b"rate", b"fs", b"sampling_rate"), (b"unit", b"units")
_PARQUET = (".parquet", ".pq")


def read(path: Path, options: DataOptions) -> Arrays:
    """Read columns of numbers; times are in a column of dates or of times, or the metadata of the table state ``rate``.

    Units are in the metadata of the columns, or in their names.

    Raises
    ------
    DataError
        Naming the file, and the column.
    """
    with damage_named(path, "Parquet or Arrow", pa.ArrowException):
        schema = _schema(path)
        numeric = [
            field.name for field in schema if pa.types.is_integer(field.type) or pa.types.is_floating(field.type)
        ]
        dates = [field.name for field in schema if pa.types.is_timestamp(field.type)]
        time = time_column([*dates, *numeric], options.time) or next(iter(dates), None)
        wanted = options.columns
        chosen = [n for n in numeric if wanted is None or n in wanted or parted(n)[0] in wanted or n == time]
        table = _table(path, [*chosen, *(n for n in dates if n == time)])
    axis = None if time is None else _axis(path, table, time, options)
    rate = _rate(schema)
    series = list(_series(table, axis, rate, time))
    left = [f"{field.name} ({field.type})" for field in schema if field.name not in (*numeric, time)]
    arrays = together(path, series, wanted)
    text = (schema.metadata or {}).get(ORIGIN.encode())
    origin = None if text is None else parse_origin(text.decode("utf-8", "replace"), path)
    began = None if origin is not None else arrays.began
    return replace(arrays, origin=origin, began=began, left=(*arrays.left, *(left if wanted is None else ())))


def write(path: Path, recording: Recording) -> None:
    """Write times ``t`` [s] and one column per channel [m/s2], with metadata, to a file that exists and is empty."""
    unit = {"unit": "m/s2"}
    fields = [
        pa.field("t", pa.float64(), metadata={"unit": "s"}),
        *(pa.field(channel.name, pa.float64(), metadata=unit) for channel in recording.channels),
    ]
    origin = Origin(start=recording.start, channels=recording.channels).text
    schema = pa.schema(fields, metadata={"rate": repr(recording.rate), "start": str(recording.start), ORIGIN: origin})
    columns = [np.arange(len(recording.data)) / recording.rate, *recording.data.T]
    table = pa.Table.from_arrays([pa.array(column) for column in columns], schema=schema)
    if path.suffix.lower() in _PARQUET:
        parquet.write_table(table, path, compression="zstd")
        return
    with ipc.new_file(str(path), schema) as file:
        file.write_table(table)


def _schema(path: Path) -> "pa.Schema":
    if path.suffix.lower() not in _PARQUET:
        with pa.OSFile(str(path)) as file:
            return _ipc(file).schema
    with parquet.ParquetFile(path) as file:
        check_unpacked(path, "columns", 8 * file.metadata.num_rows * file.metadata.num_columns)
        return file.schema_arrow


def _ipc(file: "pa.OSFile") -> "ipc.RecordBatchFileReader | ipc.RecordBatchStreamReader":
    """Return the reader of an IPC file, or of an IPC stream."""
    begin = file.read(6)
    file.seek(0)
    return ipc.open_file(file) if begin == b"ARROW1" else ipc.open_stream(file)


def _table(path: Path, names: list[str]) -> "pa.Table":
    """Return some columns."""
    if path.suffix.lower() in _PARQUET:
        with parquet.ParquetFile(path) as file:
            return file.read(columns=names)
    with pa.OSFile(str(path)) as file:
        return pa.Table.from_batches(_batches(path, _ipc(file), names))


def _batches(
    path: Path, reader: "ipc.RecordBatchFileReader | ipc.RecordBatchStreamReader", names: list[str]
) -> Iterator["pa.RecordBatch"]:
    size = 0
    several = isinstance(reader, ipc.RecordBatchFileReader)
    for batch in (reader.get_batch(k) for k in range(reader.num_record_batches)) if several else reader:
        size += batch.nbytes
        check_unpacked(path, "columns", size)
        batch.validate()
        yield batch.select(names)


def _series(table: "pa.Table", axis: TimeAxis | None, rate: float | None, time: str | None) -> Iterator[Series]:
    for field in table.schema:
        if field.name == time:
            continue
        unit = next(
            (text.decode("utf-8", "replace") for key, text in (field.metadata or {}).items() if key in _UNITS), ""
        )
        values = np.asarray(table.column(field.name).to_numpy(), np.float64)
        if axis is None:
            yield Series(name=field.name, values=values, rate=rate, unit=unit)
        else:
            yield axis.series(field.name, values, unit)


def _axis(path: Path, table: "pa.Table", time: str, options: DataOptions) -> TimeAxis:
    column = table.column(time)
    if not pa.types.is_timestamp(column.type):
        return axis_of_times(path, time, np.asarray(column.to_numpy(), np.float64), options.time_unit)
    if column.null_count or not len(column):
        raise DataError(path, f"column {time!r}: expected dates, found {column.null_count} empty cells")
    stamps = column.cast(pa.timestamp("ns")).cast(pa.int64()).to_numpy()
    return axis_of_seconds(path, time, (stamps - stamps[0]) * 1e-9, int(stamps[0]))


def _rate(schema: "pa.Schema") -> float | None:
    """Return the rate in the metadata of a table [Hz], None if it states none."""
    text = next((value for key, value in (schema.metadata or {}).items() if key in _RATES), None)
    try:
        return None if text is None else float(text)
    except ValueError:
        return None
