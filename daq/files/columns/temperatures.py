"""Temperatures in files of measurements."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from daq.errors import DataError
from daq.files.columns.headings import parted
from daq.files.columns.units import TEMPERATURES, plain
from daq.types import FloatArray

_COLDEST, _HOTTEST = -90.0, 150.0  # degC: plausible temperatures of a structure or a sensor
_OLDEST = 1800.0  # s: longest interval over which a reading is used


def mean_temperature(path: Path, names: Sequence[str], values: FloatArray, rate: float) -> FloatArray:
    """Return the mean of columns of temperatures (n_samples,) [degC]; NaN where none has a reading within half an hour.

    Between readings, which may be seldom, it is interpolated.

    Parameters
    ----------
    path : of their file
    names : of the columns
    values : (n_samples, n_columns) as in the file, NaN where there is no reading
    rate : samples per second [Hz]

    Raises
    ------
    DataError
        Naming a column whose unit is not a unit of temperature, or that has implausible values.
    """
    total, count = np.zeros(len(values)), np.zeros(len(values))
    for name, column in zip(names, values.T, strict=True):
        found = _between(celsius(path, name, column), rate)
        known = np.isfinite(found)
        total[known] += found[known]
        count += known
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def celsius(path: Path, name: str, values: FloatArray) -> FloatArray:
    """Return temperatures [degC] of a column; another unit is part of its name.

    Parameters
    ----------
    path : of its file
    name : of the column, perhaps with a unit
    values : (n,) as in the file, NaN where there is no reading

    Raises
    ------
    DataError
        If the unit is not a unit of temperature, or a value is implausible.
    """
    unit = parted(name)[1]
    worth, zero = TEMPERATURES.get(plain(unit), (0.0, 0.0)) if unit else (1.0, 0.0)
    if not worth:
        raise DataError(path, f"column {name!r}: expected a unit of temperatures, degC, K or degF, found {unit!r}")
    found = values * worth + zero
    wrong = found[(found < _COLDEST) | (found > _HOTTEST)]
    if len(wrong):
        raise DataError(
            path,
            f"column {name!r}: expected temperatures of {_COLDEST:g} to {_HOTTEST:g} degC, found {wrong[0]:g}: "
            "write another unit after the name, as in `temperature [K]`",
        )
    return found


def _between(readings: FloatArray, rate: float) -> FloatArray:
    """Return temperatures (n_samples,) between readings, NaN far from all."""
    known = np.flatnonzero(np.isfinite(readings))
    if not len(known):
        return readings
    place = np.arange(len(readings))
    after = np.searchsorted(known, place)
    nearest = np.minimum(
        np.abs(place - known[np.maximum(after - 1, 0)]), np.abs(place - known[np.minimum(after, len(known) - 1)])
    )
    return np.where(nearest <= _OLDEST * rate, np.interp(place, known, readings[known]), np.nan)


def known_mean(values: FloatArray) -> float:
    """Return the mean of the known values, NaN if there are none."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def temperature_remark(names: Sequence[str], temperature: FloatArray) -> str:
    """Return a remark on the columns used as temperatures; "" if there are none."""
    if not names:
        return ""
    what = ", ".join(repr(name) for name in names)
    known = temperature[np.isfinite(temperature)]
    held = f"{known.min():.4g} to {known.max():.4g} degC" if len(known) else "no reading"
    return f"temperature of the structure: {what}{', their mean' if len(names) > 1 else ''}: {held}"
