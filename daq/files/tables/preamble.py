"""Sampling rate, start time and unit that the lines before a table state."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from daq.files.columns.date_cells import CLOCK, DAY, MOMENT, Dated, date_order, slashed, with_numeric_month
from daq.files.columns.stated_start import StatedStart, UnclearDate
from daq.files.columns.time_column import TIME_UNITS
from daq.files.columns.units import parse_unit

Line = tuple[int, str]  # number, counted from 1, and text

_RATE = re.compile(
    r"\W*(samp\w*|scan|abtast\w*|mess|measurement|acquisition)[\s_-]*(rate|frequency|freq|frequenz)\b[^\d\n]{0,40}?"
    r"(?P<rate>\d[\d.,]*(e[-+]?\d+)?)\W*(?P<kilo>k)?(hz)?\b.*",
    re.IGNORECASE,
)
_RATE_WITHIN = re.compile(  # anywhere in a line, if no line begins with the rate
    r"\b(sampl\w*|data|output)[\s_-]*(rate|frequency)\W{1,10}(?P<rate>\d[\d.,]*)\s*(?P<kilo>k)?hz\b", re.IGNORECASE
)
_STEP = re.compile(
    r"\W*(delta_x|delta|sampl\w*[\s_-]*(interval|period|time))\b[^\d\n]{0,40}?"
    r"(?P<step>\d[\d.,]*(e[-+]?\d+)?)\W*(?P<unit>ms|us|s|sec)?\b.*",
    re.IGNORECASE,
)
_UNIT = re.compile(r"\W*(units?|einheit(en)?|unit[eé]s?|unidad(es)?)\b[\s:;=,]+(?P<unit>\S.*)", re.IGNORECASE)
_LABELLED = re.compile(
    r"(?P<label>[^\d:;=,\t]{0,60}(?:\bT0)?)[\s:;=,]+(?:[^\W\d_]{2,12}\.?,?\s+)?(?P<value>\d.*)", re.IGNORECASE
)
_STARTS = re.compile(  # in English, German, French, Spanish, Italian, Portuguese, Dutch and the languages of the north
    r"\b(t0|(start|mess|measurement|acquisition|record\w*|test|trigger|aufnahme)?_?"
    r"(date|datum|fecha|data|dato|time|timestamp|zeit|uhrzeit|zeitpunkt|heure|hora|ora|tijd|tid|start|begin\w*))\b",
    re.IGNORECASE,
)
_OTHER_TIMES = re.compile(
    r"\b(end|ende|stop|fin|fine|fim|slut|interval\w*|step|duration|dauer|calib\w*|kalib\w*|export\w*|print\w*|delta|"
    r"gedruckt|created|erstellt|modified|version)\b",
    re.IGNORECASE,
)
_DASHED = re.compile(r"^(\d{1,2})-(\d{1,2})-(\d{4})")  # the day or the month is first, as with slashes
_SPACED = re.compile(r"^(\d{4}) (\d\d?) (\d\d?) (\d\d?) (\d\d?) (\d\d?)(?=\.|$)")  # all parts apart
_MAX_LENGTH = 200  # characters of a line that is searched


def stated_rate(preamble: Sequence[Line]) -> float | None:
    """Return the sampling rate that a preamble states [Hz], None if it states none."""
    for _, text in preamble:
        if found := _RATE.match(text[:_MAX_LENGTH]):
            return _positive(found["rate"], 1e3 if found["kilo"] else 1.0)
        if found := _STEP.match(text[:_MAX_LENGTH]):
            step = _positive(found["step"], TIME_UNITS[(found["unit"] or "s").lower().removesuffix("ec")])
            return None if step is None else 1 / step
    for _, text in preamble:
        if found := _RATE_WITHIN.search(text[:_MAX_LENGTH]):
            return _positive(found["rate"], 1e3 if found["kilo"] else 1.0)
    return None


@dataclass(frozen=True, kw_only=True)
class StatedUnit:
    """Unit that a line of a preamble states, as `UNITS = Counts`."""

    text: str
    line: int  #: number of the line
    usable: bool  #: whether it can be only that of the columns; lengths may be those of coordinates

    @property
    def remark(self) -> str:
        """Remark for the user of the file, if it is not usable."""
        return f"unit {self.text!r} in line {self.line} not used: give --unit if it is that of the columns"


def stated_unit(preamble: Sequence[Line]) -> StatedUnit | None:
    """Return the first unit of acceleration, voltage or counts that a preamble states, else the first other one."""
    found: list[StatedUnit] = []
    for number, text in preamble:
        match = _UNIT.match(text[:_MAX_LENGTH])
        stated = match["unit"].strip("[]() ") if match else ""
        if (unit := parse_unit(stated)) is not None:
            usable = unit.quantity not in ("velocity", "displacement")
            found.append(StatedUnit(text=stated, line=number, usable=usable))
    return next((unit for unit in found if unit.usable), found[0] if found else None)


def _positive(text: str, factor: float) -> float | None:
    try:
        value = float(text.rstrip(".,").replace(",", ".")) * factor
    except ValueError:
        return None
    return value if 0 < value < float("inf") else None


def stated_start(preamble: Sequence[Line], order: str | None) -> StatedStart | UnclearDate | None:
    """Return the start that a preamble states by its first date and its first time of day; None without a date.

    Both may be in one line, after a date alone, too. If lines of a date and of a time of day are repeated, the last of
    each count where they are later: they are those of a segment of the file.

    Parameters
    ----------
    preamble : lines before the table, such as `Datum: 04.05.2026` or `Start time;2026-05-04 10:00:00`
    order : order of day and month in dates as 04/05/2026. Default: the only one that is possible
    """
    values = [(number, label, value) for number, text in preamble for label, value in _start_values(text)]
    counts = Counter(label for _, label, _ in values)
    last = {label: (number, value) for number, label, value in values if counts[label] > 1}
    first = _start_of([(number, value) for number, _, value in values], order)
    segment = _start_of(sorted(last.values()), order)
    if not isinstance(first, StatedStart) or not isinstance(segment, StatedStart):
        return first
    return segment if len(last) > 1 and segment.with_clock and segment.time >= first.time else first


def _start_of(values: Sequence[tuple[int, str]], order: str | None) -> StatedStart | UnclearDate | None:
    """Return the start by the first date and the first time of day of numbered values, None without a date."""
    day: tuple[float, int] | None = None
    clock: float | None = None
    for number, value in values:
        if slashed(value):
            order = order or date_order([value])
            if order is None:
                return UnclearDate(text=value, place=f"line {number}")
        if day is None and (date := _read(DAY, value, order)) is not None:
            day = date, number
        elif (day is None or clock is None) and (moment := _read(MOMENT, value, order)) is not None:
            return StatedStart(time=round(1e6 * moment) * 1000, place=f"line {number}", with_clock=True)
        elif clock is None:
            clock = _read(CLOCK, value, order)
    if day is None:
        return None
    seconds = day[0] + (clock or 0.0)
    return StatedStart(time=round(1e6 * seconds) * 1000, place=f"line {day[1]}", with_clock=clock is not None)


def _start_values(text: str) -> Iterator[tuple[str, str]]:
    """Yield the label and the value of a line whose label is that of a date or a time of day; nothing for another line.

    A value that is repeated for each column is given once.
    """
    found = _LABELLED.match(with_numeric_month(text[:_MAX_LENGTH].replace('"', "")).lstrip("# "))
    if not found or not _STARTS.search(found["label"]) or _OTHER_TIMES.search(found["label"]):
        return
    cells = [cell.strip() for cell in re.split(r"[;\t]", found["value"]) if cell.strip()]
    once = cells[:1] if cells[1:] and cells[1].endswith(cells[0]) else cells
    value = re.sub(r"\s+", " ", " ".join(once)).strip(" ,")
    value = _SPACED.sub(r"\1-\2-\3 \4:\5:\6", value)
    yield found["label"].strip().casefold(), _DASHED.sub(r"\1/\2/\3", value)


def _read(kind: Dated, text: str, order: str | None) -> float | None:
    try:
        return kind.ordered(order).read(text)
    except ValueError:
        return None
