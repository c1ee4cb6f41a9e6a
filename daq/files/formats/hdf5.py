"""HDF5 files, read and written with h5py: any datasets of numbers, with attributes for rate, units, names, start."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np

from daq.errors import DataError
from daq.files.archive_size import check_unpacked, damage_named
from daq.files.columns.time_column import time_column
from daq.files.formats.arrays import ORIGIN, Arrays
from daq.files.formats.series import Series, TimeAxis, axis_of_times, together
from daq.files.options import DataOptions
from daq.files.origin import Origin, parse_origin
from daq.types import Recording

_RATES = ("rate", "fs", "samplerate", "samplingrate", "samplingfrequency", "samplefrequency", "sr")
_STEPS = ("dt", "delta", "samplinginterval", "sampleinterval", "increment", "wfincrement", "timestep")
_UNITS, _NAMES = ("unit", "units"), ("channels", "names", "columns", "channelnames")
_STARTS = ("start", "starttime", "t0", "begin")
_MAX_ITEMS, _MAX_CHANNELS = 10_000, 10_000
_NS_FROM = 1e15  # a number from here on is ns since 1970, below it is seconds


def read(path: Path, options: DataOptions) -> Arrays:
    """Read datasets of one or two dimensions, (n_samples,) or (n_samples, n_channels).

    A channel is named after its dataset, or its path where several have the name; in two dimensions after the attribute
    or dataset ``channels`` (or ``names``), else with a number. Rate, units and start are attributes of the dataset, of
    its groups or of the file, or datasets of one value; or times are in a dataset of the group.

    Raises
    ------
    DataError
        Naming the file, and the dataset.
    """
    with damage_named(path, "HDF5"), h5py.File(path, "r") as file:
        sets = _datasets(file)
        check_unpacked(path, "datasets", sum(item.size * 8 for item in sets.values() if _numeric(item)))
        series = list(_series(path, file, sets, options))
        text = _stated(file, sets, "", (ORIGIN,))
    arrays = together(path, series, options.columns)
    return arrays if not isinstance(text, str) else replace(arrays, origin=parse_origin(text, path), began=None)


def write(path: Path, recording: Recording) -> None:
    """Write ``data`` (n_samples, n_channels) [m/s2] with attributes to a file that exists and is empty."""
    with h5py.File(path, "w") as file:
        data = file.create_dataset("data", data=recording.data, compression="gzip", shuffle=True)
        data.attrs["rate"] = recording.rate
        data.attrs["units"] = "m/s2"
        data.attrs["start"] = recording.start
        data.attrs["channels"] = [channel.name for channel in recording.channels]
        file.attrs[ORIGIN] = Origin(start=recording.start, channels=recording.channels).text


def _datasets(file: "h5py.File") -> dict[str, "h5py.Dataset"]:
    """Return the datasets by path; links to other files are not followed."""
    found: dict[str, h5py.Dataset] = {}

    def visit(name: str, item: object) -> bool | None:
        if isinstance(item, h5py.Dataset) and item.shape is not None:
            found[name] = item
        return True if len(found) > _MAX_ITEMS else None

    file.visititems(visit)
    return found


def _numeric(item: "h5py.Dataset") -> bool:
    return item.dtype.kind in "iuf" and item.ndim in (1, 2) and item.size > 1


def _series(
    path: Path, file: "h5py.File", sets: Mapping[str, "h5py.Dataset"], options: DataOptions
) -> Iterator[Series]:
    """Yield the signals."""
    signals = {name: item for name, item in sets.items() if _numeric(item)}
    by_path = [name for name in options.columns or () if "/" in name]
    prefix = "/" if any(name.startswith("/") for name in by_path) else ""
    last = [name.rpartition("/")[2] for name in signals]
    axes = {group: _times(path, file, group, signals, options) for group in {n.rpartition("/")[0] for n in signals}}
    for name, item in signals.items():
        group, _, base = name.rpartition("/")
        axis, time = axes[group]
        if name == time:
            continue
        rate, start = _rate(file, sets, name), _start(_stated(file, sets, name, _STARTS))
        called = f"{prefix}{name}" if by_path or last.count(base) > 1 else base
        columns = list(_columns(path, file, sets, name, item, options.transposed))
        whole = np.asarray(item[()], np.float64)
        for one, unit, column in columns:
            title = one or (called if column is None else f"{called}_{column + 1}")
            values = whole if column is None else whole[column] if options.transposed else whole[:, column]
            if axis is not None and len(values) == len(axis.index):
                yield axis.series(title, values, unit)
            else:
                yield Series(name=title, values=values, rate=rate, start=start, unit=unit)


def _times(
    path: Path, file: "h5py.File", group: str, signals: Mapping[str, "h5py.Dataset"], options: DataOptions
) -> tuple[TimeAxis | None, str | None]:
    """Return the grid of a group's dataset of times, and its path; None where there is none."""
    own = {n.rpartition("/")[2]: n for n, item in signals.items() if n.rpartition("/")[0] == group and item.ndim == 1}
    base = time_column(list(own), options.time)
    if base is None:
        return None, None
    item = file[own[base]]
    unit = options.time_unit or {"milliseconds": "ms"}.get(str(_first(item.attrs, _UNITS)))
    return axis_of_times(path, base, np.asarray(item[()], np.float64), unit), own[base]


