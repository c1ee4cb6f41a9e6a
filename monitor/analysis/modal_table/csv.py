"""Tolerant CSV reader for tables of modes: units, decimal commas, comments, spreadsheet artefacts."""

import csv
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from daq import LogError

OWN = ("frequency", "frequency_std", "damping", "damping_std", "temperature", "rms")  #: columns that are no channel
_UNITS = {  # of one unit, in the one that columns are kept in
    "frequency": {"Hz": 1.0, "kHz": 1e3, "rad/s": 1 / (2 * np.pi)},
    "damping": {"-": 1.0, "%": 0.01},
    "temperature": {"degC": 1.0, "°C": 1.0, "C": 1.0},
    "rms": {"m/s2": 1.0, "m/s^2": 1.0, "m/s²": 1.0, "mm/s2": 1e-3},
}
_SHAPE_UNITS = {"-": 1.0}
_NUMBERED = frozenset({"mode", "no", "#"})  # columns that count the rows
_HEADER = re.compile(r"(?P<name>.*?)\s*(?:\[(?P<square>[^\]]*)\]|\((?P<round>[^)]*)\))?")
_ENCODINGS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}  # by how a file begins


def read_text(path: Path) -> str:
    """Return a file's text.

    Raises
    ------
    LogError
        If it cannot be read, or is no text in UTF-8 or UTF-16.
    """
    try:
        raw = path.read_bytes()
        return raw.decode(_ENCODINGS.get(raw[:2], "utf-8-sig"))
    except OSError as error:
        raise LogError(path, f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise LogError(
            path, f"line {line}: expected text in UTF-8, found byte {error.object[error.start]:#x}"
        ) from error


class CsvTable:
    """Header and rows of a table, without empty rows, comments and unnamed empty columns.

    Semicolons or tabs part the columns if the header has any, else commas. A comma in a number is its decimal point.

    Raises
    ------
    LogError
        Naming line and column of an unknown unit, a repeated name, or a row that is too short.
    """

    def __init__(self, path: Path, text: str) -> None:
        self._path = path
        lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if not line.lstrip().startswith("#")]
        header = next((line for _, line in lines if line.strip()), "")
        delimiter = next((d for d in (";", "\t") if d in header), ",")
        rows = [(i, [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]) for i, line in lines]
        rows = [(i, cells) for i, cells in rows if any(cells)]
        self.first, headings = rows[0] if rows else (1, [])  #: line of the header
        self._rows = rows[1:]
        if headings and all(bool(np.isfinite(_parsed(cell))) for cell in headings if cell):
            raise LogError(path, f"line {self.first}: expected names of columns, found numbers")
        names = [_split(cell)[0] for cell in headings]
        if "frequency" not in names:  # before the units: those of another kind of table are others
            found = ", ".join(filter(None, names)) or "none"
            raise LogError(path, f"line {self.first}: expected a column 'frequency' [Hz], found {found:.200}")
        columns = [self._column(cell) for cell in headings]
        used = [i for i, (name, _) in enumerate(columns) if not self._is_ignored(i, name)]
        self._width, self._used = len(columns), used
        self.names = tuple(columns[i][0] for i in used)  #: names of the columns, without their units
        self._scale = [columns[i][1] for i in used]
        twice = [name for name in self.names if self.names.count(name) > 1]
        if twice:
            raise LogError(path, f"line {self.first}, column {twice[0]}: named twice")

    def rows(self) -> Iterator[tuple[int, dict[str, complex]]]:
        """Yield line and values of each row; empty cells are allowed in columns of deviations, as NaN."""
        for line, cells in self._rows:
            if len(cells) < self._width or any(cells[self._width :]):
                raise LogError(self._path, f"line {line}: expected {self._width} columns, found {len(cells)}")
            yield (
                line,
                {
                    name: scale * self._number(line, name, cells[i])
                    for name, scale, i in zip(self.names, self._scale, self._used, strict=True)
                },
            )

    def _column(self, heading: str) -> tuple[str, float]:
        """Return a column's name and the factor of its unit."""
        name, unit = _split(heading)
        if unit is None:
            return name, 1.0
        units = _UNITS[name.removesuffix("_std")] if name in OWN else _SHAPE_UNITS
        if unit.strip() not in units:
            expected = " or ".join(units)
            raise LogError(self._path, f"line {self.first}, column {heading}: expected the unit {expected}")
        return name, units[unit.strip()]

    def _is_ignored(self, i: int, name: str) -> bool:
        if name.lower() in _NUMBERED:
            return True
        return not name and not any(cells[i] for _, cells in self._rows if i < len(cells))

    def _number(self, line: int, name: str, cell: str) -> complex:
        if not cell and name.endswith("_std"):
            return complex("nan")
        value = _parsed(cell)
        if not np.isfinite(value) or (name in OWN and value.imag):
            raise LogError(self._path, f"line {line}, column {name}: expected a number, found {cell!r}")
        return value


def _split(heading: str) -> tuple[str, str | None]:
    """Return the name of a column, and its unit if it is stated."""
    parts = _HEADER.fullmatch(heading)
    name = parts["name"] if parts else heading
    return (
        name.lower() if name.lower() in OWN else name,
        (parts["square"] or parts["round"]) if parts else None,
    )


def _parsed(cell: str) -> complex:
    try:
        return complex(cell.replace(",", ".").replace(" ", "").replace("i", "j"))
    except ValueError:
        return complex("nan")
