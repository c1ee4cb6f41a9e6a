"""OUTPUT4 files of Nastran: formatted or binary, dense or sparse.

A matrix is a header and one record per column: its number, the first row, the number of words, and the numbers. In a
sparse column the first row is 0, and each string of numbers has its own. The last record has a column beyond the last.
A binary record has its length in bytes before and after it.

References
----------
MSC Nastran DMAP programmer's guide: OUTPUT4.
"""

import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from daq import FloatArray
from updater.errors import StructureError
from updater.fe.external.programs.nastran import REAL, chosen
from updater.fe.external.programs.numbers import LabelledMatrix, Row, labelled, read_text

_HEAD = re.compile(r"\s*(\d+)\s+(-?\d+)\s+\d+\s+(\d)\s*([A-Za-z]\w*)")
_FORM = re.compile(r"(\d+)[ED](\d+)\.", re.IGNORECASE)
_USUAL_WIDTH = 16  # of a number, where the header has no format
_STRING = 65536  # of the number that begins a string: rows below it, length above
_HEADERS = {24: ("4i8s", 4), 48: ("4q16s", 8)}  # bytes of a binary header -> its layout, bytes of a word
_DOUBLE = 8  # bytes
_MARK = 4  # bytes of the length of a record


@dataclass(frozen=True, kw_only=True)
class _Header:
    """First record of a matrix."""

    name: str
    columns: int
    rows: int
    kind: int  #: 1 and 2: real numbers of single and double precision
    large: bool  #: whether a string begins with two numbers, not with one


@dataclass(frozen=True)
class _String:
    """Numbers below each other in one column; rows and columns count from 1."""

    column: int
    first: int
    values: FloatArray


class _Stored(Protocol):
    """One matrix of a file."""

    header: _Header

    def strings(self) -> Iterator[_String]:
        """Yield its numbers."""


def read_output4(path: Path, rows: Sequence[Row], initial: str) -> LabelledMatrix:
    """Read a matrix with the rows of the g-set.

    Parameters
    ----------
    path : of the file
    rows : of all points by their numbers: six per node, one per scalar point
    initial : of the name of the matrix that is meant, if there are several

    Raises
    ------
    StructureError
        Naming the file and the column.
    """
    try:
        with path.open("rb") as file:
            start = file.read(_MARK)
    except OSError as error:
        raise StructureError(path, f"cannot be read: {error}") from error
    order = next(
        (order for order in "<>" if len(start) == _MARK and struct.unpack(order + "i", start)[0] in _HEADERS), ""
    )
    found = list[_Stored](_binary(path, order) if order else _formatted(path))
    if not found:
        raise StructureError(path, "no matrix can be read: the file is empty")
    one = found[chosen(path, [matrix.header.name for matrix in found], initial)]
    header = one.header
    if header.kind not in REAL:
        raise StructureError(path, "expected a real matrix")
    if not header.columns == header.rows == len(rows):
        raise StructureError(
            path,
            f"expected {len(rows)} rows, six per node, found {header.rows} x {header.columns}",
        )
    strings = [string for string in one.strings() if len(string.values)]
    for string in strings:
        if not (1 <= string.column <= header.columns and 1 <= string.first <= header.rows + 1 - len(string.values)):
            raise StructureError(path, f"column {string.column}: the column is invalid")
    count = [len(string.values) for string in strings]
    row = [np.arange(n) + string.first - 1 for n, string in zip(count, strings, strict=True)]
    column = np.repeat([string.column - 1 for string in strings], count)
    value = [string.values for string in strings]
    return labelled(path, header.name, np.concatenate([[], *row]), column, np.concatenate([[], *value]), rows)


def _formatted(path: Path) -> Iterator["_Formatted"]:
    lines = [line for line in read_text(path).splitlines() if line.strip()]
    place = 0
    while place < len(lines):
        one = _Formatted(path, lines, place)
        yield one
        place = one.end


