"""Dates whose month is a name, in the languages that programs for measurements write them in."""

import re
import unicodedata

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

    The day may be before or after the name, the year of two digits is of this century. A text without such a date is
    returned as it is.
    """
    for order in _ORDERS:
        for found in order.finditer(text):
            month = month_of(found["name"])
            if month is not None:
                year = int(found["year"]) + (2000 if len(found["year"]) == 2 else 0)
                clock = f" {found['clock']}" if "clock" in order.groupindex else ""
                day = f"{year:04d}-{month:02d}-{int(found['day']):02d}{clock}"
                return text[: found.start()] + day + text[found.end() :]
    return text
