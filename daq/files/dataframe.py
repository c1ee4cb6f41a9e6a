"""Tables of pandas to recordings."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from daq.errors import DataError
from daq.files.columns.time_column import time_column
from daq.files.columns.time_grid import UnevenError
from daq.files.columns.units import ACCELERATIONS, acceleration
from daq.files.measured import processed
from daq.files.measurement_file import Columns, as_measured, columns_to_read, known_rate, on_grid
from daq.files.options import DataOptions
from daq.notebook import notebook_extra
from daq.types import FloatArray, Recording

if TYPE_CHECKING:
    import pandas

_SOURCE = Path("dataframe")  # named in errors


def read_dataframe(frame: "pandas.DataFrame", *, rate: float | None = None, unit: str | None = None) -> Recording:
    """Return a table as a recording, as `Recording.from_dataframe` documents."""
    options = DataOptions(rate=rate, factor=None if unit is None else _factor(unit))
    names = [str(name) for name in frame.columns]
    if len(set(names)) < len(names):
        raise DataError(_SOURCE, f"expected columns of different names, found {', '.join(names)}")
    if (time := time_column(names, None)) is not None:
        raise DataError(_SOURCE, f"column {time!r}: expected a channel, found times: use frame.set_index({time!r})")
    signals, warm, _ = columns_to_read(_SOURCE, names, options)
    if not signals:
        raise DataError(_SOURCE, f"has no column of a channel, but {', '.join(names) or 'none'}")
    wanted = [*(signal.column for signal in signals), *warm]
    values = np.column_stack([_numbers(frame.iloc[:, names.index(name)], name) for name in wanted])
    if rate is None:
        found = Columns(signals, warm, *_on_times(frame.index, values), began=_began(frame.index))
    elif frame.index.dtype.kind in "mM":
        raise DataError(_SOURCE, "index: holds times, leave out rate")
    else:
        found = Columns(signals, warm, values, known_rate(_SOURCE, rate, None, ""))
    return processed(_SOURCE, (as_measured(_SOURCE, found, options),), options)[0].recording


def _on_times(index: "pandas.Index", values: FloatArray) -> tuple[FloatArray, float]:
    """Return rows at their places on an even grid, and its rate [Hz]."""
    if index.dtype.kind not in "mMf":
        raise DataError(_SOURCE, f"index: expected dates, time differences or seconds, found {index.dtype}: give rate")
    t = index if index.dtype.kind == "f" else (index - index.min()).total_seconds()
    try:
        return on_grid(t.to_numpy(np.float64), values)
    except UnevenError as error:
        raise DataError(_SOURCE, f"index, row {error.row}: {error.why}") from error


def _began(index: "pandas.Index") -> int | None:
    """Return the first date [ns UTC], None where the index holds none."""
    return int(index.as_unit("ns").asi8[0]) if index.dtype.kind == "M" else None


def _factor(unit: str) -> float:
    factor = acceleration(unit)
    if factor is None:
        raise ValueError(f"unit: expected one of {', '.join(ACCELERATIONS)}, found {unit!r}")
    return factor


def _numbers(column: "pandas.Series", name: str) -> FloatArray:
    """Return a column as numbers (n_rows,), NaN where it is empty."""
    with notebook_extra():
        import pandas
    found = pandas.to_numeric(column, errors="coerce")
    if found.dtype.kind not in "iuf" or column.dtype.kind in "mM":
        raise DataError(_SOURCE, f"column {name!r}: expected numbers, found {column.dtype}")
    values = found.to_numpy(np.float64, na_value=np.nan)
    wrong = np.flatnonzero((np.isnan(values) & column.notna().to_numpy()) | np.isinf(values))
    if len(wrong):
        row = int(wrong[0])
        raise DataError(_SOURCE, f"column {name!r}, row {row}: expected a number, found {column.iloc[row]!r}")
    return np.asarray(values, np.float64)
