"""Tables of text: a line of names, then numbers; read in bounded pieces, and every mistake names its line."""

import csv
import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq.errors import DataError
from daq.recording import FloatArray, IndexArray

_LINES = 20_000  # of a piece
_DELIMITERS = ("\t", ";", ",")
Line = tuple[int, str]  # number, counted from 1, and text


@dataclass(frozen=True, eq=False)
class Table:
    """Named columns of numbers."""

    names: tuple[str, ...]
    values: FloatArray  #: (n_rows, n_columns), NaN where a cell is empty
    line: IndexArray  #: (n_rows,) number of each row's line in the file


def read_csv(path: Path) -> Table:
    """Read a table of text.

    The first line that is neither empty nor a comment (#) names the columns; it also tells the delimiter, the first of
    tab, semicolon and comma that it has. With a semicolon or tab numbers may have a decimal comma.

    Raises
    ------
    DataError
        Naming the file, and line and column where there is one.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            return _read(path, _content(file))
    except OSError as error:
        raise DataError(path, f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise DataError(path, f"is no text: {error.reason}") from error


def _content(lines: Iterable[str]) -> Iterator[Line]:
    """Yield the lines that say something."""
    for number, line in enumerate(lines, 1):
        text = line.strip(" \r\n")
        if text and not text.startswith("#"):
            yield number, text


def _read(path: Path, lines: Iterator[Line]) -> Table:
    names, delimiter = _header(path, next(lines, None))
    pieces, numbers = [], []
    while piece := list(itertools.islice(lines, _LINES)):
        if delimiter != ",":
            piece = [(number, text.replace(",", ".")) for number, text in piece]
        pieces.append(_values(path, piece, names, delimiter))
        numbers += [number for number, _ in piece]
    if not pieces:
        raise DataError(path, "holds no numbers after the line with the columns' names")
    return Table(names, np.concatenate(pieces), np.array(numbers, np.intp))


def _header(path: Path, line: Line | None) -> tuple[tuple[str, ...], str]:
    """Return the columns' names and the delimiter."""
    if line is None:
        raise DataError(path, "is empty: expected a line with the columns' names, then numbers")
    number, text = line
    delimiter = next((d for d in _DELIMITERS if d in text), ",")
    names = tuple(name.strip() for name in _cells(path, line, delimiter))
    if any(_is_number(name) for name in names):
        raise DataError(path, f"line {number}: expected the columns' names, found numbers: {text:.60}")
    for name in names:
        if not name or names.count(name) > 1:
            raise DataError(path, f"line {number}: the column name {name!r} is {'given twice' if name else 'empty'}")
    return names, delimiter


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


def _values(path: Path, piece: list[Line], names: tuple[str, ...], delimiter: str) -> FloatArray:
    """Return the numbers of a piece (n_lines, n_columns): at once if all cells are numbers, else cell by cell."""
    try:
        values = np.loadtxt([text for _, text in piece], delimiter=delimiter, comments=None, ndmin=2)
    except ValueError:
        values = np.array([_row(path, line, names, delimiter) for line in piece])
    if values.shape != (len(piece), len(names)) or np.isinf(values).any():
        values = np.array([_row(path, line, names, delimiter) for line in piece])
    return values


def _row(path: Path, line: Line, names: tuple[str, ...], delimiter: str) -> list[float]:
    number, _ = line
    cells = _cells(path, line, delimiter)
    if len(cells) != len(names):
        raise DataError(path, f"line {number}: expected {len(names)} cells, found {len(cells)}")
    return [_cell(path, number, name, cell.strip()) for name, cell in zip(names, cells, strict=True)]


def _cell(path: Path, number: int, name: str, cell: str) -> float:
    try:
        value = float(cell) if cell else float("nan")
    except ValueError:
        value = float("inf")
    if np.isinf(value):
        raise DataError(path, f"line {number}, column {name!r}: expected a number, found {cell!r:.40}")
    return value
