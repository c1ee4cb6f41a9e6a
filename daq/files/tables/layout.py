"""Place of the table in a file of text: delimiter, names, units and first row, after any preamble.

The rows are the lines with the most usual number of cells whose cells are numbers, dates or empty, but for columns of
text; lines after the last line of text count unless more rows are before it. The names are in the line before them, or
before a line of units. Lines before, such as those of Catman, LabVIEW and DASYLab, are the preamble.
"""

import csv
import itertools
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from daq.errors import DataError
from daq.files.columns.date_cells import numeric_date
from daq.files.columns.headings import parted
from daq.files.columns.time_column import TIME_UNITS, time_column
from daq.files.columns.units import TEMPERATURES, parse_unit, plain
from daq.files.tables.preamble import Line, stated_rate

MAX_PREAMBLE = 500  #: lines in which the table begins
_MAX_COLUMNS = 10_000
_DELIMITERS = ("\t", ";", ",", None)  # None is white space
_MISSING = {"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "---"}
_NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?|[-+]?(inf|infinity)", re.IGNORECASE)
_DATE = re.compile(
    r"(?=\d)(\d{1,4}[-./年]\d{1,2}[-./月]\d{1,4}日?)?[\sT,]*"
    r"(\d{1,2}:\d{2}(:\d{2})?([.,:]\d+)?\s*([AP]\.?M\.?)?\s*(Z|UTC|[-+]\d\d:?\d\d)?)?",
    re.IGNORECASE,
)
_MIN_ROWS = 2  # at the end of the lines
_LONGEST = 100  # characters of a number or date
_COMMENTS = {"", "comment", "comments", "kommentar"}  # names of columns that rows may lack at their end
_OTHER_UNITS = {  # of quantities that are no motion
    *("-", "1", "%", "n", "kn", "mn", "nm", "knm", "pa", "kpa", "mpa", "bar", "mbar", "um/m", "ustrain", "m/m", "hz"),
    *("rad", "mrad", "deg", "°", "a", "ma", "mv/v", "lb", "lbf", "psi", "rpm", "1/min", "w", "kw", "ohm", "epsilon"),
}
_LABEL_ENDS = ("=", ":")
_UNIT_LABEL = re.compile(r"y_unit_label|units?|einheit(en)?", re.IGNORECASE)
Kind = Literal["value", "text", "empty"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Layout:
    """Place and columns of a table."""

    names: tuple[str, ...]  #: of all columns, with units; "" for one without a name
    header: int  #: number of the line of names; that of the first row where there is none
    named: bool  #: whether the names are in the file or given, not numbers
    delimiter: str | None  #: None is white space
    first: int  #: number of the line of the first row
    kinds: tuple[Kind, ...]  #: content of each column in the first rows
    head: tuple[tuple[str, ...], ...]  #: cells of the first rows
    commented: bool = False  #: whether rows may have a comment after the last column
    rate: float | None = None  #: sampling rate that the preamble states [Hz]
    preamble: tuple[Line, ...] = ()  #: lines before the first row
    repeated: tuple[str, ...] = ()  #: names of columns that repeat an earlier one, here without a name

    @property
    def remark(self) -> str:
        """Sentence for the user; "" for a table that begins with its names."""
        if not self.named:
            return f"no names of columns: they are 1 to {len(self.names)}"
        return f"the table begins in line {self.header}" if self.header > 1 and self.header < self.first else ""


def find_layout(path: Path, lines: Sequence[Line], comments: Sequence[Line], names: Sequence[str] | None) -> Layout:
    """Find the table in the first lines of a file.

    Parameters
    ----------
    path : of the file
    lines : first lines with content, at most `MAX_PREAMBLE`
    comments : lines with # before the last of them, where names may be
    names : names of all columns, if given

    Raises
    ------
    DataError
        Naming the file and the line.
    """
    if not lines:
        raise DataError(path, "is empty: expected a line with the columns' names, then numbers")
    found = max((_rows(lines, delimiter) for delimiter in _DELIMITERS), key=lambda rows: (rows.width > 1, rows.count))
    if not found.count:
        found = _without_rows(lines)
    elif found.width == 1 and found.begin:
        text = lines[found.begin - 1][1]
        delimiter = next((d for d in _DELIMITERS if d and d in text), ",")
        found = replace(found, delimiter=delimiter, cells=[cells_of(line, delimiter) for _, line in lines])
    width = found.width
    first = lines[found.begin][0] if found.begin < len(lines) else lines[-1][0] + 1
    preamble = tuple(sorted([*(line for line in comments if line[0] < first), *lines[: found.begin]]))
    layout = Layout(
        names=tuple(str(place + 1) for place in range(width)),
        header=first,
        named=False,
        delimiter=found.delimiter,
        first=first,
        kinds=found.kinds,
        head=tuple(tuple(cells) for cells in found.cells[found.begin :] if len(cells) == width),
        rate=stated_rate(preamble),
        preamble=preamble,
    )
    if names is not None:
        if len(names) != width:
            raise DataError(path, f"line {first}: expected {len(names)} columns as named, found {width}")
        return replace(layout, names=tuple(names), named=True)
    header = _header(lines, found, comments)
    if max(width, len(header[1]) if header else 0) > _MAX_COLUMNS:
        number = header[0] if header else first
        raise DataError(path, f"line {number}: expected up to {_MAX_COLUMNS} columns")
    if header is None:
        return layout
    number, cells, units = header
    commented = len(cells_of(dict(lines).get(number, ""), found.delimiter)) > len(cells)
    lacking: list[Kind] = ["empty"] * (len(cells) - width)
    kinds = (*found.kinds, *lacking)[: len(cells)]
    named = [_with_unit(cell, unit) for cell, unit in zip(cells, units, strict=True)]
    again = _repeats(named, layout.head)
    if commented:  # the first row may be one with a comment
        first = next((line for line, _ in lines if line > number), first)
    return replace(
        layout,
        names=tuple("" if place in again else name for place, name in enumerate(named)),
        header=number,
        named=True,
        kinds=tuple("empty" if place in again else kind for place, kind in enumerate(kinds)),
        first=first,
        commented=commented,
        repeated=tuple(named[place] for place in again),
    )


def _repeats(names: Sequence[str], head: Sequence[Sequence[str]]) -> list[int]:
    """Return the places of columns of times with the name and the cells of an earlier one: those of each channel."""
    found: list[int] = []
    for place, name in enumerate(names):
        first = names.index(name)
        times = name and time_column([name], None)
        if times and first < place and head and all(row[place : place + 1] == row[first : first + 1] for row in head):
            found.append(place)
    return found


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of a table with one delimiter."""

    delimiter: str | None
    count: int  # of lines that may be rows
    width: int
    begin: int  # place of the first row among the lines
    kinds: tuple[Kind, ...]
    cells: list[list[str]]  # of all lines


def _rows(lines: Sequence[Line], delimiter: str | None) -> _Rows:
    """Return the rows that lines have with a delimiter; none if they have none."""
    cells = [cells_of(text, delimiter) for _, text in lines]
    kinds = [[kind_of(cell, delimiter) for cell in row] for row in cells]
    likely = [place for place, row in enumerate(kinds) if 2 * row.count("text") <= len(row) and "value" in row]
    usual = _last_lines(likely, cells, kinds)
    widths = Counter(len(cells[place]) for place in usual)
    if not widths:
        return _Rows(delimiter, 0, 0, 0, (), cells)
    width = max(widths, key=lambda n: (widths[n], -next(k for k in usual if len(cells[k]) == n)))
    rows = [kinds[place] for place in usual if len(kinds[place]) == width]
    columns = tuple(_column_kind([row[column] for row in rows]) for column in range(width))
    begin = next((k for k in likely if len(kinds[k]) == width and _fits(kinds[k], columns)), None)
    if begin is None:
        return _Rows(delimiter, 0, 0, 0, (), cells)
    count = sum(len(row) == width and _fits(row, columns) for row in kinds)
    noted = [any(len(row) == width and row[column] == "text" for row in kinds[begin:]) for column in range(width)]
    columns = tuple("text" if kind == "empty" and noted[k] else kind for k, kind in enumerate(columns))
    return _Rows(delimiter, count, width, begin, columns, cells)


def _last_lines(
    likely: Sequence[int], cells: Sequence[Sequence[str]], kinds: Sequence[Sequence[Kind]]
) -> Sequence[int]:
    """Return the places of likely rows without another line after them; all likely rows if those may be a footer.

    A short file may have more lines of numbers in its preamble than rows, but each of them begins with another label.
    They are a footer if as many rows of one width are before them, or if there are too few of them.
    """
    first = len(likely)
    while first and likely[first - 1] == len(cells) - len(likely) + first - 1:
        first -= 1
    last = likely[first:]
    runs: list[list[int]] = []
    for place in likely[:first]:
        if not runs or place != runs[-1][-1] + 1 or len(cells[place]) != len(cells[place - 1]):
            runs.append([])
        runs[-1].append(place)
    rows = [
        run for run in runs if any(kinds[k][0] != "text" for k in run) or len({cells[k][0] for k in run}) < len(run)
    ]
    return likely if len(last) < _MIN_ROWS or any(len(run) >= len(last) for run in rows) else last


def _fits(row: Sequence[Kind], columns: Sequence[Kind]) -> bool:
    return all(kind != "text" or column == "text" for kind, column in zip(row, columns, strict=True))


def _column_kind(kinds: Sequence[Kind]) -> Kind:
    """Return the usual content of a column."""
    text, value = kinds.count("text"), kinds.count("value")
    if text > value and 2 * text > len(kinds):
        return "text"
    return "value" if value else "empty"


def _without_rows(lines: Sequence[Line]) -> _Rows:
    """Return the first line as names, where no line is a row."""
    text = lines[0][1]
    delimiter = next((d for d in _DELIMITERS if d and d in text), ",")
    cells = [cells_of(line, delimiter) for _, line in lines]
    kinds: list[Kind] = ["value"] * len(cells[0])
    return _Rows(delimiter, 0, len(cells[0]), 1, tuple(kinds), cells)


def _header(lines: Sequence[Line], rows: _Rows, comments: Sequence[Line]) -> tuple[int, list[str], list[str]] | None:
    """Return the number, the cells and the units of the line of names, None if there is none."""
    before = [(lines[k][0], _fitted(rows, rows.cells[k])) for k in range(rows.begin - 1, -1, -1)]
    if not before:
        above = [(n, text.lstrip("# ")) for n, text in comments if n < lines[rows.begin][0]][-1:]
        before = [(n, _fitted(rows, cells_of(t, rows.delimiter)) or _fitted(rows, t.split())) for n, t in above]
        if before and (before[0][1] is None or not _names_columns(before[0][1])):
            return None
    if before and before[0][1] is None and rows.begin == 1 and len(rows.cells[0]) > 1:
        number, cells = lines[0][0], rows.cells[0]  # too many or too few names: rows are refused for it
        return number, cells, [""] * len(cells)
    fitting = [(number, cells) for number, cells in before if cells is not None]
    if not fitting or (before[0][1] is None and rows.width < 3):
        return None
    nearest = fitting[0][1]
    if _are_units(nearest) or not _names_columns(nearest):
        # the names may be farther up, before a line of units
        pairs = [*fitting[:2], *((number, cells or []) for number, cells in before)]
        paired = next(
            (
                (*names, units[1])
                for units, names in itertools.pairwise(pairs)
                if names[0] < units[0] and _are_units(units[1]) and _names_columns(names[1])
            ),
            None,
        )
        if paired is not None:
            number, cells, units = paired
            return number, cells, [unit.strip("[]() ") for unit in units]
    # words between spaces are a sentence rather than names, unless they are in the last line
    others = fitting[1:] if rows.delimiter is not None else []
    named = next((line for line in others if _names_columns(line[1])), None)
    if _names_columns(nearest) or _is_heading(nearest):
        named = fitting[0]
    if named is None:
        return None
    number, cells = named
    labelled = next((c for n, c in fitting if n < number and _UNIT_LABEL.fullmatch(c[0].strip(" :"))), None)
    if labelled is None or not any(_are_units([cell]) for cell in labelled[1:]):
        return number, cells, [""] * len(cells)
    return number, cells, ["", *labelled[1:]]


def _fitted(rows: _Rows, cells: list[str]) -> list[str] | None:
    """Return names for the columns of rows, None if there are too many or too few."""
    names = [cell.strip() for cell in cells]
    while len(names) > rows.width and names[-1].casefold() in _COMMENTS:
        names.pop()
    lacking = rows.kinds[len(names) :]
    if len(names) > rows.width or any(kind != "empty" for kind in lacking):
        return None
    return [*names, *[""] * len(lacking)]


def _is_heading(cells: Sequence[str]) -> bool:
    """Return whether the cells of the line before the rows are names, perhaps given twice or with a colon."""
    texts = [cell.strip() for cell in cells if cell.strip()]
    words = sum(kind_of(text, None) == "text" for text in texts)
    return 2 * words >= len(texts) > 0 and not any(text in _LABEL_ENDS for text in texts)


def _names_columns(cells: Sequence[str]) -> bool:
    """Return whether cells may be names: some are text, most differ, and they are no label with its value."""
    texts = [cell.strip() for cell in cells if cell.strip()]
    ended = [text.endswith(_LABEL_ENDS) for text in texts]
    if any(text in _LABEL_ENDS for text in texts) or (ended and ended[0] and not all(ended)):
        return False
    return 2 * len(set(texts)) > len(texts) and any(kind_of(cell, None) == "text" for cell in cells)


def _are_units(cells: Sequence[str]) -> bool:
    """Return whether all cells are units or empty."""
    texts = [plain(cell.strip("[]() ")) for cell in cells if cell.strip()]
    known = (*TIME_UNITS, *TEMPERATURES, *_OTHER_UNITS)
    return bool(texts) and all(parse_unit(text) is not None or text in known for text in texts)


def _with_unit(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if name and unit and not _are_units([parted(name)[1]]) else name


def cells_of(text: str, delimiter: str | None) -> list[str]:
    """Return the cells of a line; a line with damaged quotes, or with too long a cell, is one cell."""
    if delimiter is None:
        return text.split()
    if '"' not in text:
        return text.split(delimiter)
    try:
        return next(csv.reader([text], delimiter=delimiter, skipinitialspace=True))
    except csv.Error:
        return [text]


def kind_of(cell: str, delimiter: str | None) -> Kind:
    """Return what a cell is by its form."""
    text = cell.strip()
    if text.casefold() in _MISSING:
        return "empty"
    if len(text) > _LONGEST:
        return "text"
    if _NUMBER.fullmatch(text) and not (delimiter == "," and "," in text):
        return "value"
    return "value" if _DATE.fullmatch(numeric_date(text)) else "text"


def missing(cell: str) -> bool:
    """Return whether a cell states that there is no value."""
    return cell.strip().casefold() in _MISSING
