"""The columns of a file of modes, read and checked: one clear error naming file, line and column."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, PositiveFloat, ValidationError

from daq import LogError
from daq.bounded_text import parse_json
from monitor.analysis.modal_table.csv import OWN, CsvTable, read_text
from monitor.analysis.modal_table.responses import identify_file
from monitor.analysis.modal_table.universal import is_universal
from oma import ComplexArray
from updater import Structure

_MAX_DAMPING = 0.3  # [-]: larger values are per cent


@dataclass(frozen=True, eq=False)
class Columns:
    """A table's columns (n_modes,), and the line of each row."""

    values: dict[str, ComplexArray]
    line: list[int]

    def check(self, path: Path | str, structure: Structure) -> None:
        """Refuse anything that is not a table of modes of the structure."""
        channels = [c for c in structure.channels if c in self.values]
        if len(self.line) < 3:
            raise LogError(path, f"expected at least 3 modes, found {len(self.line)}")
        if len(channels) == 1:
            raise LogError(path, f"line 1: expected shapes at 2 sensors or more, or none, found {channels[0]} only")
        positive = ["frequency", *(n for n in self.values if n.endswith("_std")), *({"damping"} & set(self.values))]
        for name in positive:
            wrong = np.flatnonzero(~(self.values[name].real > 0) & np.isfinite(self.values[name].real))
            if len(wrong):
                where = f"line {self.line[wrong[0]]}, column {name}"
                raise LogError(path, f"{where}: expected a number over 0, found {self.values[name].real[wrong[0]]:g}")
        self._check_damping(path)
        shape = np.array([self.values[c] for c in channels])
        if channels and not shape.any(0).all():
            row = int(np.argmin(shape.any(0)))
            raise LogError(path, f"line {self.line[row]}: the shape is zero at every sensor")

    def _check_damping(self, path: Path | str) -> None:
        damping = self.values.get("damping", np.zeros(1)).real
        if damping.max() > _MAX_DAMPING:
            where = f"line {self.line[int(np.argmax(damping))]}, column damping"
            raise LogError(path, f"{where}: expected a ratio, found {damping.max():g}; per cent are headed damping [%]")


def _check_names(path: Path, names: Sequence[str], structure: Structure, where: str = "modes.0") -> None:
    """Refuse columns that are not modes of the structure, before a long record is read."""
    known = {*OWN, *structure.channels, *(f"{c}_std" for c in structure.channels)}
    unknown = [name for name in names if name not in known]
    if unknown:
        raise LogError(
            path,
            f"{where}, column {unknown[0] or 'without a name'}: expected one of {', '.join(OWN)} or a sensor of the "
            f"structure ({', '.join(structure.channels)})",
        )


def _of_csv(path: Path, text: str, structure: Structure) -> Columns:
    """Read the columns of a table."""
    table = CsvTable(path, text)
    _check_names(path, table.names, structure, f"line {table.first}")
    rows = list(table.rows())
    values = {name: np.array([row[name] for _, row in rows], dtype=complex) for name in table.names}
    return Columns(values, [line for line, _ in rows])


class _Value(BaseModel):
    model_config = ConfigDict(extra="ignore")
    value: PositiveFloat
    std: PositiveFloat | None = None


class _Mode(BaseModel):
    model_config = ConfigDict(extra="ignore")
    frequency: _Value
    damping: _Value | None = None
    shape: Mapping[str, tuple[float, float]] = {}
    shape_std: Mapping[str, PositiveFloat] = {}


class _Identified(BaseModel):
    model_config = ConfigDict(extra="ignore")
    modes: tuple[_Mode, ...]


def _of_json(path: Path, text: str, structure: Structure) -> Columns:
    """Read the output of `identify --json`."""
    try:
        modes = _Identified.model_validate(parse_json(text)).modes
    except ValidationError as error:
        first = error.errors()[0]
        raise LogError(path, f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from error
    except ValueError as error:
        raise LogError(path, f"is no JSON: {error}") from error
    values: dict[str, list[complex]] = {"frequency": [m.frequency.value for m in modes]}
    values["frequency_std"] = [m.frequency.std or complex("nan") for m in modes]
    if all(m.damping for m in modes):
        values["damping"] = [m.damping.value for m in modes if m.damping]
        values["damping_std"] = [m.damping.std or complex("nan") for m in modes if m.damping]
    for channel in modes[0].shape if modes else ():
        if any(channel not in m.shape for m in modes):
            raise LogError(path, f"channel {channel}: expected in every mode's shape")
        values[channel] = [complex(*m.shape[channel]) for m in modes]
        values[f"{channel}_std"] = [m.shape_std.get(channel, complex("nan")) for m in modes]
    _check_names(path, tuple(values), structure)
    return Columns(
        {name: np.array(value, dtype=complex) for name, value in values.items()}, list(range(1, len(modes) + 1))
    )


def _of_responses(path: Path, structure: Structure, window: float | None) -> Columns:
    """Identify the modes of the frequency responses of a universal file; responses at other places are left out."""
    modes = identify_file(path, structure.channels, window=window).modes.estimate
    values = {
        "frequency": modes.frequency,
        "frequency_std": modes.frequency_std,
        "damping": modes.damping,
        "damping_std": modes.damping_std,
        **dict(zip(modes.channels, modes.shape.T, strict=True)),
        **{f"{name}_std": std for name, std in zip(modes.channels, modes.shape_std.T, strict=True)},
    }
    return Columns(
        {name: np.asarray(value, np.complex128) for name, value in values.items()}, list(range(1, modes.n_modes + 1))
    )


def read_columns(path: Path, structure: Structure, window: float | None = None) -> Columns:
    """Read a CSV table, the JSON of `identify --json`, or frequency responses (UFF 58), of a structure's modes.

    Parameters
    ----------
    path : of the file
    structure : with the sensors
    window : time constant of the exponential window of frequency responses [s]. Default: none

    Raises
    ------
    LogError
        Naming line and column of an invalid number, or the invalid column.
    """
    if is_universal(path):
        columns = _of_responses(path, structure, window)
        columns.check(path, structure)
        return columns
    text = read_text(path)
    columns = (_of_json if path.suffix.lower() == ".json" else _of_csv)(path, text, structure)
    columns.check(path, structure)
    return columns
