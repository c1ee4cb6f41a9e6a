"""Dates and times of day as tables write them, months also by names in the languages of measuring programs."""

import re
import unicodedata
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, time

DATE_ORDERS = ("dmy", "mdy")  #: day first, or month first

_DOTTED = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4}|\d{2})(?=$|[\s,.T])")  # 31.01.2026: the day is first
_SLASHED = re.compile(r"(\d{1,2})/(\d{1,2})/(\d{4}|\d{2})(?=$|[\s,.T])")  # day or month first
_YEAR_FIRST = re.compile(r"(\d{4})[/.年](\d{1,2})[/.月](\d{1,2})日?(?=$|[\s,.T])")
_CLOCK = re.compile(
    r"(?P<head>(?:.*\S)?[\s,.T]+)?(?P<hour>\d{1,2})(?P<rest>:\d\d[\d:.,]*)\s*(?P<half>[AP]\.?M\.?)?(?P<zone>\S*)",
    re.IGNORECASE,
)
_HALVES = {"a": 0, "p": 12}
_MAX_LENGTH = 60  # characters of a date with a time
_EPOCH = date(1970, 1, 1)
_NAMES = (  # English, German, French, Spanish, Italian, Portuguese, Dutch, of the languages of the north, Polish
    "january januar janvier enero gennaio janeiro januari styczen stycznia",
    "february februar fevrier febrero febbraio fevereiro februari luty lutego",
    "march marz maerz mars marzo marco maart mrt marts marzec marca",
    "april avril abril aprile kwiecien kwietnia",
    "may mai mayo maggio maio mei maj maja",
    "june juni juin junio giugno junho czerwiec czerwca",
    "july juli juillet julio luglio julho lipiec lipca",
    "august aout agosto augustus augusti sierpien sierpnia",
    "september septembre septiembre setiembre settembre setembro wrzesien wrzesnia",
    "october oktober octobre octubre ottobre outubro pazdziernik pazdziernika",
    "november novembre noviembre novembro listopad listopada",
    "december dezember decembre diciembre dicembre dezembro desember grudzien grudnia",
)
_MIN_LETTERS = 3  # of an abbreviation
_NAME = r"(?P<name>[^\W\d_]{3,12})\.?"
_DAY = r"(?P<day>\d{1,2})"
_BETWEEN = r"[\s./-]*(?:(?:de|of|di)\s+)?"
_ORDERS = (
    re.compile(
        rf"(?<!\d){_DAY}(?:st|nd|rd|th|er|º|ª)?{_BETWEEN}{_NAME}{_BETWEEN},?\s*(?P<year>\d{{4}}|\d{{2}})(?![\d:])"
    ),
    re.compile(rf"\b{_NAME}[\s-]+{_DAY}(?:st|nd|rd|th)?[.,\s-]\s*(?P<year>\d{{4}})(?!\d)"),
    re.compile(rf"\b{_NAME}\s+{_DAY}\s+(?P<clock>\d{{1,2}}:\d\d[\d:.]*)\s+(?P<year>\d{{4}})(?!\d)"),  # as C writes it
)
_WEEKDAY = re.compile(r"^[^\W\d_]{2,12}[.,]* +(?=\d)")


@dataclass(frozen=True)
class Dated:
    """Format of the cells of a column that holds no plain numbers."""

    parse: Callable[[str, str | None], float]  #: [s]; a ValueError where the text is none
    like: str  #: expected form
    order: str | None = None  #: of dates with slashes

    def read(self, text: str) -> float:
        """Return seconds.

        Raises
        ------
        ValueError
            If the text is of another form.
        """
        return self.parse(text, self.order)

    def ordered(self, order: str | None) -> "Dated":
        """Return the format with an order of day and month."""
        return replace(self, order=order)


