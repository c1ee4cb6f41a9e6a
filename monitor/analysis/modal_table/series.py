"""Series of modes that other programs have identified: one row per window, as CSV or MAT."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq import FloatArray, IndexArray, LogError
from daq.files import (
    DAMAGED_FILE,
    TIME_UNITS,
    celsius,
    date_column,
    header_unit,
    read_mat,
    read_rows,
    table_layout,
    temperatures_of,
    time_column,
)
from monitor.analysis.window import IdentifiedModes, IdentifiedWindow, RecordedWindow
from oma import ComplexArray, ModalEstimate, normalise

SERIES = (".csv", ".txt", ".tsv", ".mat")  #: endings of such files
_COLUMN = re.compile(
    r"(?P<quantity>f|freq|frequency|d|xi|zeta|damping|shape|phi)[ _]?(?P<mode>\d+)"
    r"(?:[ _](?P<rest>.+?))??(?P<std>[ _]std)?(?:\s*[\[(](?P<unit>[^\])]*)[\])])?",
    re.IGNORECASE,
)
_AIR = re.compile(r"(t_)?air", re.IGNORECASE)  # names of temperatures, in addition to those of all tables
_QUANTITY = {"f": "frequency", "freq": "frequency", "d": "damping", "xi": "damping", "zeta": "damping", "phi": "shape"}
_UNITS = {
    "frequency": {"Hz": 1.0, "kHz": 1e3, "rad/s": 0.5 / np.pi},
    "damping": {"-": 1.0, "%": 0.01},
    "shape": {"-": 1.0},
}
_SHAPE_STD = 0.02  # of a component of a shape without stated deviations; the baseline's scatter corrects it
_NO_SHAPE_STD = 1e-6  # of the shapes that stand for the numbers of modes, where none are measured
_DAMPING, _DAMPING_STD = 0.01, 0.003  # where it is not stated
_MIN_STD = 1e-6  # of a log frequency: files round
_MAX_DAMPING = 0.3  # larger values are per cent
_DATENUM_EPOCH = 719529.0  # d, of Matlab's `datenum` at 1970-01-01


@dataclass(frozen=True, eq=False, kw_only=True)
class ModalSeries:
    """Modes of many windows, each mode in a column of its own."""

    path: Path
    time: FloatArray  #: (n_windows,) start [s UTC since 1970, or since the start of the series]
    frequency: FloatArray  #: (n_windows, n_modes) [Hz], NaN where a mode is missing
    frequency_std: FloatArray  #: (n_windows, n_modes) [Hz]
    damping: FloatArray  #: (n_windows, n_modes) [-]
    damping_std: FloatArray  #: (n_windows, n_modes) [-]
    shape: ComplexArray  #: (n_windows, n_modes, n_channels)
    shape_std: FloatArray  #: (n_windows, n_modes, n_channels)
    channels: tuple[str, ...]  #: of the shapes
    has_shapes: bool  #: whether they were measured; else each mode has a unit vector, so that its column names it
    temperature: FloatArray  #: (n_windows,) [degC], NaN where not known
    ignored: tuple[str, ...]  #: columns without use

    @property
    def step(self) -> float:
        """Usual time from one window to the next [s]."""
        return float(np.median(np.diff(self.time)))

    def windows(self, device: str) -> Iterator[IdentifiedWindow]:
        """Yield the windows of one device, without delays, in the order of time; one without modes has a problem."""
        delays = {device: 0.0}
        step = round(1e9 * self.step)
        starts = np.round(1e9 * self.time).astype(np.int64)
        for k, start in enumerate(starts.tolist()):
            end = min(start + step, int(starts[k + 1])) if k + 1 < len(starts) else start + step
            recorded = RecordedWindow(
                start=start,
                end=end,
                channels=self.channels,
                temperature=float(self.temperature[k]),
                rms={},
                whole_rms=1.0,  # not known: the same for all
            )
            seen = np.flatnonzero(np.isfinite(self.frequency[k]))
            seen = seen[np.argsort(self.frequency[k, seen], kind="stable")]
            estimate = self._estimate(k, seen, start, end)
            modes = IdentifiedModes(estimate=estimate, delays=delays, harmonics=np.empty(0), left_out={})
            if len(seen):
                yield IdentifiedWindow(recorded=recorded, modes=modes)
            else:
                yield IdentifiedWindow(recorded=recorded, modes=None, problem="the row has no mode")

    def _estimate(self, k: int, seen: IndexArray, start: int, end: int) -> ModalEstimate:
        return ModalEstimate(
            channels=self.channels,
            frequency=self.frequency[k, seen],
            frequency_std=self.frequency_std[k, seen],
            damping=self.damping[k, seen],
            damping_std=self.damping_std[k, seen],
            shape=self.shape[k, seen],
            shape_std=self.shape_std[k, seen],
            support=np.ones(len(seen)),
            law_ratio=np.ones(len(seen)),
            start=start,
            end=end,
        )


def read_series(path: Path) -> ModalSeries:
    """Read a series of modes.

    Columns of a CSV table: `time` (dates, or a number with its unit, as `time [h]`); `f1 [Hz]`, `f2`, ... or
    `frequency_1`; if known `f1_std`, `damping_1 [%]`, `damping_1_std`, `shape_1_CHANNEL`, `shape_1_CHANNEL_std`,
    `temperature`, or columns with a unit of temperature. Empty cells are missing modes. Arrays of a MAT file: `time`
    (n,) likewise, or `datenum`; `frequency` (n, m), and if known `frequency_std`, `damping`, `damping_std` (n, m),
    `shape`, `shape_std` (n, m, c), `channels` (c names), `temperature` (n,).

    Raises
    ------
    LogError, DataError
        Naming the file, and line, column or array, if it is no such series.
    """
    return _of_mat(path) if path.suffix.lower() == ".mat" else _of_csv(path)


def _of_csv(path: Path) -> ModalSeries:
    layout, _ = table_layout(path)
    header, first = layout.names, layout.head[0]
    time = time_column(header, None)
    if time is None:
        raise LogError(path, f"expected a column 'time', found {', '.join(header)}")
    day = date_column(header, first, time)
    found = {name: match for name in header if name not in (time, day) and (match := _COLUMN.fullmatch(name))}
    others = [name for name in header if name not in (*found, time, day)]
    warm = [*temperatures_of(path, others, None), *(name for name in others if _AIR.fullmatch(name))]
    wanted = [*found, *(name for name in (time, day) if name), *warm]
    places = [header.index(name) for name in wanted]
    table = read_rows(path, layout, places, header.index(time), None if day is None else header.index(day))
    column = dict(zip(wanted, table.values.T, strict=True))
    seconds = column[time] if table.dated else column[time] * _unit(path, time)
    _check_time(path, seconds, [f"line {line}" for line in table.line])
    arrays: dict[str, dict[tuple[int, str], FloatArray]] = {}
    for name, match in found.items():
        quantity = _QUANTITY.get(match["quantity"].lower(), match["quantity"].lower())
        unit = (match["unit"] or next(iter(_UNITS[quantity]))).strip()
        if unit not in _UNITS[quantity]:
            raise LogError(path, f"column {name}: expected the unit {' or '.join(_UNITS[quantity])}, found {unit}")
        key = f"{quantity}_std" if match["std"] else quantity
        arrays.setdefault(key, {})[int(match["mode"]), match["rest"] or ""] = column[name] * _UNITS[quantity][unit]
    numbers = sorted(number for number, _ in arrays.get("frequency", {}))
    if not numbers:
        raise LogError(path, f"expected columns of frequencies, as 'f1 [Hz]', found {', '.join(header)}")
    channels = tuple(dict.fromkeys(rest for _, rest in arrays.get("shape", {})))
    parts: dict[str, FloatArray] = {
        key: _stacked(path, key, arrays[key], numbers, channels if key.startswith("shape") else ("",), len(seconds))
        for key in arrays
    }
    ignored = tuple(name for name in header if name not in wanted)
    return _series(
        path, seconds, parts, channels, _mean_temperature(path, {name: column[name] for name in warm}), ignored
    )


def _mean_temperature(path: Path, columns: Mapping[str, FloatArray]) -> FloatArray | None:
    """Return the mean of columns of temperatures (n_windows,) [degC], NaN where none is known; None without columns."""
    if not columns:
        return None
    found = np.array([celsius(path, name, values) for name, values in columns.items()])
    count = np.isfinite(found).sum(0)
    return np.where(count > 0, np.nansum(found, axis=0) / np.maximum(count, 1), np.nan)


def _stacked(
    path: Path,
    key: str,
    columns: Mapping[tuple[int, str], FloatArray],
    numbers: list[int],
    names: tuple[str, ...],
    n: int,
) -> FloatArray:
    """Return columns as (n_windows, n_modes), shapes as (n_windows, n_modes, n_channels); NaN where there is none."""
    known = {(number, name) for number in numbers for name in names}
    if strange := next((place for place in columns if place not in known), None):
        raise LogError(path, f"{key} {strange[0]} {strange[1]}".rstrip() + ": there is no frequency of this mode")
    empty = np.full(n, np.nan)
    values = np.array([[columns.get((number, name), empty) for name in names] for number in numbers])
    return np.moveaxis(values, 2, 0) if key.startswith("shape") else values[:, 0].T


def _of_mat(path: Path) -> ModalSeries:
    try:
        arrays = read_mat(path)
    except OSError as error:
        raise LogError(path, f"cannot be read: {error.strerror or error}") from error
    except DAMAGED_FILE as error:
        raise LogError(path, f"holds no arrays: {error}") from error
    frequency = _array(path, arrays, "frequency", 2)
    if frequency is None:
        raise LogError(path, f"expected an array 'frequency' (n_windows, n_modes), found {', '.join(arrays)}")
    if "datenum" in arrays:
        name, seconds = "datenum", _of_datenum(np.ravel(arrays["datenum"]).astype(float))
    else:
        name = time_column(arrays, None) or ""
        if not name:
            raise LogError(path, f"expected an array 'time' or 'datenum', found {', '.join(arrays)}")
        seconds = np.ravel(arrays[name]).astype(float) * (TIME_UNITS[header_unit(name) or "s"])
    if len(seconds) != len(frequency):
        raise LogError(path, f"{name}: expected {len(frequency)} times, one per row of frequency, found {len(seconds)}")
    _check_time(path, seconds, [f"{name}[{k}]" for k in range(len(seconds))])
    parts = {"frequency": frequency}
    for key, n_dims in (("frequency_std", 2), ("damping", 2), ("damping_std", 2), ("shape", 3), ("shape_std", 3)):
        values = _array(path, arrays, key, n_dims)
        if values is not None:
            if values.shape[:2] != frequency.shape:
                raise LogError(path, f"{key}: expected {frequency.shape} as frequency, found {values.shape[:2]}")
            parts[key] = values
    n_channels = parts["shape"].shape[2] if "shape" in parts else 0
    given = [str(np.squeeze(name)).strip() for name in np.ravel(arrays.get("channels", []))]
    if given and len(given) != n_channels:
        raise LogError(path, f"channels: expected {n_channels} names, found {len(given)}")
    channels = tuple(given or (f"ch{k + 1}" for k in range(n_channels)))
    warm = arrays.get("temperature")
    temperature = None if warm is None else np.ravel(warm).astype(float)
    if temperature is not None and len(temperature) != len(seconds):
        raise LogError(path, f"temperature: expected {len(seconds)} values, found {len(temperature)}")
    used = {*parts, name, "channels", "temperature"}
    return _series(path, seconds, parts, channels, temperature, tuple(key for key in arrays if key not in used))


def _of_datenum(days: FloatArray) -> FloatArray:
    """Return Matlab's dates in seconds since 1970, to the millisecond: a date is known to some 10 us."""
    return np.round((days - _DATENUM_EPOCH) * TIME_UNITS["d"], 3)


