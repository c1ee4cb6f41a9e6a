"""Numbers of a table of text, read in bounded pieces; every mistake names its line."""

import csv
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq.errors import DataError
from daq.files.columns.date_cells import CLOCK, DAY, MOMENT, Dated, date_order, reads, slashed
from daq.files.origin import Origin, parse_origin
from daq.files.tables.layout import MAX_PREAMBLE, Layout, find_layout, missing
from daq.files.tables.packed import table_text
from daq.files.tables.preamble import Line
from daq.types import FloatArray, IndexArray

ORIGIN = "# modalwatch "  #: begins the comment that states the origin of an exported table
_LINES = 20_000  # of a piece
_MAX_HEAD, _MIN_LINES = 500_000, 50  # characters of the first lines, and how many lines are read in any case
_LATIN = {0xDC00 + byte: byte for byte in range(0xA0, 0x100)}  # bytes that are no UTF-8, as they are read
_NO_TEXT = re.compile("[\udc80-\udcff]")


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of numbers."""

    values: FloatArray  #: (n_rows, n_columns), NaN where a cell is empty
    line: IndexArray  #: (n_rows,) number of each row's line in the file
    dated: bool = False  #: whether the column of times has dates, here as seconds since 1970 [UTC]


@dataclass(frozen=True)
class _Wanted:
    """Columns to read of a table."""

    layout: Layout
    places: tuple[int, ...]  # of columns
    times: int | None  # place of the column of times
    dated: Mapping[int, Dated]  # places of columns of dates and times of day

    @property
    def decimal_comma(self) -> bool:
        return self.layout.delimiter != ","


def table_layout(path: Path, names: Sequence[str] | None = None) -> tuple[Layout, Origin | None]:
    """Return the place and the columns of a table, and the origin that a comment before it states.

    Parameters
    ----------
    path : of the file
    names : names of all columns, if given

    Raises
    ------
    DataError
        Naming the file and the line.
    """
    lines: list[Line] = []
    comments: list[Line] = []
    origin, size = None, 0
    with _lines_of(path) as every:
        for number, text in every:
            if text.startswith(ORIGIN + "{") and not lines:  # other comments may begin alike
                origin = parse_origin(text.removeprefix(ORIGIN), path)
            elif text.startswith("#"):
                comments.append((number, text))
            else:
                lines.append((number, text))
            size += len(text)
            if max(len(lines), len(comments)) >= (MAX_PREAMBLE if size < _MAX_HEAD else _MIN_LINES):
                break
    return find_layout(path, lines, comments, names), origin


def is_table(path: Path) -> bool:
    """Return whether a file begins as a table with tabs, semicolons or commas."""
    try:
        layout, _ = table_layout(path)
    except DataError:
        return False
    return layout.delimiter is not None and layout.named and min(len(layout.head), len(layout.names)) > 1


def read_rows(
    path: Path,
    layout: Layout,
    places: Sequence[int],
    times: int | None = None,
    days: int | None = None,
    order: str | None = None,
) -> Table:
    """Read some columns of a table.

    Numbers may have a decimal comma, unless commas are between the columns.

    Parameters
    ----------
    path : of the file
    layout : its place and columns
    places : of the columns to read; the others may have any content
    times : place of a column that may hold dates with times (ISO 8601, with days or months first, or with AM and PM;
        UTC where they state no zone) in place of numbers
    days : place of the column of dates, if `times` holds times of day: their sum replaces `times`
    order : order of day and month in dates as 01/02/2026. Default: that of the first rows, if only one is possible

    Raises
    ------
    DataError
        Naming the file, and line and column where there is one.
    """
    wanted = _Wanted(layout, tuple(sorted({*places, *(p for p in (times, days) if p is not None)})), times, {})
    pieces: list[FloatArray] = []
    numbers: list[int] = []
    with _lines_of(path) as every:
        rows = ((number, text) for number, text in every if number >= layout.first and not text.startswith("#"))
        while piece := list(itertools.islice(rows, _LINES)):
            if not pieces and times is not None:
                dated = _dated(path, wanted, days, order, piece)
                wanted = _Wanted(layout, wanted.places, times, dated)
            if wanted.decimal_comma:
                piece = [(number, text.replace(",", ".")) for number, text in piece]
            pieces.append(_values(path, piece, wanted))
            numbers += [number for number, _ in piece]
    if not pieces:
        raise DataError(path, "holds no numbers after the line with the columns' names")
    values = np.concatenate(pieces)
    if times is not None and days is not None:
        values[:, wanted.places.index(times)] += values[:, wanted.places.index(days)]
    chosen = [wanted.places.index(place) for place in places]
    return Table(values[:, chosen], np.array(numbers, np.intp), bool(wanted.dated))


@contextmanager
def _lines_of(path: Path) -> Iterator[Iterator[Line]]:
    with table_text(path) as file:
        yield _content(path, file)


def _content(path: Path, lines: Iterable[str]) -> Iterator[Line]:
    """Yield the lines with content; text that is not UTF-8 is read as Latin-1, as spreadsheets write ° and ²."""
    for number, line in enumerate(lines, 1):
        text = (line if line.isascii() else line.translate(_LATIN)).strip(" \r\n")
        if "\0" in text or (not text.isascii() and _NO_TEXT.search(text)):
            raise DataError(path, f"line {number}: is no text in UTF-8 or Latin-1")
        if text and not text.isspace():
            yield number, text


def _dated(path: Path, wanted: _Wanted, days: int | None, order: str | None, piece: list[Line]) -> dict[int, Dated]:
    """Return the formats of columns of dates: of `times` if its first cell is one, or of both if days are apart."""
    times = wanted.times
    if times is None:
        return {}
    rows = [(line[0], _cells(path, line, wanted.layout.delimiter)) for line in piece[:MAX_PREAMBLE]]
    place = times if days is None else days
    cells = [(number, row[place]) for number, row in rows if len(row) > place and row[place].strip()]
    first = next((row[times] for _, row in rows if len(row) > times and row[times].strip()), "")
    if days is None and (_is_number(first) or not reads(MOMENT, first)):
        return {}
    if order is None and cells and slashed(cells[0][1]):
        order = date_order(cell for _, cell in cells)
        if order is None:
            number, cell = cells[0]
            raise DataError(
                path,
                f"line {number}, column {wanted.layout.names[place]!r}: {cell.strip()!r:.40} may have the day or the "
                "month first: give --date-order dmy or mdy",
            )
    return {times: MOMENT.ordered(order)} if days is None else {times: CLOCK, days: DAY.ordered(order)}


def _cells(path: Path, line: Line, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line[1].split()
    try:
        return next(csv.reader([line[1]], delimiter=delimiter, skipinitialspace=True))
    except csv.Error as error:
        raise DataError(path, f"line {line[0]}: {error}") from error


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return text.lower() != "nan"


def _values(path: Path, piece: list[Line], wanted: _Wanted) -> FloatArray:
    """Return the numbers of a piece (n_lines, n_columns): at once if all cells are numbers, else cell by cell."""
    every = len(wanted.places) == len(wanted.layout.names)
    try:
        values = np.loadtxt(
            [text for _, text in piece],
            delimiter=wanted.layout.delimiter,
            comments=None,
            ndmin=2,
            usecols=None if every else wanted.places,
            converters={place: kind.read for place, kind in wanted.dated.items()},
        )
    except ValueError:
        values = np.array([_row(path, line, wanted) for line in piece])
    if values.shape != (len(piece), len(wanted.places)) or np.isinf(values).any():
        values = np.array([_row(path, line, wanted) for line in piece])
    return values


def _row(path: Path, line: Line, wanted: _Wanted) -> list[float]:
    number, _ = line
    cells, width = _cells(path, line, wanted.layout.delimiter), len(wanted.layout.names)
    if len(cells) > width and (wanted.layout.commented or not any(cell.strip() for cell in cells[width:])):
        cells = cells[:width]
    if len(cells) > width or len(cells) <= max(wanted.places):
        raise DataError(path, f"line {number}: expected {width} cells, found {len(cells)}")
    return [_cell(path, number, wanted, place, cells[place].strip()) for place in wanted.places]


def _cell(path: Path, number: int, wanted: _Wanted, place: int, cell: str) -> float:
    dated = wanted.dated.get(place)
    try:
        value = float("nan") if missing(cell) else (dated.read if dated else float)(cell)
    except ValueError:
        value = float("inf")
    if np.isinf(value):
        what = dated.like if dated else f"a number, or {MOMENT.like}" if place == wanted.times else "a number"
        name = wanted.layout.names[place]
        raise DataError(path, f"line {number}, column {name!r}: expected {what}, found {cell!r:.40}")
    return value
