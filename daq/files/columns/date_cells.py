"""Dates and times of day as tables write them."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, date, datetime, time

_DAY_FIRST = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})\b")  # 31.01.2026; slashes are day first here, month first there
_EPOCH = date(1970, 1, 1)


@dataclass(frozen=True)
class Dated:
    """Format of the cells of a column that holds no plain numbers."""

    read: Callable[[str], float]  #: [s]; a ValueError where the text is none
    like: str  #: expected form


def _moment(text: str) -> float:
    found = datetime.fromisoformat(_iso(text))
    seconds = (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
    if seconds < 0:
        raise ValueError(text)
    return seconds


def _day(text: str) -> float:
    days = (date.fromisoformat(_iso(text)) - _EPOCH).days
    if days < 0:
        raise ValueError(text)
    return 86400.0 * days


def _clock(text: str) -> float:
    plain = text.strip()
    if ":" not in plain:  # 0950 is a number, not a time of day
        raise ValueError(text)
    found = time.fromisoformat(f"0{plain}" if plain.index(":") == 1 else plain)
    offset = found.utcoffset()
    seconds = 3600.0 * found.hour + 60.0 * found.minute + found.second + 1e-6 * found.microsecond
    return seconds - (offset.total_seconds() if offset else 0.0)


def _iso(text: str) -> str:
    return _DAY_FIRST.sub(lambda found: f"{found[3]}-{int(found[2]):02d}-{int(found[1]):02d}", text.strip(), count=1)


MOMENT = Dated(_moment, "a time as 2026-01-31T12:00:00.005")  #: seconds since 1970
DAY = Dated(_day, "a date as 2026-01-31")  #: seconds since 1970 of its midnight
CLOCK = Dated(_clock, "a time of day as 12:00:00.005")  #: seconds since midnight; UTC where it states no zone


def reads(kind: Dated, text: str) -> bool:
    """Return whether a cell is of a kind."""
    try:
        kind.read(text)
    except ValueError:
        return False
    return True