def _array(path: Path, arrays: Mapping[str, FloatArray], name: str, n_dims: int) -> FloatArray | None:
    values = arrays.get(name)
    if values is None:
        return None
    if values.ndim != n_dims or values.dtype.kind not in "fciub":
        raise LogError(path, f"{name}: expected numbers in {n_dims} dimensions, found {values.dtype} {values.shape}")
    return values if values.dtype.kind == "c" else np.asarray(values, float)


def _unit(path: Path, name: str) -> float:
    unit = header_unit(name)
    if unit is None:
        raise LogError(path, f"column {name!r}: expected dates, or a unit in the name, as 'time [h]'")
    return TIME_UNITS[unit]


def _check_time(path: Path, seconds: FloatArray, places: list[str]) -> None:
    if len(seconds) < 2:
        raise LogError(path, f"expected at least two rows, found {len(seconds)}")
    wrong = np.flatnonzero(~np.isfinite(seconds) | (np.diff(seconds, prepend=seconds[0] - 1) <= 0))
    if len(wrong):
        raise LogError(path, f"{places[wrong[0]]}: expected a time after that of the row before")


def _series(
    path: Path,
    seconds: FloatArray,
    parts: Mapping[str, FloatArray],
    channels: tuple[str, ...],
    temperature: FloatArray | None,
    ignored: tuple[str, ...],
) -> ModalSeries:
    """Return a checked series, with assumed values for what is not stated."""
    frequency = parts["frequency"].real
    wrong = np.argwhere(np.isfinite(frequency) & (frequency <= 0))
    if len(wrong):
        row, mode = wrong[0]
        raise LogError(
            path, f"row {row + 1}, mode {mode + 1}: expected a frequency over 0, found {frequency[row, mode]:g}"
        )
    damping = parts.get("damping", np.full(frequency.shape, _DAMPING)).real
    if np.nanmax(damping, initial=0.0) > _MAX_DAMPING:
        raise LogError(
            path, f"damping: expected ratios, found {np.nanmax(damping):g}; per cent are headed damping_1 [%]"
        )
    has_shapes = len(channels) > 1
    shape, shape_std = _shapes(parts, channels) if has_shapes else _unit_vectors(frequency)
    frequency = np.where(np.isfinite(shape).all(2), frequency, np.nan)  # a mode without its shape is missing
    return ModalSeries(
        path=path,
        time=seconds,
        frequency=frequency,
        frequency_std=_known(parts.get("frequency_std"), _scatter(frequency) * frequency),
        damping=_known(damping, np.full(frequency.shape, _DAMPING)),
        damping_std=_known(parts.get("damping_std"), np.full(frequency.shape, _DAMPING_STD)),
        shape=shape,
        shape_std=shape_std,
        channels=channels if has_shapes else tuple(f"mode {k + 1}" for k in range(shape.shape[2])),
        has_shapes=has_shapes,
        temperature=np.full(len(seconds), np.nan) if temperature is None else temperature,
        ignored=ignored,
    )


