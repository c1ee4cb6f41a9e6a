"""Assembled matrices in the Harwell-Boeing format, as HBMAT of Ansys writes them, and the mapping of their rows.

References
----------
I. S. Duff, R. G. Grimes and J. G. Lewis: Users' guide for the Harwell-Boeing sparse matrix collection, TR/PA/92/86,
CERFACS, 1992: numbers in columns of fixed width, in the format that line 4 states. A right-hand side may follow.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from daq import FloatArray
from updater.errors import StructureError
from updater.fe.external.files import check_indices
from updater.fe.external.programs.nastran import nastran_number
from updater.fe.external.programs.numbers import (
    MAX_ROWS,
    LabelledMatrix,
    Row,
    checked_rows,
    read_text,
    symmetric,
)

_AXES = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
_TYPE = re.compile(r"\s*[RCP][SUHZR][AE]\s", re.IGNORECASE)
_FORMAT = re.compile(
    r"\(\s*(?:\d*P\s*,?)?\s*(?P<count>\d{0,3})\s*[IEDFG]\s*(?P<width>\d{1,2})(?:\.\d+)?(?:E\d+)?\s*\)", re.IGNORECASE
)


def is_harwell_boeing(lines: Sequence[str]) -> bool:
    """Return whether the third of the lines of a file, blank ones included, has the type of a matrix."""
    return len(lines) > 3 and bool(_TYPE.match(lines[2]))


def read_harwell_boeing(path: Path, lines: Sequence[str], names: Path) -> LabelledMatrix:
    """Read a matrix; a right-hand side is passed over.

    Parameters
    ----------
    path : of the matrix
    lines : of its file, blank ones included
    names : mapping: equation, node and name of the axis per line

    Raises
    ------
    StructureError
        Naming the file and what is wrong.
    """
    rows = checked_rows(names, _mapping(names))
    try:
        kind, n_rows, n_columns, n_entries = _header(lines[2])
        n_lines = [int(word) for word in lines[1].split()]
        formats = re.findall(r"\([^)]*\)", lines[3])
        if len(n_lines) < 4 or min(n_lines) < 0 or len(formats) < 3:
            raise ValueError(f"lines 2 and 4: expected counts of lines and formats, found {lines[3].strip()!r:.60}")
        if not kind[0] == "R" or kind[1] not in "SU" or kind[2] != "A" or n_rows != n_columns:
            raise ValueError(f"expected a real, assembled, square matrix, found {lines[2].strip()!r:.60}")
        first = 5 if n_lines[4:5] > [0] else 4  # one more line states the right-hand side
        blocks: list[FloatArray] = []
        for length, form, expected in zip(n_lines[1:4], formats, (n_columns + 1, n_entries, n_entries), strict=False):
            words = " ".join(lines[first : first + length]).split()
            if len(words) != expected:  # without blanks between them
                words = _fields(lines[first : first + length], form)
            if len(words) != expected:
                raise ValueError(f"expected {expected} numbers from line {first + 1}, found {len(words)}")
            blocks.append(np.array([nastran_number(word) for word in words], float))
            first += length
        starts, row = (block.astype(np.int64) - 1 for block in blocks[:2])
        check_indices(blocks[2], row, starts)
    except (ValueError, OverflowError) as error:
        raise StructureError(path, f"no Harwell-Boeing matrix can be read: {error}"[:200]) from error
    if not np.isfinite(blocks[2]).all():
        raise StructureError(path, "no Harwell-Boeing matrix can be read: expected finite real numbers")
    if n_columns != len(rows):
        raise StructureError(path, f"expected {len(rows)} rows, as many as there are names of them, found {n_columns}")
    column = np.repeat(np.arange(n_columns), np.diff(starts))
    return LabelledMatrix(path, symmetric(path, row, column, blocks[2], len(rows)), rows)


def _mapping(names: Path) -> Iterator[Row]:
    """Yield node and axis of each equation."""
    n = 0
    for line in read_text(names).splitlines():
        words = line.split()
        if len(words) < 3 or not (words[0].isdecimal() and words[1].isdecimal()):
            continue
        if words[2].upper() not in _AXES:
            raise StructureError(names, f"node {words[1]}: expected {', '.join(_AXES)}, found {words[2]!r:.20}")
        n += 1
        if int(words[0]) != n:
            raise StructureError(names, f"expected equation {n}, found {words[0]}")
        yield int(words[1]), _AXES.index(words[2].upper())


def _header(line: str) -> tuple[str, int, int, int]:
    """Return type, numbers of rows, of columns and of entries."""
    words = line.split()
    counts = [int(word) for word in words[1:4] if word.isdecimal()]
    if len(counts) < 3 or not 0 < max(counts[:2]) <= MAX_ROWS:
        raise ValueError(f"expected numbers of rows, columns and entries, found {line.strip()!r:.60}")
    return words[0].upper(), counts[0], counts[1], counts[2]


def _fields(lines: Sequence[str], form: str) -> list[str]:
    """Return the numbers of lines in the columns of a format of Fortran."""
    found = _FORMAT.fullmatch(form)
    if not found or not int(found["width"]):
        raise ValueError(f"expected a format of numbers, found {form!r:.40}")
    count, width = int(found["count"] or 1), int(found["width"])
    cut = (line.rstrip()[: count * width] for line in lines)
    return [text[place : place + width].strip() for text in cut for place in range(0, len(text), width)]
