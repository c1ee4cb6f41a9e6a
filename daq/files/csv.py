"""Tables of text: a line of names, then numbers; read in bounded pieces, and every mistake names its line."""

import csv
import itertools
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from daq.errors import DataError
from daq.files.columns.date_cells import CLOCK, DAY, MOMENT, Dated, reads
from daq.files.origin import Origin, parse_origin
from daq.types import FloatArray, IndexArray

ORIGIN = "# modalwatch "  #: begins the comment that states the origin of an exported table
_MAX_COLUMNS = 10_000
_LINES = 20_000  # of a piece
_DELIMITERS = ("\t", ";", ",")
_LATIN = {0xDC00 + byte: byte for byte in range(0xA0, 0x100)}  # bytes that are no UTF-8, as they are read
_NO_TEXT = re.compile("[\udc80-\udcff]")
Line = tuple[int, str]  # number, counted from 1, and text


@dataclass(frozen=True, eq=False)
class Table:
    """Named columns of numbers."""

    names: tuple[str, ...]
    values: FloatArray  #: (n_rows, n_columns), NaN where a cell is empty
    line: IndexArray  #: (n_rows,) number of each row's line in the file
    dated: bool = False  #: whether the column of times has dates, here as seconds since 1970 [UTC]


@dataclass(frozen=True)
class _Layout:
    """Header of a file, and the requested columns."""

    header: tuple[str, ...]
    delimiter: str
    chosen: tuple[int, ...]  # places in the header
    times: int | None = None  # place of the column of times
    dated: Mapping[int, Dated] = field(default_factory=dict)  # places of columns of dates and times of day


def csv_origin(path: Path) -> Origin | None:
    """Return the origin that a comment before the header states, None if there is none; errors as for `read_csv`."""
    try:
        with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
            for line in file:
                if line.startswith(ORIGIN + "{"):  # other comments may begin alike
                    return parse_origin(line.removeprefix(ORIGIN), path)
                if line.strip() and not line.startswith("#"):
                    break
    except OSError as error:
        raise DataError(path, f"cannot be read: {error.strerror}") from error
    return None


def csv_head(path: Path) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of a table's columns, and its first cells, if any; errors as for `read_csv`."""
    with _content_of(path) as lines:
        layout = _layout(path, next(lines, None), ())
        first = next(lines, None)
        return layout.header, () if first is None else tuple(_cells(path, first, layout.delimiter))


def read_csv(
    path: Path, wanted: Collection[str] | None = None, times: str | None = None, days: str | None = None
) -> Table:
    """Read a table of text.

    The first line that is neither empty nor a comment (#) names the columns. It also determines the delimiter: the
    first of tab, semicolon and comma that it contains. With a semicolon or tab, numbers may have a decimal comma.

    Parameters
    ----------
    path : of the file
    wanted : columns to read; the others may have any content. Default: all
    times : column that may hold dates with times (ISO 8601, or with days first, as 31.01.2026; UTC where they state no
        zone) in place of numbers
    days : column of dates, if `times` holds times of day: their sum replaces `times`

    Raises
    ------
    DataError
        Naming the file, and line and column where there is one.
    """
    with _content_of(path) as lines:
        return _read(path, lines, wanted, times, days)


@contextmanager
def _content_of(path: Path) -> Iterator[Iterator[Line]]:
    try:
        with path.open(encoding="utf-8-sig", errors="surrogateescape", newline="") as file:
            yield _content(path, file)
    except OSError as error:
        raise DataError(path, f"cannot be read: {error.strerror}") from error


def _content(path: Path, lines: Iterable[str]) -> Iterator[Line]:
    """Yield the lines with content; text that is not UTF-8 is read as Latin-1, as spreadsheets write ° and ²."""
    for number, line in enumerate(lines, 1):
        text = (line if line.isascii() else line.translate(_LATIN)).strip(" \r\n")
        if "\0" in text or (not text.isascii() and _NO_TEXT.search(text)):
            raise DataError(path, f"line {number}: is no text in UTF-8 or Latin-1")
        if text and not text.startswith("#"):
            yield number, text


