"""MDF files (versions 3 and 4) of vehicle and test bench loggers, read with asammdf."""

import gc
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF
from asammdf.blocks.utils import MdfException

from daq.errors import DataError
from daq.files.archive_size import check_unpacked, damage_named
from daq.files.columns.headings import parted
from daq.files.formats.arrays import Arrays
from daq.files.formats.messages import library_messages
from daq.files.formats.series import Series, axis_of_seconds, together
from daq.files.options import DataOptions

_MAGIC = (b"MDF     ", b"UnFinMF ")


def read(path: Path, options: DataOptions) -> Arrays:
    """Read the channels of numbers of all groups with an even time grid.

    Raises
    ------
    DataError
        Naming the file.
    """
    left: list[str] = []
    with (
        library_messages("asammdf") as messages,
        damage_named(path, "MDF", MdfException),
        path.open("rb") as file,
        _opened(path, file) as mdf,
    ):
        series = list(_series(path, mdf, options, left))
    arrays = together(path, series, options.columns)
    remarks = tuple(f"asammdf: {text}" for text in messages)
    return replace(arrays, left=(*arrays.left, *left), remarks=remarks)


def _opened(path: Path, file: BufferedReader) -> MDF:
    """Open a file; the destructor of a damaged one raises again in asammdf, which is not shown."""
    if file.read(8) not in _MAGIC:
        raise DataError(path, "is no MDF file")
    file.seek(0)
    shown, reason = sys.unraisablehook, ""
    try:
        sys.unraisablehook = lambda _: None
        try:
            return MDF(file)
        except Exception as error:  # noqa: BLE001 - whatever asammdf raises for a damaged file
            reason = f"{error}".partition("\n")[0] or type(error).__name__
        gc.collect()
    finally:
        sys.unraisablehook = shown
    raise DataError(path, f"is no MDF file, or damaged: {reason}")


def _series(path: Path, mdf: MDF, options: DataOptions, left: list[str]) -> Iterator[Series]:
    """Yield the signals; channels of other kinds, or without an even time grid, are added to `left`."""
    begin = round(mdf.header.start_time.timestamp() * 1e6) * 1000
    size = 0
    groups: Sequence[Any] = mdf.groups
    for number, group in enumerate(groups):
        master = mdf.masters_db.get(number)
        names = [mdf.get_channel_name(number, k) for k in range(len(group.channels))]
        wanted = [k for k, name in enumerate(names) if k != master and _wanted(name, options)]
        if not wanted:
            continue
        t = np.asarray(mdf.get_master(number), np.float64)
        size += 8 * len(t) * len(wanted)
        check_unpacked(path, "channels", size)
        try:
            axis = axis_of_seconds(
                path, "times", t - t[0] if len(t) else t, begin + round(1e9 * t[0]) if len(t) else None
            )
        except DataError:
            left.extend(f"{names[k]} (no even times)" for k in wanted)
            continue
        for k in wanted:
            signal = mdf.get(group=number, index=k)
            if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "iuf" or len(signal.samples) != len(t):
                left.append(f"{names[k]} (no numbers)")
                continue
            yield axis.series(names[k], np.asarray(signal.samples, np.float64), signal.unit or "")


def _wanted(name: str, options: DataOptions) -> bool:
    return options.columns is None or any(name in (column, parted(column)[0]) for column in options.columns)