def _columns(
    path: Path,
    file: "h5py.File",
    sets: Mapping[str, "h5py.Dataset"],
    name: str,
    item: "h5py.Dataset",
    transposed: bool | None,
) -> Iterator[tuple[str, str, int | None]]:
    """Yield name, unit and place of the channels of a dataset; "" for a name that it does not state."""
    units = _stated(file, sets, name, _UNITS)
    if item.ndim == 1:
        yield "", units if isinstance(units, str) else "", None
        return
    names = _stated(file, sets, name, _NAMES)
    n = item.shape[0] if transposed else item.shape[1]
    stated = names if isinstance(names, list) and len(names) == n else [""] * n
    if transposed is None and item.shape[0] < item.shape[1] and not any(stated):
        raise DataError(
            path,
            f"{name}: found {item.shape}, which is {item.shape[1]} channels of {item.shape[0]} samples: give "
            "--transpose if each row is a channel, --no-transpose if each column is one",
        )
    if n > _MAX_CHANNELS:
        raise DataError(path, f"{name}: expected up to {_MAX_CHANNELS} channels, found {n}")
    for column in range(n):
        several = units[column] if isinstance(units, list) and len(units) == n else ""
        yield stated[column], units if isinstance(units, str) else several, column


def _stated(
    file: "h5py.File", sets: Mapping[str, "h5py.Dataset"], name: str, keys: tuple[str, ...]
) -> str | float | list[str] | None:
    """Return what attributes of a dataset, or else attributes or datasets of its groups, state under some keys."""
    path = name
    while True:
        found = _first(file[path].attrs if path else file.attrs, keys)
        group = path.rpartition("/")[0]
        if found is None and path:
            inside = {n.rpartition("/")[2]: item for n, item in sets.items() if n.rpartition("/")[0] == group}
            found = next((_plain(item[()]) for n, item in inside.items() if _key(n) in keys and item.size < 1000), None)
        if found is not None or not path:
            return found
        path = group


def _first(attributes: Mapping[str, object], keys: tuple[str, ...]) -> str | float | list[str] | None:
    return next((_plain(value) for key, value in attributes.items() if _key(key) in keys), None)


def _key(name: str) -> str:
    return name.casefold().replace("_", "").replace(" ", "").replace("-", "")


def _plain(value: object) -> str | float | list[str] | None:
    """Return a text, a number or a list of texts; None for anything else."""
    array = np.asarray(value)
    if array.dtype.kind in "iuf":
        return float(array.ravel()[0]) if array.size == 1 else None
    texts = [item.decode("utf-8", "replace") if isinstance(item, bytes) else str(item) for item in array.ravel()]
    if array.dtype.kind not in "OSUT" or not texts:
        return None
    return texts[0] if array.ndim == 0 else [text.strip() for text in texts]


def _rate(file: "h5py.File", sets: Mapping[str, "h5py.Dataset"], name: str) -> float | None:
    rate, step = _stated(file, sets, name, _RATES), _stated(file, sets, name, _STEPS)
    if isinstance(rate, float):
        return rate
    return 1 / step if isinstance(step, float) and step > 0 else None


def _start(stated: str | float | list[str] | None) -> int | None:
    """Return a stated start [ns UTC], None if it is none."""
    if isinstance(stated, float) and stated > 1e8:
        return int(stated) if stated >= _NS_FROM else round(stated * 1e9)
    if not isinstance(stated, str):
        return None
    try:
        found = datetime.fromisoformat(stated)
    except ValueError:
        return None
    return round((found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp() * 1e6) * 1000
