"""Matrices that Nastran writes: formatted OUTPUT4 files, dense or sparse, DMIG entries of punch files, bulk data.

References
----------
MSC Nastran quick reference guide: bulk data entry DMIG. MSC Nastran DMAP programmer's guide: OUTPUT4, formatted files.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from updater.errors import StructureError
from updater.fe.external.programs.numbers import LabelledMatrix, Row, checked_rows, symmetric

_HEAD = re.compile(r"\s*(\d+)\s+(-?\d+)\s+\d+\s+(\d)\s*([A-Za-z]\w*)")
_FORM = re.compile(r"(\d+)[ED](\d+)\.", re.IGNORECASE)
_STRING = 65536  # of the number that begins a string: rows below it, length above
_REAL = {1: 1, 2: 2}  # type of numbers -> words of a number


@dataclass(eq=False)
class _Entries:
    """Entries of a matrix, with rows and columns from 0 on."""

    name: str
    row: list[int] = field(default_factory=list)
    column: list[int] = field(default_factory=list)
    value: list[float] = field(default_factory=list)

    def matrix(self, path: Path, rows: tuple[Row, ...]) -> LabelledMatrix:
        """Return the symmetric matrix with its rows."""
        value = np.array(self.value, float)
        if not len(value):
            raise StructureError(path, f"no matrix can be read: {self.name} has no entries")
        if not np.isfinite(value).all():
            raise StructureError(path, f"{self.name}: an entry is not finite")
        row, column = (np.array(index, np.int64) for index in (self.row, self.column))
        return LabelledMatrix(path, symmetric(path, row, column, value, len(rows)), rows)


def _chosen(path: Path, names: Sequence[str], initial: str) -> int:
    """Return which of several matrices is meant: the first with a name of this initial."""
    named = [k for k, name in enumerate(names) if name.upper().startswith(initial)]
    if len(names) > 1 and not named:
        raise StructureError(path, f"expected a matrix with a name in {initial}, found {', '.join(names)}"[:200])
    return named[0] if named else 0


def read_output4(path: Path, lines: Sequence[str], nodes: Sequence[int], initial: str) -> LabelledMatrix:
    """Read a matrix of a formatted OUTPUT4 file: six rows per node, by their numbers (g-set).

    Parameters
    ----------
    path, lines : file and its lines
    nodes : numbers of all nodes
    initial : of the name of the matrix that is meant, if there are several

    Raises
    ------
    StructureError
        Naming the file and the column.
    """
    found, place = list[_Output4](), 0
    while place < len(lines):
        one = _Output4(path, lines, place)
        found.append(one)
        place = one.end
    one = found[_chosen(path, [matrix.name for matrix in found], initial)]
    one.check(6 * len(nodes))
    return one.entries().matrix(path, tuple((node, axis) for node in sorted(nodes) for axis in range(6)))


class _Output4:
    """One matrix of the lines of an OUTPUT4 file."""

    def __init__(self, path: Path, lines: Sequence[str], start: int) -> None:
        """Read the header in a line, and find the end."""
        head, form = _HEAD.match(lines[start]), _FORM.search(lines[start])
        if head is None or form is None or not int(form[2]):
            raise StructureError(path, f"expected a formatted OUTPUT4 file, found {lines[start].strip()!r:.60}")
        self.path, self.lines, self.start, self.name = path, lines, start + 1, head[4]
        self.columns, self.rows, self.kind = int(head[1]), abs(int(head[2])), int(head[3])
        self.large, self.width = int(head[2]) < 0, int(form[2])
        later = range(start + 1, len(lines))
        self.end = next((k for k in later if _HEAD.match(lines[k]) and _FORM.search(lines[k])), len(lines))

    def check(self, n: int) -> None:
        """Refuse another size or type."""
        if self.kind not in _REAL:
            raise StructureError(self.path, "expected a real matrix")
        if self.columns != self.rows or self.rows != n:
            raise StructureError(self.path, f"expected {n} rows, six per node, found {self.rows} x {self.columns}")

    def entries(self) -> _Entries:
        """Return all entries."""
        found, place = _Entries(name=self.name), self.start
        while place < self.end:
            number, first, size = self._integers(place, 3, len(found.value))
            if number > self.columns:
                break
            place += 1
            if number < 1 or first < 0 or size < 1:
                raise StructureError(self.path, f"column {number}: the column is invalid")
            if first:
                place = self._string(found, number, first, size, place)
                continue
            while size > 0:
                length, first, place = self._head_of_string(place, len(found.value))
                if length < 1:
                    raise StructureError(self.path, f"column {number}: the column is invalid")
                place = self._string(found, number, first, length // _REAL[self.kind], place)
                size -= length + (2 if self.large else 1)
        return found

    def _head_of_string(self, place: int, known: int) -> tuple[int, int, int]:
        """Return words, row and the next line of a string of a sparse column."""
        if self.large:
            length, first = self._integers(place, 2, known)
            return length - 1, first, place + 1
        (both,) = self._integers(place, 1, known)
        return both // _STRING - 1, both % _STRING, place + 1

    def _string(self, found: _Entries, number: int, first: int, count: int, place: int) -> int:
        """Add numbers below each other; return the next line."""
        if not (1 <= number <= self.columns and first >= 1 and 0 < count <= self.rows - first + 1):
            raise StructureError(self.path, f"column {number}: the column is invalid")
        taken: list[float] = []
        while len(taken) < count and place < self.end:
            line = self.lines[place].rstrip()
            try:
                parts = [line[k : k + self.width].replace("D", "E") for k in range(0, len(line), self.width)]
                taken += [float(part) for part in parts]
            except ValueError as error:
                raise StructureError(self.path, f"column {number}: expected numbers, found {line!r:.60}") from error
            place += 1
        if len(taken) < count:
            raise StructureError(self.path, f"column {number}: expected numbers, found the end of the file")
        found.row += range(first - 1, first - 1 + count)
        found.column += [number - 1] * count
        found.value += taken[:count]
        return place

    def _integers(self, place: int, count: int, known: int) -> list[int]:
        words = self.lines[place].split() if place < self.end else []
        try:
            whole = [int(word) for word in words[:count]]
        except ValueError:
            whole = []
        if len(whole) < count:
            found = " ".join(words) or "the end of the file"
            raise StructureError(self.path, f"entry {known + 1}: expected numbers, found {found!r:.60}")
        return whole


def is_dmig(lines: Sequence[str]) -> bool:
    """Return whether lines have DMIG entries."""
    return any(line[:4].upper() == "DMIG" for line in lines)


def read_dmig(path: Path, lines: Sequence[str], initial: str) -> LabelledMatrix:
    """Read a matrix of DMIG entries, of a punch file or of a bulk data file.

    Parameters
    ----------
    path, lines : file and its lines
    initial : of the name of the matrix that is meant, if there are several

    Raises
    ------
    StructureError
        Naming the file, and the matrix or the entry.
    """
    headers: list[list[str]] = []
    columns: list[list[str]] = []
    for card in bulk_cards(lines):
        if card[0] == "DMIG":
            fields = [*card[1:], "", "", ""]
            (headers if fields[1] == "0" else columns).append(fields)
    square = [card for card in headers if card[2] in ("1", "6")]
    if not square:
        raise StructureError(path, "holds no square matrix (DMIG with form 1 or 6)")
    header = square[_chosen(path, [card[0] for card in square], initial)]
    name = header[0]
    if header[3] not in map(str, _REAL):
        raise StructureError(path, "expected a real matrix")
    ends = list[tuple[Row, Row]]()
    found = _Entries(name=name)
    for card in columns:
        if card[0] != name:
            continue
        to = _dof(path, card[1:3])
        for k in range(4, len(card) - 3, 4):
            node, axis, value, _ = card[k : k + 4]
            if node:
                ends.append((_dof(path, (node, axis)), to))
                found.value.append(_number(path, value))
    rows = checked_rows(path, sorted({row for both in ends for row in both}))
    place = {row: i for i, row in enumerate(rows)}
    found.row, found.column = ([place[both[k]] for both in ends] for k in (0, 1))
    return found.matrix(path, rows)


def _dof(path: Path, words: Sequence[str]) -> Row:
    if not all(word.isdecimal() for word in words):
        raise StructureError(path, f"DMIG: expected a node and a degree of freedom, found {' '.join(words)!r:.40}")
    return int(words[0]), int(words[1]) - 1


def _number(path: Path, word: str) -> float:
    try:
        return float(nastran_number(word))
    except ValueError as error:
        raise StructureError(path, f"DMIG: expected a number, found {word!r:.40}") from error


def bulk_cards(lines: Sequence[str]) -> Iterator[list[str]]:
    """Yield the fields of each card of the bulk data, continuations joined."""
    card: list[str] = []
    for line in (line.partition("$")[0].rstrip() for line in lines):
        if not line:
            continue
        fields = _fields(line)
        continued = not fields[0] or fields[0][0] in "+*"
        if continued and card:
            card += fields[1:]
            continue
        if card:
            yield card
        card = [fields[0].rstrip("*").upper(), *fields[1:]]
    if card:
        yield card


def _fields(line: str) -> list[str]:
    """Return the name of a card and its fields, without that of the continuation."""
    if "," in line:
        words = [word.strip() for word in line.split(",")]
        count = 5 if "*" in words[0] else 9
        return [*words, *[""] * count][:count]
    line = line.expandtabs()
    wide = "*" in line[:8]
    size, count = (16, 4) if wide else (8, 8)
    own = [line[8 + size * k : 8 + size * (k + 1)].strip() for k in range(count)]
    return [line[:8].strip(), *own]


def nastran_number(word: str) -> str:
    """Return a number such as 1.5-3 with the exponent's letter."""
    text = word.upper().replace("D", "E") or "0"
    for sign in "+-":
        head, found, tail = text[1:].rpartition(sign)
        if found and head and head[-1] != "E" and tail.isdecimal():
            return f"{text[0]}{head}E{sign}{tail}"
    return text
