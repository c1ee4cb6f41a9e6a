"""Symmetric matrices as Nastran writes them: sparse and binary OUTPUT4 files, DMIG entries of a punch file."""

from collections.abc import Mapping, Sequence

import numpy as np

from daq import FloatArray, IndexArray

_WORDS = 2  # of a number of double precision
_STRING = 65536


def sparse_output4(matrices: Mapping[str, FloatArray], *, large: bool) -> str:
    """Return formatted, sparse matrices of double precision by their names.

    Parameters
    ----------
    matrices : name -> (n, n), each with an entry
    large : whether strings begin with two numbers (BIGMAT), not with one
    """
    lines: list[str] = []
    for name, matrix in matrices.items():
        n = len(matrix)
        lines.append(f"{n:8d}{-n if large else n:8d}{6:8d}{2:8d}{name:8s}1P,3E23.16")
        for column in range(n):
            lines += _column(matrix[:, column], column + 1, large=large)
        lines += [f"{n + 1:8d}{1:8d}{1:8d}", f"{1.0:23.16E}"]
    return "\n".join(lines) + "\n"


def _column(values: FloatArray, number: int, *, large: bool) -> list[str]:
    """Return the lines of one column: a string per run of entries that are not zero."""
    there = np.flatnonzero(values)
    if not len(there):
        return []
    runs = np.split(there, np.flatnonzero(np.diff(there) > 1) + 1)
    lines = [f"{number:8d}{0:8d}{sum(_WORDS * len(run) + (2 if large else 1) for run in runs):8d}"]
    for run in runs:
        first, words = int(run[0]) + 1, _WORDS * len(run) + 1
        lines.append(f"{words:8d}{first:8d}" if large else f"{words * _STRING + first:12d}")
        numbers = values[run].tolist()
        lines += ["".join(f"{value:23.16E}" for value in numbers[k : k + 3]) for k in range(0, len(numbers), 3)]
    return lines


def dmig(matrices: Mapping[str, FloatArray], rows: Sequence[tuple[int, int]]) -> str:
    """Return the upper triangles of matrices in large fields.

    Parameters
    ----------
    matrices : name -> (n, n)
    rows : (n,) node and degree of freedom 1 to 6
    """
    lines: list[str] = []
    for name, matrix in matrices.items():
        lines.append(f"DMIG    {name:8s}{0:8d}{6:8d}{2:8d}{0:8d}{'':16s}{len(rows):8d}")
        for column, (node, axis) in enumerate(rows):
            lines.append(f"DMIG*   {name:16s}{node:16d}{axis:16d}")
            for row in np.flatnonzero(matrix[: column + 1, column]).tolist():
                to, own = rows[row]
                lines.append(f"*       {to:16d}{own:16d}{matrix[row, column]:16.9E}".replace("E", "D"))
    return "\n".join(lines) + "\n"


def binary_output4(
    matrices: Mapping[str, FloatArray], *, order: str = "<", word: int = 4, single: bool = False, form: str = "dense"
) -> bytes:
    """Return a binary file of matrices by their names, as Nastran's guide has its records.

    Parameters
    ----------
    matrices : name -> (n, n), each with an entry
    order : of the bytes: < or >
    word : bytes of an integer, which any number has too if it is 8
    single : whether numbers are of single precision
    form : dense, sparse or large (BIGMAT)
    """
    integer = f"{order}i{word}"
    number = f"{order}f{word if single else 8}"
    records: list[bytes] = []
    for name, matrix in matrices.items():
        n = len(matrix)
        head = np.array([n, -n if form == "large" else n, 6, 1 if single else 2], integer).tobytes()
        records.append(head + name.encode().ljust(2 * word))
        for column in range(n):
            there = np.flatnonzero(matrix[:, column])
            if not len(there):
                continue
            runs = np.split(there, np.flatnonzero(np.diff(there) > 1) + 1)
            first = int(there[0]) + 1 if form == "dense" else 0
            if form == "dense":
                words = matrix[there[0] : there[-1] + 1, column].astype(number).tobytes()
            else:
                words = b"".join(_string(matrix[run, column].astype(number), run, integer, form) for run in runs)
            records.append(np.array([column + 1, first, len(words) // word], integer).tobytes() + words)
        records.append(np.array([n + 1, 1, 1], integer).tobytes() + np.array([1.0], number).tobytes())
    marks = [np.array(len(record), f"{order}i4").tobytes() for record in records]
    return b"".join(mark + record + mark for mark, record in zip(marks, records, strict=True))


def _string(values: FloatArray, rows: IndexArray, integer: str, form: str) -> bytes:
    """Return a string of a sparse column with the numbers at its beginning."""
    words, first = values.nbytes // np.dtype(integer).itemsize + 1, int(rows[0]) + 1
    head = [words, first] if form == "large" else [words * _STRING + first]
    return np.array(head, integer).tobytes() + values.tobytes()
