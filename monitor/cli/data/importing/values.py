"""Options of `import` that are read from texts."""

from collections.abc import Sequence

from daq.files import ACCELERATIONS, acceleration
from monitor.analysis.time_range import instant
from monitor.errors import ArgumentError


def factor_of(unit: str | None, scale: float | None) -> float | None:
    """Return the factor of a number [m/s2] if it was given explicitly."""
    if unit is None and scale is None:
        return None
    worth = acceleration(unit or "m/s2")
    if worth is None:
        raise ArgumentError("--unit", f"expected one of {', '.join(ACCELERATIONS)}, found {unit!r}")
    return worth * (scale or 1.0)


def columns_of(options: Sequence[str]) -> dict[str, str] | None:
    """Return column -> channel from NAME or NAME=SENSOR; None for all columns."""
    pairs = [(option.rpartition("=") if "=" in option else (option, "", option)) for option in options]
    columns = {column: channel for column, _, channel in pairs}
    if len(columns) < len(pairs) or len(set(columns.values())) < len(pairs):
        raise ArgumentError("--column", f"expected different names, found {', '.join(options)}")
    return columns or None


def start_of(text: str) -> int:
    """Return a time [ns UTC]; without a zone it is UTC."""
    try:
        return instant(text)
    except ValueError as error:
        raise ArgumentError("--start", str(error)) from error
