"""Measured frequency responses of universal files: dataset 58, function type 4."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from daq.errors import DataError
from daq.files.columns.units import ACCELERATIONS
from daq.files.formats.universal.datasets import Dataset, datasets, force_unit, length_unit, node_name
from daq.types import FloatArray

_RESPONSE = 4  # function type
_TIMES_FREQUENCY = {0: 0, 1: 0, 8: 2, 11: 1, 12: 0}  # data type of the motion -> factors i omega to an acceleration
_FORCES = {0, 1, 9, 13}
_ACCELERATION, _GRAVITY = 12, ("g", "gn")
_SAME = 1e-6  # relative: lines are printed with six digits


@dataclass(frozen=True, eq=False, kw_only=True)
class FrequencyResponses:
    """Accelerations per force at all outputs, for one or more inputs."""

    frequency: FloatArray  #: (n_lines,) evenly spaced [Hz]
    response: npt.NDArray[np.complex128]  #: (n_lines, n_outputs, n_inputs) [m/s2/N]
    outputs: tuple[str, ...]  #: channels
    inputs: tuple[str, ...]  #: places of the forces

    @property
    def by_reciprocity(self) -> "FrequencyResponses":
        """Responses at the places of the forces to forces at the outputs: those of a linear structure are the same."""
        return replace(self, response=self.response.transpose(0, 2, 1), outputs=self.inputs, inputs=self.outputs)


def read_responses(path: Path) -> FrequencyResponses:
    """Read all frequency responses of a universal file; receptances and mobilities become accelerances.

    Lengths and forces are converted according to dataset 164, accelerations with the label `g` from g.

    Outputs and inputs are named after node and direction, as `read_universal` does; an output whose node is 0 after the
    first ID line.

    Raises
    ------
    DataError
        Naming the file, and the dataset that does not fit the others, or the response that is missing.
    """
    sets = datasets(path)
    newtons, metres = force_unit(path, sets), length_unit(path, sets)
    found = [(number, s) for number, s in sets if s["type"] == 58 and s["func_type"] == _RESPONSE]
    if not found:
        raise DataError(path, "holds no frequency response (dataset 58, function type 4)")
    lines = _lines(path, *found[0])
    outputs = [_output(s) for _, s in found]
    inputs = [node_name(s, "ref") for _, s in found]
    rows, columns = tuple(dict.fromkeys(outputs)), tuple(dict.fromkeys(inputs))
    response = np.full((len(lines), len(rows), len(columns)), np.nan, np.complex128)
    for (number, one), output, force in zip(found, outputs, inputs, strict=True):
        place = response[:, rows.index(output), columns.index(force)]
        if not np.isnan(place[0]):
            raise DataError(path, f"dataset {number}: the response of {output} to {force} is in the file twice")
        own = _lines(path, number, one)
        if len(own) != len(lines) or np.abs(own - lines).max() > _SAME * lines[-1]:
            raise DataError(path, f"dataset {number}: expected the lines of dataset {found[0][0]}")
        place[:] = _accelerance(path, number, one, lines) * newtons * (_of_gravity(one) or 1 / metres)
    missing = np.argwhere(np.isnan(response[0]))
    if len(missing):
        row, column = missing[0].tolist()
        raise DataError(path, f"holds no response of {rows[row]} to a force at {columns[column]}")
    return FrequencyResponses(frequency=lines, response=response, outputs=rows, inputs=columns)


def _of_gravity(series: Dataset) -> float | None:
    """Return the unit of accelerations [m/s2] that are labelled in g, which dataset 164 does not state."""
    label = str(series["ordinate_axis_units_lab"]).strip().lower()
    return ACCELERATIONS["g"] if label in _GRAVITY and series["ordinate_spec_data_type"] == _ACCELERATION else None


def _output(series: Dataset) -> str:
    line = str(series["id1"]).strip()
    return line if not series["rsp_node"] and line not in ("", "NONE") else node_name(series)


def _lines(path: Path, number: int, series: Dataset) -> FloatArray:
    """Return the lines [Hz]."""
    x = np.asarray(series["x"], np.float64)
    if len(x) < 3 or not np.isfinite(x).all() or int(series["abscissa_spacing"]) != 1 or not series["abscissa_inc"] > 0:
        raise DataError(path, f"dataset {number}: expected three or more evenly spaced lines")
    return x


def _accelerance(path: Path, number: int, series: Dataset, lines: FloatArray) -> npt.NDArray[np.complex128]:
    """Return one response as acceleration per force, lengths as in the file."""
    motion, force = int(series["ordinate_spec_data_type"]), int(series["orddenom_spec_data_type"])
    if motion not in _TIMES_FREQUENCY or force not in _FORCES:
        raise DataError(path, f"dataset {number}: expected motion per force, found data of type {motion} per {force}")
    values = np.asarray(series["data"], np.complex128)
    if len(values) != len(lines) or not np.isfinite(values).all():
        raise DataError(path, f"dataset {number}: expected {len(lines)} finite numbers")
    return np.asarray((2j * np.pi * lines) ** _TIMES_FREQUENCY[motion] * values)
