"""Arrays of numpy's .npz and .npy, and Matlab's .mat files."""

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from daq.errors import DataError
from daq.files.archive_size import DAMAGED_FILE, check_archive, check_array
from daq.files.columns.stated_start import StatedStart, UnclearDate
from daq.files.columns.time_column import plausible_rate, time_column
from daq.files.formats.mat import read_mat, write_mat
from daq.files.options import DataOptions
from daq.files.origin import Origin, parse_origin
from daq.types import FloatArray, Recording

_MAX_CHANNELS = 10_000
ORIGIN = "origin"  #: array of one text
_DATA, _NAMES = ("data", "y"), ("channels", "names")
_RATE = re.compile(r"rate|fs|sampl\w*_?(rate|freq|frequency)", re.IGNORECASE)
_STEP = re.compile(r"dt|ts|sampl\w*_?(interval|period)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Arrays:
    """Signals as a file of arrays holds them."""

    names: tuple[str, ...]
    values: FloatArray  #: (n_samples, n_channels)
    rate: float | None  #: [Hz]; None if not in the file
    t: FloatArray | None  #: (n_samples,) as in the file; None if not in the file
    t_name: str = "t"  #: name of the array of times, found or requested
    origin: Origin | None = None  #: origin of an exported file
    units: tuple[str, ...] | None = None  #: of all signals, "" for none. Default: those that names state
    began: int | None = None  #: time of the first sample [ns UTC]; None if not in the file
    stated: StatedStart | UnclearDate | None = None  #: start that a text in the file states
    left: tuple[str, ...] = ()  #: descriptions of signals that are left out
    remarks: tuple[str, ...] = ()  #: on the content


def read(path: Path, options: DataOptions) -> Arrays:
    """Read signals as `read_arrays` does."""
    return read_arrays(path, options.time, options.transposed)


def write(path: Path, recording: Recording) -> None:
    """Write ``data``, ``rate``, ``channels``, ``start`` and the origin to a file that exists and is empty."""
    names = [channel.name for channel in recording.channels]
    arrays = {"data": recording.data, "rate": recording.rate, "channels": np.array(names), "start": recording.start}
    origin = Origin(start=recording.start, channels=recording.channels).text
    with path.open("wb") as file:
        if path.suffix.lower() == ".npz":
            np.savez_compressed(file, **arrays, **{ORIGIN: np.array(origin)})  # type: ignore[arg-type]
        else:
            write_mat(file, arrays | {"channels": np.array(names, object), ORIGIN: origin})


def read_arrays(path: Path, time: str | None = None, transposed: bool | None = None) -> Arrays:
    """Read signals from arrays.

    Either ``data`` (or ``y``, or the only matrix, if no other array is as long), (n_samples, n_channels), with
    ``channels`` (or ``names``; ch1, ch2, ... without) or one array (n_samples,) per channel, named as the sensor; and
    ``rate`` (or ``fs``, ``SampleRate``, ..) [Hz], its reciprocal ``dt``, or an array `time` (``t`` or ``time``, perhaps
    with its unit, unless given). A .npy file is ``data`` alone. Fields of a structure are arrays.

    Parameters
    ----------
    path : of the file
    time : name of the array of times
    transposed : whether each row of ``data`` is a channel; required if there are more channels than samples and neither
        names nor times show the orientation

    Raises
    ------
    DataError
        Naming the file and the array.
    """
    arrays = _load(path)
    t_name = time_column(arrays, time) or time or "t"
    rate, t = _rate(path, arrays), arrays.pop(t_name, None)
    data, names = _stated_matrix(arrays), _first(arrays, _NAMES)
    origin, remarks, left = _origin(path, arrays), [], []
    matrix = _only_matrix(arrays)
    if data is None and matrix is not None:
        data = arrays.pop(matrix)
        remarks = [f"channels of the array {matrix!r}"]
        left = [f"{name} {shape}" for name, shape in _numeric(arrays).items()]
    if data is None:
        arrays = {name: array.squeeze() for name, array in arrays.items() if array.size > 1}
        lengths = {array.shape for array in arrays.values()}
        if len(lengths) != 1 or len(next(iter(lengths))) != 1:
            found = ", ".join(f"{name} {array.shape}" for name, array in arrays.items()) or "nothing"
            raise DataError(path, f"expected 'data' or one array (n_samples,) a channel, found {found}")
        data, names = np.column_stack(list(arrays.values())), np.array(list(arrays))
    values = np.atleast_2d(_numbers(path, "data", data).T).T
    if values.ndim != 2:
        raise DataError(path, f"data: expected (n_samples, n_channels), found {values.shape}")
    is_row = transposed is None and len(values) == 1 and (names is None or np.size(names) == 1)
    values = values.T if transposed or is_row else values
    if transposed is None:
        _ask_orientation(path, values.shape, names, t)
    if values.shape[1] > _MAX_CHANNELS:
        raise DataError(path, f"data: expected up to {_MAX_CHANNELS} channels, found {values.shape[1]}")
    return Arrays(
        names=_channel_names(path, names, values.shape[1]),
        values=values,
        rate=rate,
        t=None if t is None else _numbers(path, t_name, t).ravel(),
        t_name=t_name,
        origin=origin,
        left=tuple(left),
        remarks=tuple(remarks),
    )


def _stated_matrix(arrays: dict[str, Any]) -> Any:  # noqa: ANN401 - whatever the file holds
    """Take the matrix with one of its names out of arrays; a vector ``y`` with an ``x`` as long is a channel."""
    sizes = [np.size(array) for array in arrays.values()]
    for name in (name for name in _DATA if name in arrays):
        shape = np.shape(arrays[name])
        if sizes.count(math.prod(shape)) == 1 or max(shape, default=0) < math.prod(shape):
            return arrays.pop(name)
    return None


def _only_matrix(arrays: dict[str, Any]) -> str | None:
    """Return the name of the matrix of the channels: the only one, and longer than all other arrays; None without."""
    numeric = _numeric(arrays)
    matrices = [name for name, shape in numeric.items() if len(shape) == 2 and min(shape) > 1]
    if len(matrices) != 1:
        return None
    n_samples = max(numeric.pop(matrices[0]))
    return None if any(max(shape) >= n_samples for shape in numeric.values()) else matrices[0]


def _numeric(arrays: dict[str, Any]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the arrays of more than one number, by name."""
    return {
        name: np.shape(array)
        for name, array in arrays.items()
        if np.asarray(array).dtype.kind in "biufc" and np.size(array) > 1
    }


def _rate(path: Path, arrays: dict[str, Any]) -> float | None:
    """Take the sampling rate [Hz] out of arrays, None if there is none."""
    for kind in (_RATE, _STEP):
        for name, array in arrays.items():
            flat = np.ravel(array)
            if not kind.fullmatch(name) or not len(flat) or not np.all(flat == flat[0]):
                continue
            value = float(_numbers(path, name, array).ravel()[0])
            if kind is _RATE or (value > 0 and plausible_rate(1 / value)):
                del arrays[name]
                return value if kind is _RATE else 1 / value
    return None


def _ask_orientation(path: Path, shape: tuple[int, int], names: object, t: object) -> None:
    """Refuse an array with more channels than samples, unless names or times show its orientation."""
    n_samples, n_channels = shape
    named = names is not None and np.size(np.asarray(names)) == n_channels
    timed = t is not None and np.size(np.asarray(t)) == n_samples
    if n_samples < n_channels and not named and not timed:
        raise DataError(
            path,
            f"data: found {shape}, which is {n_channels} channels of {n_samples} samples: give --transpose if each row "
            "is a channel, --no-transpose if each column is one",
        )


def _origin(path: Path, arrays: dict[str, Any]) -> Origin | None:
    """Take the origin of an exported file out of its arrays; an array of numbers of that name is a signal."""
    found = arrays.get(ORIGIN)
    if found is None or np.asarray(found).dtype.kind != "U":
        return None
    return parse_origin(str(np.asarray(arrays.pop(ORIGIN)).squeeze()), path)


def _load(path: Path) -> dict[str, Any]:
    try:
        if path.suffix.lower() == ".npy":
            check_array(path)
            return {_DATA[0]: np.atleast_2d(np.load(path).T).T}
        if path.suffix.lower() == ".npz":
            check_archive(path)
            with path.open("rb") as opened, np.load(opened) as file:
                return dict(file)
        return read_mat(path)
    except DataError:
        raise
    except (OSError, *DAMAGED_FILE) as error:
        raise DataError(path, f"holds no arrays: {error}") from error


def _first(arrays: dict[str, Any], names: tuple[str, ...]) -> Any:  # noqa: ANN401 - whatever the file holds
    return next((arrays.pop(name) for name in names if name in arrays), None)


def _numbers(path: Path, name: str, array: Any) -> FloatArray:  # noqa: ANN401 - whatever the file holds
    try:
        values = np.asarray(array, np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(path, f"{name}: expected numbers, found {np.asarray(array).dtype}") from error
    if not values.size or np.isinf(values).any():
        raise DataError(path, f"{name}: expected finite numbers, found {'inf' if values.size else 'none'}")
    return values


def _channel_names(path: Path, names: Any, n: int) -> tuple[str, ...]:  # noqa: ANN401 - whatever the file holds
    if names is None:
        return tuple(f"ch{i + 1}" for i in range(n))
    found = tuple(str(np.asarray(name).squeeze()).strip() for name in np.ravel(names))
    if len(found) != n or len(set(found)) != n:
        raise DataError(path, f"channels: expected {n} different names, found {found}")
    return found
