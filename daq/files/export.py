"""Recordings to logs, and to files that `read_data` reads."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from daq.errors import DataError, writing
from daq.files.columns.temperatures import known_mean
from daq.files.formats.registry import FORMATS, format_of, write_format
from daq.files.origin import Origin
from daq.files.tables.text_table import ORIGIN as ORIGIN_COMMENT
from daq.log.channel_map import CHANNELS, ChannelMap
from daq.log.format.progress import report_progress
from daq.log.mcap_log import McapWriter
from daq.types import Block, Channel, FloatArray, Recording, find_gaps

_LARGEST = (1 << 30) - 1  # count
_MIN_SCALE = float(np.finfo(float).tiny)  # smallest scale [m/s2 per count] with finite quotients
_BLOCK_SECONDS = 1.0
_TABLES = (".csv", ".txt")  # endings of tables
_ROWS = 10_000  # of a table that are written at once


def write_recording(
    path: Path | str,
    recording: Recording,
    attachments: Mapping[str, str] | None = None,
    temperature: FloatArray | None = None,
) -> None:
    """Write a recording to a new log, its channel map attached.

    Counts are at most 2^30, so that a value is kept to 1e-9 of its device's largest one. A sample that a device lacks
    of one of its channels is a gap of the device.

    Parameters
    ----------
    path : of the new file
    recording : Recording
    attachments : name -> text, in addition to the channel map
    temperature : (n_samples,) [degC], NaN where not known. Default: that of the recording

    Raises
    ------
    LogError
        If the file exists or cannot be made.
    ValueError
        If two channels have the same axis of a device.
    """
    write_recordings(path, [recording], attachments, None if temperature is None else [temperature])


def write_recordings(
    path: Path | str,
    recordings: Sequence[Recording],
    attachments: Mapping[str, str] | None = None,
    temperatures: Sequence[FloatArray] | None = None,
) -> None:
    """Write consecutive recordings to one new log; samples between them are missing.

    Parameters
    ----------
    path : of the new file
    recordings : of the same channels on one time grid, as of `in_order`; each is written as by `write_recording`
    attachments : name -> text, in addition to the channel map
    temperatures : of each recording (n_samples,) [degC], NaN where not known. Default: those of the recordings

    Raises
    ------
    LogError
        If the file exists or cannot be made.
    ValueError
        If two channels have the same axis of a device.
    """
    first = recordings[0]
    places = [(channel.device, channel.axis) for channel in first.channels]
    for device, axis in places:
        if places.count((device, axis)) > 1:
            raise ValueError(f"channels: expected one for axis {axis} of {device}, found more")
    known = ChannelMap(channels=first.channels, on_grid=True)
    path = Path(path)
    writer = McapWriter(path, {CHANNELS: known.to_json(), **(attachments or {})})
    for number, recording in enumerate(recordings):
        warmth = np.full(len(recording.data), recording.temperature) if temperatures is None else temperatures[number]
        skipped = round((recording.start - first.start) * 1e-9 * first.rate)
        devices = dict.fromkeys(channel.device for channel in recording.channels)
        blocks = [block for device in devices for block in _blocks(recording, device, warmth, skipped)]
        for count, block in enumerate(sorted(blocks, key=lambda block: block.first_index), 1):
            writer.write(block)
            report_progress(path, number + count / len(blocks), len(recordings))
    writer.close()


def _blocks(recording: Recording, device: str, warmth: FloatArray, skipped: int) -> Iterator[Block]:
    """Yield the blocks of one device, numbered from the number of samples that lie before the recording."""
    axes = {c.axis: i for i, c in enumerate(recording.channels) if c.device == device}
    data = np.zeros((len(recording.data), max(axes) + 1))
    data[:, list(axes)] = recording.data[:, list(axes.values())]
    there = np.asarray(np.isfinite(data).all(axis=1))
    largest = float(np.abs(data[there]).max(initial=0.0))
    scale = max(largest / _LARGEST, _MIN_SCALE) if largest > 0 else 1.0
    counts = np.rint(np.where(there[:, None], data, 0.0) / scale).astype(np.int32)
    edges = np.flatnonzero(np.diff(np.r_[False, there, False].astype(np.int8)))
    length = max(1, round(_BLOCK_SECONDS * recording.rate))
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        for first in range(start, stop, length):
            end = min(first + length, stop)
            yield Block(
                device=device,
                rate=recording.rate,
                first_index=skipped + first,
                counts=counts[first:end],
                scale=scale,
                arrival_index=skipped + first,
                arrival_time=recording.start + round(first / recording.rate * 1e9),
                temperature=known_mean(warmth[first:end]),
            )


def export_recording(path: Path | str, recording: Recording) -> None:
    """Write a recording to a new file that `read_data` reads: of a format of `FORMATS` by its ending, else a table.

    Times count from the recording's start; a missing sample is NaN, which universal files do not have. Each states its
    origin: the devices and axes of the channels, and the start. In a table that is a comment before the header.

    Raises
    ------
    DataError
        If the file exists or cannot be written, the format cannot be written, or a universal file is requested and
        samples are missing.
    """
    path = Path(path)
    known = format_of(path)
    if not (known.writes if known else path.suffix.lower() in _TABLES):
        written = ", ".join((*_TABLES, *(ending for one in FORMATS if one.writes for ending in one.endings)))
        raise DataError(path, f"{known.name if known else path.suffix or 'no ending'} cannot be written; {written} can")
    with writing(path, DataError):
        path.open("xb").close()
        try:
            if known is None:
                _write_csv(path, recording)
            else:
                write_format(known, path, recording)
        except BaseException:
            path.unlink(missing_ok=True)
            raise


def _write_csv(path: Path, recording: Recording) -> None:
    """Write times [s] to the nanosecond and values [m/s2] to nine digits."""
    names = [channel.name for channel in recording.channels]
    origin = Origin(start=recording.start, channels=recording.channels).text
    row = io.StringIO(newline="")
    row.write(f"{ORIGIN_COMMENT}{origin}\n")
    csv.writer(row, lineterminator="\n").writerow(["t", *names])
    table = np.column_stack([np.arange(len(recording.data)) / recording.rate, recording.data])
    with path.open("wb") as file:
        file.write(row.getvalue().encode())
        for first in range(0, len(table), _ROWS):
            np.savetxt(file, table[first : first + _ROWS], delimiter=",", fmt=["%.9f", *["%.9g"] * len(names)])
            report_progress(path, first + _ROWS, len(table))


def with_channels(recording: Recording, channels: tuple[Channel, ...]) -> Recording:
    """Return a recording with its channels on the devices and axes of given channels with the same names.

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
