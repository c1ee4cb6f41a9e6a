"""Texts of quantities: numbers with deviations, times, durations, masses, stretches of members."""

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from daq.notebook import number_text, rounded_text, utc_text

if TYPE_CHECKING:
    from updater.planning import Stretches

_CERTAIN = 0.99  # no more is shown by sealed draws
MIN_P = 1e-12  #: smallest p that is stated: below it neither noise nor model is known well enough
_STD_PER_STEP = 1.05  # standard deviation over the median step of independent normal values: 1 / (0.6745 sqrt(2))
_UNITS = ((86400.0, "d"), (3600.0, "h"), (60.0, "min"))


def stretches_text(found: "Stretches") -> str:
    """Return stretches as words, nothing for none."""
    return ", ".join(f"{start:.2f} to {stop:.2f}" for start, stop in found)


def last_value(values: Sequence[float | None], std: float | None = None, *, sign: bool = False) -> str:
    """Return the last known value of a course with the digits of its deviation, `-` without any.

    Parameters
    ----------
    values : in the order of time
    std : standard deviation of the last one; by default from the median step between two values
    sign : whether a positive value has a sign, too
    """
    known = [value for value in values if value is not None]
    return rounded_text(known[-1], scatter(known) if std is None else std, sign=sign) if known else "-"


def scatter(values: Sequence[float]) -> float:
    """Return the standard deviation of single values of a course, from the median step; NaN of fewer than two."""
    steps = np.abs(np.diff(values))
    return _STD_PER_STEP * float(np.median(steps)) if steps.size else math.nan


def percent(ratio: float | None) -> float | None:
    """Return a ratio in per cent, None for none."""
    return None if ratio is None else 100 * ratio


def optional(value: float | None, form: str, none: str = "–") -> str:
    """Return a number as text, a dash for none."""
    return none if value is None else format(value, form)


def two_digits(value: float) -> str:
    """Return a number with two digits, without an exponent below a million."""
    return f"{float(f'{value:.2g}'):g}"


def mass_words(mass: float) -> str:
    """Return a mass in grams or kilograms, to two digits."""
    if mass >= 1:
        return f"{mass:.2g} kg" if mass < 10 else f"{mass:.0f} kg"
    return f"{1000 * mass:.2g} g" if mass < 0.1 else f"{1000 * mass:.0f} g"


def counted(number: int, noun: str) -> str:
    """Return a number of things, such as `1 force`, `3 forces`."""
    return f"{number} {noun}{'s' * (number != 1)}"


def aligned_numbers(pairs: Iterable[tuple[float, float]]) -> list[str]:
    """Return values with their standard deviations, with all decimal points and all `±` in one column."""
    rows = [number_text(value, std).split(" ± ") for value, std in pairs]
    columns = [aligned([row[k] if k < len(row) else "" for row in rows]) for k in (0, 1)]
    return [" ± ".join(cells) if cells[1].strip() else cells[0] for cells in zip(*columns, strict=True)]


def aligned(numbers: Sequence[str]) -> list[str]:
    """Return numbers padded with spaces, with all decimal points in one column."""
    parts = [number.partition(".") for number in numbers]
    left, right = (max((len(part[side]) for part in parts), default=0) for side in (0, 2))
    return [f"{whole:>{left}}{point or ' ' * (right > 0)}{rest:<{right}}" for whole, point, rest in parts]


def duration_words(seconds: float) -> str:
    """Return a duration in seconds, minutes or hours."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.3g} h"


def share_text(probability: float) -> str:
    """Return a probability in per cent, never rounded to certainty."""
    if probability > _CERTAIN:
        return f"over {100 * _CERTAIN:g} %"
    return f"{100 * probability:.1f} %"


def utc(time: int, *, date: bool = True) -> str:
    """Return a time [ns UTC] to the second."""
    return utc_text(time) if date else utc_text(time)[11:19]


def duration_text(seconds: float) -> str:
    """Return a duration in its largest two units, such as 3 h 20 min."""
    for (unit, name), (smaller, below) in zip(_UNITS, (*_UNITS[1:], (1.0, "s")), strict=True):
        if seconds >= unit:
            whole = int(seconds // unit)
            rest = int((seconds - whole * unit) // smaller)
            return f"{whole} {name} {rest} {below}" if rest else f"{whole} {name}"
    return f"{seconds:.0f} s"