def _moment(text: str, order: str | None) -> float:
    found = datetime.fromisoformat(_iso(text, order))
    seconds = (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
    if seconds < 0:
        raise ValueError(text)
    return seconds


def _day(text: str, order: str | None) -> float:
    days = (date.fromisoformat(_iso(text, order)) - _EPOCH).days
    if days < 0:
        raise ValueError(text)
    return 86400.0 * days


def _clock(text: str, _: str | None) -> float:
    if ":" not in text:  # 0950 is a number, not a time of day
        raise ValueError(text)
    found = time.fromisoformat(_two_digit_hour(text.strip()))
    offset = found.utcoffset()
    seconds = 3600.0 * found.hour + 60.0 * found.minute + found.second + 1e-6 * found.microsecond
    return seconds - (offset.total_seconds() if offset else 0.0)


def _iso(text: str, order: str | None) -> str:
    """Return a date, perhaps with a time, in ISO 8601."""
    plain = text.strip()
    if plain[4:5] != "-":
        plain = numeric_date(plain)
    if not any(mark in plain[:5] for mark in "./年"):
        ready = len(plain) < 11 or plain[10] == "T" or (plain[13:14] == ":" and plain[-1] not in "Mm.")
        return plain if ready else _two_digit_hour(plain)
    plain = _YEAR_FIRST.sub(lambda f: _date(f[1], f[2], f[3]), plain, count=1)
    plain = _DOTTED.sub(lambda f: _date(f[3], f[2], f[1]), plain, count=1)
    if order is not None:
        day, month = (1, 2) if order == "dmy" else (2, 1)
        plain = _SLASHED.sub(lambda f: _date(f[3], f[month], f[day]), plain, count=1)
    return _two_digit_hour(plain)


def _date(year: str, month: str, day: str) -> str:
    return f"{_full_year(year):04d}-{int(month):02d}-{int(day):02d}"


def _full_year(year: str) -> int:
    """Return a year; one of two digits is from 1970 to 2069."""
    return int(year) if len(year) > 2 else 1970 + (int(year) - 70) % 100


def _two_digit_hour(text: str) -> str:
    """Return a time of day, perhaps after a date, with an hour of two digits of 24."""
    found = _CLOCK.fullmatch(text) if len(text) <= _MAX_LENGTH else None
    if found is None:
        return text
    hour = int(found["hour"])
    if found["half"]:
        if not 1 <= hour <= 12:
            raise ValueError(text)
        hour = hour % 12 + _HALVES[found["half"][0].lower()]
    head = found["head"].strip(" ,.T\t") + " " if found["head"] else ""
    return f"{head}{hour:02d}{found['rest']}{found['zone']}"


MOMENT = Dated(_moment, "a time as 2026-01-31T12:00:00.005")  #: seconds since 1970
DAY = Dated(_day, "a date as 2026-01-31")  #: seconds since 1970 of its midnight
CLOCK = Dated(_clock, "a time of day as 12:00:00.005")  #: seconds since midnight; UTC where it states no zone


def reads(kind: Dated, text: str) -> bool:
    """Return whether a cell is of a kind, in any order of day and month."""
    for order in DATE_ORDERS:
        try:
            kind.ordered(order).read(text)
        except ValueError:
            continue
        return True
    return False


def slashed(text: str) -> bool:
    """Return whether a cell begins with a date whose order of day and month is not certain by its form."""
    return _SLASHED.match(text.strip()) is not None


def date_order(cells: Iterable[str]) -> str | None:
    """Return the only order of day and month in which all dates are possible, None if both or none are."""
    found = [match for cell in cells if (match := _SLASHED.match(cell.strip()))]
    possible: list[str] = []
    if all(int(match[2]) <= 12 for match in found):
        possible.append("dmy")
    if all(int(match[1]) <= 12 for match in found):
        possible.append("mdy")
    return possible[0] if found and len(possible) == 1 else None


def numeric_date(cell: str) -> str:
    """Return a cell that begins with a date: if the month is a name, in ISO 8601 without the day of the week."""
    numeric = with_numeric_month(cell)
    return cell if numeric == cell else _WEEKDAY.sub("", numeric)


def month_of(name: str) -> int | None:
    """Return the month from 1 to 12 of a name, in full or its first three letters or more; None if not certain."""
    letters = "".join(c for c in unicodedata.normalize("NFKD", name.casefold()) if not unicodedata.combining(c))
    if len(letters) < _MIN_LETTERS:
        return None
    found = [k for k, names in enumerate(_NAMES, 1) if any(one.startswith(letters) for one in names.split())]
    return found[0] if len(found) == 1 else None


def with_numeric_month(text: str) -> str:
    """Return a text with its date in ISO 8601, if the month is a name: 27. Nov. 2026 becomes 2026-11-27.

    The day may be before or after the name, a year of two digits is from 1970 to 2069. A text without such a date is
    returned as it is.
    """
    for order in _ORDERS:
        for found in order.finditer(text):
            month = month_of(found["name"])
            if month is not None:
                year = _full_year(found["year"])
                clock = f" {found['clock']}" if "clock" in order.groupindex else ""
                day = f"{year:04d}-{month:02d}-{int(found['day']):02d}{clock}"
                return text[: found.start()] + day + text[found.end() :]
    return text
