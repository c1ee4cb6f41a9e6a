"""Matrices of other programs with the node and axis of each row."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy import sparse

from daq import FloatArray
from updater.errors import StructureError

MAX_ROWS = 2_000_000
SCALAR = -1  #: axis of a scalar point, which has one row and no position
Row = tuple[int, int]  #: node, and axis 0..5 or `SCALAR`


@dataclass(frozen=True, eq=False)
class LabelledMatrix:
    """Symmetric matrix and the meaning of its rows."""

    path: Path
    matrix: sparse.csc_array  #: (n, n)
    rows: tuple[Row, ...]  #: (n,)


def read_text(path: Path) -> str:
    """Return the text of a file.

    Raises
    ------
    StructureError
        If it cannot be read or is no text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise StructureError(path, f"cannot be read: {error}") from error


def numbers(path: Path, lines: Sequence[str], width: int) -> FloatArray:
    """Return the numbers (n, width) of lines; commas and blanks separate them.

    Raises
    ------
    StructureError
        Naming the first line that has others.
    """
    try:
        found = np.array([line.replace(",", " ").split() for line in lines], float)
        if found.shape == (len(lines), width) and np.isfinite(found).all():
            return found
    except ValueError:
        pass
    for line in lines:
        words = line.replace(",", " ").split()
        if len(words) != width or not all(_is_number(word) for word in words):
            raise StructureError(path, f"expected {width} numbers per line, found {line.strip()!r:.60}")
    return np.empty((0, width))


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def symmetric(
    path: Path, row: npt.NDArray[np.int64], column: npt.NDArray[np.int64], value: FloatArray, n: int
) -> sparse.csc_array:
    """Return a matrix (n, n) of entries; if all are in one triangle, the other one is their mirror image.

    Raises
    ------
    StructureError
        If an entry is outside the matrix.
    """
    if not 0 < n <= MAX_ROWS:
        raise StructureError(path, f"expected 1 to {MAX_ROWS} rows, found {n}")
    if len(row) and (min(row.min(), column.min()) < 0 or max(row.max(), column.max()) >= n):
        last = int(max(row.max(), column.max())) + 1
        raise StructureError(path, f"expected {n} rows, as many as there are names of them, found row {last}")
    if not ((row < column).any() and (row > column).any()):
        apart = row != column
        row, column = np.concatenate([row, column[apart]]), np.concatenate([column, row[apart]])
        value = np.concatenate([value, value[apart]])
    return sparse.csc_array((value, (row, column)), shape=(n, n))


def labelled(
    path: Path,
    name: str,
    row: npt.ArrayLike,
    column: npt.ArrayLike,
    value: npt.ArrayLike,
    rows: Sequence[Row],
) -> LabelledMatrix:
    """Return a symmetric matrix of entries (n_entries,) with its rows (n,).

    Raises
    ------
    StructureError
        Naming the matrix if it has no entries, or one that is not finite.
    """
    values = np.asarray(value, float)
    if not len(values):
        raise StructureError(path, f"no matrix can be read: {name} has no entries")
    if not np.isfinite(values).all():
        raise StructureError(path, f"{name}: an entry is not finite")
    first, second = (np.asarray(index, np.int64) for index in (row, column))
    return LabelledMatrix(path, symmetric(path, first, second, values, len(rows)), tuple(rows))


def checked_rows(path: Path, rows: Iterable[Row]) -> tuple[Row, ...]:
    """Return the rows if each is there once and has one of six axes, or is a scalar point's.

    Raises
    ------
    StructureError
        Naming the node.
    """
    found: dict[Row, None] = {}
    for node, axis in rows:
        if not SCALAR <= axis < 6:
            raise StructureError(path, f"node {node}: expected degrees of freedom 1 to 6, found {axis + 1}")
        if (node, axis) in found:
            raise StructureError(path, f"node {node}: degree of freedom {axis + 1} is there twice")
        found[node, axis] = None
    return tuple(found)
