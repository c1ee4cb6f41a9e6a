"""TDMS files of LabVIEW and FlexLogger, read with npTDMS."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from nptdms import TdmsChannel, TdmsFile, TdmsGroup

from daq.files.archive_size import check_unpacked, damage_named
from daq.files.columns.time_column import time_column
from daq.files.formats.arrays import Arrays
from daq.files.formats.messages import library_messages
from daq.files.formats.series import Series, TimeAxis, axis_of_seconds, axis_of_times, together
from daq.files.options import DataOptions

_UNITS = ("unit_string", "NI_UnitDescription", "Unit", "unit")


def read(path: Path, options: DataOptions) -> Arrays:
    """Read the channels of all groups; the rate and the start are those of their waveform properties, or of a column.

    A channel is named as in its group, or ``GROUP/CHANNEL`` where several groups have the name.

    Raises
    ------
    DataError
        Naming the file, or the channel.
    """
    with (
        library_messages("nptdms") as messages,
        damage_named(path, "TDMS"),
        path.open("rb") as opened,
        TdmsFile.open(opened) as file,
    ):
        channels = [channel for group in file.groups() for channel in group.channels()]
        check_unpacked(path, "channels", 8 * sum(len(channel) for channel in channels))
        names = [channel.name for channel in channels]
        unique = {c.path: c.name if names.count(c.name) == 1 else f"{c.group_name}/{c.name}" for c in channels}
        series = [one for group in file.groups() for one in _series(path, group, unique, options)]
    found = together(path, series, options.columns)
    return replace(found, remarks=(*found.remarks, *(f"npTDMS: {text}" for text in messages)))


def _series(path: Path, group: TdmsGroup, names: dict[str, str], options: DataOptions) -> Iterator[Series]:
    """Yield the signals of a group."""
    numeric = [c for c in group.channels() if len(c) and c.dtype.kind in "iufM"]
    time = time_column([c.name for c in numeric], options.time)
    timed = next((c for c in numeric if c.name == time), None)
    axis = None if timed is None else _times(path, timed, options)
    for channel in numeric:
        if channel is timed or channel.dtype.kind == "M":
            continue
        values = np.asarray(channel[:], np.float64)
        name, (rate, start) = names[channel.path], _waveform(channel)
        unit = next((str(channel.properties[key]) for key in _UNITS if channel.properties.get(key)), "")
        if axis is not None and rate is None and len(values) == len(axis.index):
            yield axis.series(name, values, unit)
        else:
            yield Series(name=name, values=values, rate=rate, start=start, unit=unit)


def _waveform(channel: TdmsChannel) -> tuple[float | None, int | None]:
    """Return the rate [Hz] and the start [ns UTC] that properties state, None where they do not."""
    step = channel.properties.get("wf_increment")
    began = channel.properties.get("wf_start_time")
    start = None
    if isinstance(began, np.datetime64) and not np.isnat(began) and began > np.datetime64(0, "us"):
        offset = float(channel.properties.get("wf_start_offset", 0.0))
        start = _nanoseconds(began) + round(1e9 * offset)
    return (1 / float(step) if isinstance(step, int | float) and step > 0 else None), start


def _times(path: Path, channel: TdmsChannel, options: DataOptions) -> TimeAxis:
    """Return the grid of a channel of times."""
    t = channel[:]
    if t.dtype.kind != "M":
        return axis_of_times(path, channel.name, np.asarray(t, np.float64), options.time_unit)
    seconds = (t - t[0]).astype("timedelta64[ns]").astype(np.float64) * 1e-9
    return axis_of_seconds(path, channel.name, seconds, _nanoseconds(t[0]))


def _nanoseconds(time: np.datetime64) -> int:
    """Return a time [ns UTC]."""
    return int(time.astype("datetime64[ns]").astype(np.int64))
