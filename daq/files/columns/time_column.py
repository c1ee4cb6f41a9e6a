"""Detection of the time column of a table, or time array of a file, and of its unit."""

import itertools
import re
from collections.abc import Collection, Sequence
from datetime import UTC, datetime
from pathlib import Path
from textwrap import shorten

import numpy as np

from daq.errors import DataError
from daq.files.columns.date_cells import CLOCK, DAY, MOMENT, reads
from daq.files.columns.headings import parted
from daq.types import FloatArray

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0}  #: [s]
_SPELT = {
    "s": ("sec", "second", "seconds"),
    "ms": ("msec", "millis", "millisecond", "milliseconds"),
    "us": ("usec", "µs", "μs", "micros", "microsecond", "microseconds"),
    "ns": ("nsec", "nanosecond", "nanoseconds"),
    "min": ("minute", "minutes"),
    "h": ("hour", "hours"),
    "d": ("day", "days"),
}
_WORDS = {word: unit for unit, words in _SPELT.items() for word in (unit, *words)}
_BARE = re.compile(
    r"t|time|time[ _]?stamp|date[ _/]?time|(measurement|elapsed|relative)[ _]time|x[ _]value|zeit|messzeit|temps|tiempo"
    r"|(time|zeit) +\d+( +- .*)?",  # those of Catman are numbered
    re.IGNORECASE,
)
_BEGUN = re.compile(r"(time|zeit|temps|tiempo|tempo|tijd|tid)\b", re.IGNORECASE)  # with a unit of time at its end
_TIMES = re.compile(  # whole names, as a channel may be called second_floor
    r".*time[ _]?stamp|((sensor|device|chip|system|local|unix|utc|gps|elapsed|relative|sample|logging)[ _]?)*"
    r"(time|elapsed|sec|seconds|epoch?|zeit|messzeit|sekunden|tiempo|tempo)([ _](elapsed|since[ _]\w+|[mun]?s))*"
    r"|(time|zeit) +\d+( +- .*)?",
    re.IGNORECASE,
)
_CLOCKED = re.compile(r"\s*[\[(]h+:m+[^\])]*[\])]$", re.IGNORECASE)  # form of times of day, as DASYLab writes it
_DAYS = re.compile(r"date|day|datum", re.IGNORECASE)
_DOUBTFUL = "T"  # temperatures are called so too: where another column is of times, it is not
_ENDED = re.compile(r"(?P<name>.+?)[\s_/]+(in\s+)?(?P<unit>[a-zµμ]+)", re.IGNORECASE)
# Hz: plausible rates of a log of a structure's accelerations, unless stated explicitly
_SLOWEST, _FASTEST = 1 - 1e-9, 200e3
_USUAL = 20e3  # Hz: up to which a unit is proposed
_MIN_PERIOD = 1e-12  # s
_LISTED = 100  # characters of the names of columns in a message
_MAX_START = 1 << 62  # ns
_CENTURY = (946_684_800.0, 4_102_444_800.0)  # s: 2000 to 2100
_LATEST = 1e20  # of a time: nanoseconds since 1970 are less


def time_column(names: Collection[str], asked: str | None) -> str | None:
    """Return the name of the column of times, None where there is none.

    Parameters
    ----------
    names : of all columns
    asked : requested name; else ``t``, ``time``, ``timestamp`` or ``datetime``, in upper or lower case, alone or with a
        unit as ``time [ms]``, ``Time (s)`` or ``t_us``; else one that begins so and has a unit of time in brackets
    """
    if asked is not None:
        return asked if asked in names else None
    bare = [name for name in names if _BARE.fullmatch(_CLOCKED.sub("", name))]
    united = (name for name in names if _BARE.fullmatch(_parted(name)[0]) and header_unit(name))
    surely = (name for name in bare if name != _DOUBTFUL)
    begun = (name for name in names if _BEGUN.match(name) and parted(name)[1].lower() in _WORDS)
    return next(itertools.chain(surely, united, bare, begun), None)


def date_column(names: Sequence[str], first: Sequence[str], time: str | None, *, dated: bool = False) -> str | None:
    """Return the name of the column of dates that times of day belong to, None where there is none.

    A column of that name that cannot be read is identified by its cells.

    Parameters
    ----------
    names : of all columns
    first : cells of the first line
    time : column of times
    dated : whether the date is stated elsewhere: a column that is not called so may be another date then
    """
    cell = dict(zip(names, first, strict=False))
    if time is None or not reads(CLOCK, cell.get(time, "")):
        return None
    called = [name for name in names if _DAYS.fullmatch(_parted(name)[0])]
    others = () if dated else names
    found = next((name for name in (*called, *others) if name != time and reads(DAY, cell.get(name, ""))), None)
    return found or (called[0] if called else None)


def time_column_by_cells(names: Sequence[str], head: Sequence[Sequence[str]], *, rated: bool) -> str | None:
    """Return the name of the column of times by its cells, None where there is none.

    It is the first of: dates with the time of day in a column that is called so; increasing numbers with a unit of time
    in brackets; dates with the time of day; times of day, if another column has the dates.

    Parameters
    ----------
    names : of all columns
    head : cells of the first lines
    rated : whether the file states a rate: only a column that is called so has the times then
    """
    cells = [(name, cell) for name, cell in zip(names, head[0] if head else (), strict=False) if name and ":" in cell]
    moments = [name for name, cell in cells if reads(MOMENT, cell)]
    called = next((name for name in moments if _DAYS.fullmatch(_parted(name)[0])), None)
    if called is not None or rated:
        return called
    timed = [place for place, name in enumerate(names) if parted(name)[1].lower() in _WORDS]
    rising = (names[place] for place in timed if _rises([row[place] for row in head]))
    clocks = (name for name, cell in cells if reads(CLOCK, cell) and date_column(names, head[0], name))
    return next(itertools.chain(rising, moments, clocks), None)


