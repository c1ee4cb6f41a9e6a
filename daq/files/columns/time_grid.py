"""Sampling grid of a table: rate, missing samples, uneven times."""

from dataclasses import dataclass

import numpy as np

from daq.types import BoolArray, FloatArray, IndexArray

#: deviation of a sample's time from the even grid, relative to the period: a quarter radian at 0.4 of the rate
TOLERANCE = 0.1
_NICE, _NICE_SHARE = 0.02, 1e-5  # a rounder rate may be off: periods at the end of the record, and relative
_LATEST, _MIN_STEP = 1e12, 1e-9  # s
_LARGEST_SHARE = 10_000  # periods a row: a table with more missing than that holds a wrong time


class UnevenError(ValueError):
    """A time that is not on the even grid.

    Parameters
    ----------
    row : of the time, counted from 0
    why : reason
    """

    def __init__(self, row: int, why: str) -> None:
        super().__init__(f"row {row}: {why}")
        self.row, self.why = row, why


@dataclass(frozen=True, eq=False)
class Grid:
    """An even time grid."""

    rate: float  #: samples per second [Hz]
    index: IndexArray  #: (n_rows,) position of each row on the grid; skipped positions are missing samples


def even_grid(t: FloatArray) -> Grid:
    """Find the even grid that times (n_rows,) [s] lie on.

    The period is the mean of all steps that are one period long, so that times printed with few digits still give it
    exactly; a longer step is missing rows.

    Raises
    ------
    UnevenError
        If a time does not increase, or is off the grid by more than `TOLERANCE` of a period.
    """
    if len(t) < 2:
        raise UnevenError(0, "at least two times are needed for the rate")
    good = np.abs(t) < _LATEST
    if not good.all():
        raise UnevenError(int(np.argmin(good)), "the time is missing, or no number of seconds")
    step = np.diff(t)
    if step.min() < _MIN_STEP:
        raise UnevenError(int(np.argmax(step < _MIN_STEP)) + 1, "the time does not increase")
    single = np.rint(step / np.median(step)) == 1
    steps = np.rint(step / step[single].mean()).astype(np.intp)
    index = np.concatenate([[0], np.cumsum(np.maximum(steps, 1))])
    if index[-1] > _LARGEST_SHARE * len(t):
        row = int(np.argmax(steps)) + 1
        raise UnevenError(row, f"t = {t[row]:.9g} s is {steps[row - 1]} periods after the one before")
    rate, off = _fit(t, index)
    rate, off = _fit(t, index, np.abs(off) <= max(TOLERANCE / 2, 4 * float(np.median(np.abs(off)))))
    worst = np.flatnonzero(np.abs(off) > TOLERANCE)
    if len(worst):
        row = int(worst[0])
        raise UnevenError(row, f"t = {t[row]:.9g} s is {abs(off[row]):.2g} periods off an even grid of {rate:.6g} Hz")
    return Grid(rate, index)


def _fit(t: FloatArray, index: IndexArray, trusted: BoolArray | None = None) -> tuple[float, FloatArray]:
    """Return the rate of the line through the trusted times, and how many periods each time (n_rows,) lies off it."""
    some = np.ones(len(t), bool) if trusted is None else trusted
    period, _ = np.polyfit(index[some], t[some] - t[0], 1)
    rate = _nice(1 / float(period), int(index[-1]))
    off = (t - t[0]) * rate - index
    return rate, np.asarray(off - np.median(off))


def _nice(rate: float, n: int) -> float:
    """Return the roundest rate that is consistent with a record of `n` periods."""
    rounded = (float(f"{rate:.{digits}g}") for digits in range(1, 10))
    return next((nice for nice in rounded if abs(nice / rate - 1) < min(_NICE / n, _NICE_SHARE)), rate)