def _read(
    path: Path, lines: Iterator[Line], wanted: Collection[str] | None, times: str | None, days: str | None
) -> Table:
    layout = _layout(path, next(lines, None), wanted)
    pieces: list[FloatArray] = []
    numbers: list[int] = []
    while piece := list(itertools.islice(lines, _LINES)):
        if not pieces and times is not None:
            layout = _with_dates(path, layout, times, days, piece)
        if layout.delimiter != ",":
            piece = [(number, text.replace(",", ".")) for number, text in piece]
        pieces.append(_values(path, piece, layout))
        numbers += [number for number, _ in piece]
    if not pieces:
        raise DataError(path, "holds no numbers after the line with the columns' names")
    names = tuple(layout.header[place] for place in layout.chosen)
    values = np.concatenate(pieces)
    if times is not None and days is not None:
        values[:, names.index(times)] += values[:, names.index(days)]
    return Table(names, values, np.array(numbers, np.intp), bool(layout.dated))


def _with_dates(path: Path, layout: _Layout, times: str, days: str | None, piece: list[Line]) -> _Layout:
    """Read a column as dates if its first cell is one, or date and time if days have their own column."""
    place = layout.header.index(times)
    layout = replace(layout, times=place)
    if days is not None:
        return replace(layout, dated={place: CLOCK, layout.header.index(days): DAY})
    rows = (_cells(path, line, layout.delimiter) for line in piece)
    first = next((cells[place] for cells in rows if len(cells) > place and cells[place].strip()), "")
    return replace(layout, dated={place: MOMENT}) if not _is_number(first) and reads(MOMENT, first) else layout


def _layout(path: Path, line: Line | None, wanted: Collection[str] | None) -> _Layout:
    """Return the content of the header."""
    if line is None:
        raise DataError(path, "is empty: expected a line with the columns' names, then numbers")
    number, text = line
    delimiter = next((d for d in _DELIMITERS if d in text), ",")
    header = tuple(name.strip() for name in _cells(path, line, delimiter))
    if len(header) > _MAX_COLUMNS:
        raise DataError(path, f"line {number}: expected up to {_MAX_COLUMNS} columns, found {len(header)}")
    if any(_is_number(name) for name in header):
        raise DataError(path, f"line {number}: expected the columns' names, found numbers: {text:.60}")
    for name in header if wanted is None else wanted:
        if name not in header:
            raise DataError(path, f"line {number}: expected a column {name!r}, found {', '.join(header)}")
        if not name or header.count(name) > 1:
            raise DataError(path, f"line {number}: the column name {name!r} is {'given twice' if name else 'empty'}")
    chosen = tuple(place for place, name in enumerate(header) if wanted is None or name in wanted)
    return _Layout(header, delimiter, chosen)


def _cells(path: Path, line: Line, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line[1]], delimiter=delimiter, skipinitialspace=True))
    except csv.Error as error:
        raise DataError(path, f"line {line[0]}: {error}") from error


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return text.lower() != "nan"


def _values(path: Path, piece: list[Line], layout: _Layout) -> FloatArray:
    """Return the numbers of a piece (n_lines, n_columns): at once if all cells are numbers, else cell by cell."""
    every = len(layout.chosen) == len(layout.header)
    try:
        values = np.loadtxt(
            [text for _, text in piece],
            delimiter=layout.delimiter,
            comments=None,
            ndmin=2,
            usecols=None if every else layout.chosen,
            converters={place: kind.read for place, kind in layout.dated.items()},
        )
    except ValueError:
        values = np.array([_row(path, line, layout) for line in piece])
    if values.shape != (len(piece), len(layout.chosen)) or np.isinf(values).any():
        values = np.array([_row(path, line, layout) for line in piece])
    return values


def _row(path: Path, line: Line, layout: _Layout) -> list[float]:
    number, _ = line
    cells = _cells(path, line, layout.delimiter)
    if len(cells) != len(layout.header):
        raise DataError(path, f"line {number}: expected {len(layout.header)} cells, found {len(cells)}")
    return [_cell(path, number, layout, place, cells[place].strip()) for place in layout.chosen]


def _cell(path: Path, number: int, layout: _Layout, place: int, cell: str) -> float:
    dated = layout.dated.get(place)
    try:
        value = (dated.read if dated else float)(cell) if cell else float("nan")
    except ValueError:
        value = float("inf")
    if np.isinf(value):
        what = dated.like if dated else f"a number, or {MOMENT.like}" if place == layout.times else "a number"
        raise DataError(path, f"line {number}, column {layout.header[place]!r}: expected {what}, found {cell!r:.40}")
    return value