class _Formatted:
    """Matrix in lines of text."""

    def __init__(self, path: Path, lines: Sequence[str], start: int) -> None:
        """Read the header in a line, and find the end."""
        head, form = _HEAD.match(lines[start]), _FORM.search(lines[start])
        if head is None or (form is not None and not int(form[2])):
            raise StructureError(path, f"expected an OUTPUT4 file, found {lines[start].strip()!r:.60}")
        columns, rows = int(head[1]), int(head[2])
        self.header = _Header(name=head[4], columns=columns, rows=abs(rows), kind=int(head[3]), large=rows < 0)
        self._path, self._lines, self._start = path, lines, start + 1
        self._width = int(form[2]) if form else _USUAL_WIDTH
        later = range(start + 1, len(lines))
        self.end = next((k for k in later if _HEAD.match(lines[k])), len(lines))

    def strings(self) -> Iterator[_String]:
        """Yield the numbers of each column, or of each string of a sparse one."""
        place = self._start
        while place < self.end:
            number, first, size = self._integers(place, 3)
            if number > self.header.columns:
                break
            place += 1
            if first < 0 or size < 1:
                raise StructureError(self._path, f"column {number}: the column is invalid")
            if first:
                values, place = self._numbers(number, size, place)
                yield _String(number, first, values)
                continue
            while size > 0:
                head = self._integers(place, 2 if self.header.large else 1)
                length, first = _head_of_string(head)
                values, place = self._numbers(number, length // REAL[self.header.kind], place + 1)
                yield _String(number, first, values)
                size -= length + len(head)

    def _numbers(self, number: int, count: int, place: int) -> tuple[FloatArray, int]:
        """Return numbers of a column, and the next line."""
        if not 0 < count <= self.header.rows:
            raise StructureError(self._path, f"column {number}: the column is invalid")
        taken: list[float] = []
        while len(taken) < count and place < self.end:
            line = self._lines[place].rstrip()
            try:
                parts = [line[k : k + self._width].replace("D", "E") for k in range(0, len(line), self._width)]
                taken += [float(part) for part in parts]
            except ValueError as error:
                raise StructureError(self._path, f"column {number}: expected numbers, found {line!r:.60}") from error
            place += 1
        if len(taken) < count:
            raise StructureError(self._path, f"column {number}: expected numbers, found the end of the file")
        return np.array(taken[:count]), place

    def _integers(self, place: int, count: int) -> list[int]:
        words = self._lines[place].split() if place < self.end else []
        try:
            whole = [int(word) for word in words[:count]]
        except ValueError:
            whole = []
        if len(whole) < count:
            found = " ".join(words) or "the end of the file"
            raise StructureError(self._path, f"{self.header.name}: expected numbers, found {found!r:.60}")
        return whole


def _head_of_string(numbers: Sequence[int]) -> tuple[int, int]:
    """Return the words and the first row of a string from the one or two numbers at its beginning."""
    if len(numbers) == 2:
        return numbers[0] - 1, numbers[1]
    return numbers[0] // _STRING - 1, numbers[0] % _STRING


class _Binary:
    """Matrix in binary records."""

    def __init__(self, path: Path, order: str, header: _Header, word: int) -> None:
        """Prepare for records.

        Parameters
        ----------
        order : of the bytes: < or >
        word : bytes of a word: 8 with 64-bit integers, which a number of any precision is then
        """
        self.header, self.records = header, list[tuple[int, int, memoryview]]()
        self._path, self._integer, self._word = path, f"{order}i{word}", word
        self._number = f"{order}f{word if header.kind == 1 else _DOUBLE}"

    def strings(self) -> Iterator[_String]:
        """Yield the numbers of each column, or of each string of a sparse one."""
        size = 2 if self.header.large else 1
        for number, first, words in self.records:
            if first:
                yield _String(number, first, self._numbers(number, words))
                continue
            while len(words):
                if len(words) < size * self._word:
                    raise StructureError(self._path, f"column {number}: the column is invalid")
                length, first = _head_of_string(np.frombuffer(words, self._integer, size).tolist())
                end = (size + length) * self._word
                if length < 1 or end > len(words):
                    raise StructureError(self._path, f"column {number}: the column is invalid")
                yield _String(number, first, self._numbers(number, words[size * self._word : end]))
                words = words[end:]

    def _numbers(self, number: int, words: memoryview) -> FloatArray:
        kind = np.dtype(self._number)
        if len(words) % kind.itemsize:
            raise StructureError(self._path, f"column {number}: the column is invalid")
        return np.frombuffer(words, kind).astype(float)


def _binary(path: Path, order: str) -> Iterator[_Binary]:
    """Yield the matrices of a binary file."""
    one: _Binary | None = None
    word = 0
    for record in _records(path, order):
        if one is None:
            if len(record) not in _HEADERS:
                raise StructureError(path, f"expected the header of a matrix, found a record of {len(record)} bytes")
            layout, word = _HEADERS[len(record)]
            columns, rows, _, kind, text = struct.unpack(order + layout, record)
            name = text.decode("ascii", "replace").strip()
            header = _Header(name=name, columns=columns, rows=abs(rows), kind=kind, large=rows < 0)
            one = _Binary(path, order, header, word)
            continue
        if len(record) < 3 * word:
            raise StructureError(path, f"{one.header.name}: expected a column, found a record of {len(record)} bytes")
        number, first, _ = np.frombuffer(record, f"{order}i{word}", 3).tolist()
        if number <= one.header.columns:
            one.records.append((number, first, record[3 * word :]))
            continue
        yield one
        one = None
    if one is not None:
        raise StructureError(path, f"{one.header.name}: expected a column, found the end of the file")


def _records(path: Path, order: str) -> Iterator[memoryview]:
    """Yield the contents of the records of a binary file."""
    data, place = memoryview(path.read_bytes()), 0
    while place < len(data):
        marks = data[place : place + _MARK]
        (length,) = struct.unpack(order + "i", marks) if len(marks) == _MARK else (-1,)
        place += _MARK + length
        if length < 0 or bytes(data[place : place + _MARK]) != bytes(marks):
            raise StructureError(
                path, f"byte {max(place - _MARK - length, 0)}: expected a record, found another length at its end"
            )
        yield data[place - length : place]
        place += _MARK