def _scatter(frequency: FloatArray) -> FloatArray:
    """Return the standard deviation (n_modes,) of a log frequency, by the differences of successive rows."""
    step = np.abs(np.diff(np.log(frequency), axis=0))
    known = np.asarray(np.isfinite(step).any(0))
    median = np.array([np.nanmedian(step[:, k]) if known[k] else _MIN_STD for k in range(frequency.shape[1])])
    return np.asarray(np.maximum(1.4826 / np.sqrt(2) * median, _MIN_STD))  # of a normal distribution


def _known(values: FloatArray | None, otherwise: FloatArray) -> FloatArray:
    """Return values, positive ones only, where they are known; else others."""
    if values is None:
        return otherwise
    return np.asarray(np.where(np.isfinite(values.real) & (values.real > 0), values.real, otherwise))


def _shapes(parts: Mapping[str, FloatArray], channels: tuple[str, ...]) -> tuple[ComplexArray, FloatArray]:
    """Return shapes of unit norm with their deviations (n_windows, n_modes, n_channels)."""
    given = parts["shape"].astype(complex)
    flat = given.reshape(-1, len(channels))
    measured = np.isfinite(flat).all(1) & flat.any(1)
    shape = np.full(flat.shape, np.nan, complex)
    shape[measured] = normalise(flat[measured])
    size = np.where(measured, np.linalg.norm(np.where(measured[:, None], flat, 1.0), axis=1), 1.0)
    std = parts.get("shape_std")
    relative = None if std is None else std.reshape(flat.shape) / size[:, None]
    known = _known(relative, np.full(flat.shape, _SHAPE_STD))
    return shape.reshape(given.shape), known.reshape(given.shape)


def _unit_vectors(frequency: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Return a shape per column, orthogonal to those of the others: the columns state which mode is which."""
    n, m = frequency.shape
    shape = np.broadcast_to(np.eye(m, max(m, 2), dtype=complex), (n, m, max(m, 2)))
    return shape, np.full(shape.shape, _NO_SHAPE_STD)