def is_further_time(name: str, cells: Sequence[str]) -> bool:
    """Return whether a column holds further times: by its name, and by numbers that increase."""
    return bool(_TIMES.fullmatch(parted(name)[0])) and _rises(cells)


def _rises(cells: Sequence[str]) -> bool:
    try:
        values = [float(cell.replace(",", ".")) for cell in cells]
    except ValueError:
        return False
    return len(values) > 1 and all(after > before for before, after in itertools.pairwise(values))


def header_unit(name: str) -> str | None:
    """Return the unit in the name of a column of times, None if it has no known unit."""
    return _WORDS.get(_parted(name)[1].lower())


def _parted(name: str) -> tuple[str, str]:
    """Return a name and its unit, either in brackets or after it; "" where there is none."""
    bare, unit = parted(name)
    if unit:
        return bare, unit
    found = _ENDED.fullmatch(name.strip())
    return (found["name"], found["unit"]) if found else (name, "")


def times_and_start(path: Path, name: str, t: FloatArray, given: str | None) -> tuple[FloatArray, int | None, str]:
    """Return times (n_rows,) in seconds, and of times counted from 1970 the first one [ns] with a remark.

    Parameters
    ----------
    path : of the file that holds them
    name : name of the column, whose unit is applied
    t : as in the file
    given : their unit by hand, of `TIME_UNITS`; it goes before that of `name`

    Raises
    ------
    DataError
        If no unit is stated, and seconds would give an implausible rate.
    """
    unit = given or header_unit(name) or _epoch_unit(t)
    if unit is None:
        _ask(path, name, t)
    times = t * TIME_UNITS[unit or "s"]
    if not _is_epoch(times):
        return times, None, ""
    return times, nanoseconds(times), f"times of {name!r} are counted from 1970 in {unit or 's'}"


def nanoseconds(t: FloatArray) -> int:
    """Return the first of the times [s] in nanoseconds, to a microsecond."""
    return 1000 * round(1e6 * float(t[0]))


def _epoch_unit(t: FloatArray) -> str | None:
    """Return the unit in which the first time is a date of this century, and the rate plausible; None without any."""
    for unit in ("s", "ms", "us", "ns"):
        period = _period(t) * TIME_UNITS[unit]
        if _is_epoch(t[:1] * TIME_UNITS[unit]) and period > 0 and plausible_rate(1 / period):
            return unit
    return None


def plausible_rate(rate: float) -> bool:
    """Return whether a log of a structure may have a rate [Hz]."""
    return _SLOWEST <= rate <= _FASTEST


def _period(t: FloatArray) -> float:
    """Return the median step of times, in their unit; 0 if there is none."""
    step = np.diff(np.where(np.abs(t) < _LATEST, t, np.nan))
    known = step[np.isfinite(step)]
    return float(np.median(known)) if len(known) else 0.0


def _is_epoch(t: FloatArray) -> bool:
    """Return whether times [s] are counted from 1970 rather than from the start of the measurement."""
    return len(t) > 0 and bool(_CENTURY[0] <= t[0] < _CENTURY[1])


def _ask(path: Path, name: str, t: FloatArray) -> None:
    """Refuse times that cannot be meant as seconds."""
    period = _period(t)
    # times that do not increase are reported elsewhere
    if period < _MIN_PERIOD or plausible_rate(1 / period):
        return
    rates = {unit: 1 / (period * worth) for unit, worth in TIME_UNITS.items()}
    usual = [f"{unit} ({hertz:.6g} Hz)" for unit, hertz in rates.items() if _SLOWEST <= hertz <= _USUAL]
    raise DataError(
        path,
        f"column {name!r}: times in seconds would make {rates['s']:.3g} Hz, which no log of a structure has: "
        f"give their unit by --time-unit, as {' or '.join(usual) or ', '.join(TIME_UNITS)}; s if it is right",
    )


def time_remark(name: str, given: str | None) -> str | None:
    """Return a remark on the unit of times, None if they are in seconds by default."""
    stated = header_unit(name)
    if given is not None and stated not in (None, given):
        return f"times of {name!r} are taken in {given}, by --time-unit, not in {stated}"
    unit = given or stated or "s"
    return f"times of {name!r} are in {unit}" if unit != "s" else None


def date_remark(name: str | None, began: int) -> str:
    """Return a remark that the start [ns UTC] was read from dates, or from the file where no column has the times."""
    if not 0 <= began < _MAX_START:
        return ""
    first = datetime.fromtimestamp(began // 10**6 / 1000, UTC).isoformat(timespec="milliseconds")
    if name is None:
        return f"start of the file: {first}"
    return f"times of {name!r} are dates, UTC where they state no zone: the first is {first}"


def no_times(names: Collection[str], asked: str | None) -> str:
    """Return the error for a missing column of times."""
    what = "of times, as 't' or 'time [ms]'" if asked is None else f"{asked!r} of times"
    return (
        f"has no column {what}, but {shorten(', '.join(names), _LISTED, placeholder=' ..')}: give --time NAME or --rate"
    )
