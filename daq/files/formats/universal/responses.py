"""Frequency responses of universal files (dataset 58, function type 4) with their coherences (6, 26): read and written.

The multiple coherence g of an output is that with all forces at once. The noise of the response H_k to force k has the
variance ``(1 - g) S (S_f^-1)_kk / n``, S the spectrum of the output, of which ``g S`` is the sum of ``|H_j|^2 S_jj``
over independent forces. With forces of one level it is ``(1 - g) / g sum_j |H_j|^2 / n``. The coherence that force k
alone would have with this noise is ``1 / (1 + (1 - g) / g sum_j |H_j|^2 / |H_k|^2)``.

References
----------
Bendat, J. & Piersol, A. (2010). Random data. 4th edition, section 9.3: multiple input / single output estimates.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyuff

from daq.errors import DataError, writing
from daq.files.columns.units import ACCELERATIONS
from daq.files.formats.universal.datasets import SI_UNITS, Dataset, datasets, force_unit, length_unit, node_name
from daq.types import FloatArray

_RESPONSE, _COHERENCE, _MULTIPLE = 4, 6, 26  # function types
_TIMES_LAPLACE = {0: 0, 1: 0, 8: 2, 11: 1, 12: 0}  # data type of the motion -> factors s to an acceleration
_FORCES = {0, 1, 9, 13}
_ACCELERATION, _FORCE_TYPE, _FREQUENCY, _GRAVITY = 12, 13, 18, ("g", "gn")
_ROUNDING = 1e-3  # of a coherence, beyond 0 and 1
_FORCE = "force at {}"  # ID line 2
_NODE, _AXES = re.compile(r"([1-9]\d{0,8})_(-?)([xyz])"), {"x": 1, "y": 2, "z": 3}
_SAME = 1e-6  # relative: lines are printed with six digits


@dataclass(frozen=True, eq=False, kw_only=True)
class FrequencyResponses:
    """Accelerations per force at all outputs, for one or more inputs."""

    frequency: FloatArray  #: (n_lines,) evenly spaced [Hz]
    response: npt.NDArray[np.complex128]  #: (n_lines, n_outputs, n_inputs) [m/s2/N]
    outputs: tuple[str, ...]  #: channels
    inputs: tuple[str, ...]  #: places of the forces
    coherence: FloatArray | None = None  #: (n_lines, n_outputs, n_inputs) [-], NaN of a response without; None: of all

    @property
    def by_reciprocity(self) -> "FrequencyResponses":
        """Responses at the places of the forces to forces at the outputs, which a linear structure has in common."""
        coherence = None if self.coherence is None else self.coherence.transpose(0, 2, 1)
        swapped = self.response.transpose(0, 2, 1)
        return replace(self, response=swapped, outputs=self.inputs, inputs=self.outputs, coherence=coherence)


def read_responses(path: Path, window: float | None = None) -> FrequencyResponses:
    """Read all frequency responses of a universal file; receptances and mobilities become accelerances.

    Lengths and forces are converted according to dataset 164, accelerations with the label `g` from g.

    Outputs and inputs are named after node and direction, as `read_universal` does; an output whose node is 0 after the
    first ID line.

    Parameters
    ----------
    path : of the file
    window : time constant of the exponential window of forces and responses [s]. Default: none. A derivative is then
        the factor ``1 / window + 2 pi i f``, not ``2 pi i f``

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
    laplace = np.asarray((1 / window if window else 0.0) + 2j * np.pi * lines, np.complex128)
    outputs = [_output(s) for _, s in found]
    inputs = [_input(s) for _, s in found]
    rows, columns = tuple(dict.fromkeys(outputs)), tuple(dict.fromkeys(inputs))
    response = np.full((len(lines), len(rows), len(columns)), np.nan, np.complex128)
    for (number, one), output, force in zip(found, outputs, inputs, strict=True):
        place = response[:, rows.index(output), columns.index(force)]
        if not np.isnan(place[0]):
            raise DataError(path, f"dataset {number}: the response of {output} to {force} is in the file twice")
        _check_lines(path, number, one, found[0][0], lines)
        place[:] = _accelerance(path, number, one, laplace) * newtons * (_of_gravity(one) or 1 / metres)
    missing = np.argwhere(np.isnan(response[0]))
    if len(missing):
        row, column = missing[0].tolist()
        raise DataError(path, f"holds no response of {rows[row]} to a force at {columns[column]}")
    found_of = FrequencyResponses(frequency=lines, response=response, outputs=rows, inputs=columns)
    return replace(found_of, coherence=_coherence(path, sets, found_of, found[0][0]))


def _coherence(
    path: Path, sets: Sequence[tuple[int, Dataset]], found: FrequencyResponses, first: int
) -> FloatArray | None:
    """Return the coherences (n_lines, n_outputs, n_inputs), NaN where the file has none; None if it has none at all.

    The multiple coherence of an output is used, if the file has it: with several forces at once that of each response
    is low for the other forces, not for noise.
    """
    coherence = np.full(found.response.shape, np.nan)
    multiple = np.full(found.response.shape[:2], np.nan)
    for number, one in sets:
        if one["type"] != 58 or one["func_type"] not in (_COHERENCE, _MULTIPLE) or _output(one) not in found.outputs:
            continue
        output = found.outputs.index(_output(one))
        if one["func_type"] == _MULTIPLE:
            multiple[:, output] = _checked_coherence(path, number, one, first, found.frequency)
        elif _input(one) in found.inputs:
            values = _checked_coherence(path, number, one, first, found.frequency)
            coherence[:, output, found.inputs.index(_input(one))] = values
    known = np.isfinite(multiple).all(axis=0)
    coherence[:, known] = _of_each_force(multiple[:, known], found.response[:, known])
    return None if np.isnan(coherence).all() else coherence


def _checked_coherence(path: Path, number: int, series: Dataset, first: int, lines: FloatArray) -> FloatArray:
    """Return the coherences (n_lines,) of a dataset with the lines of the first response."""
    _check_lines(path, number, series, first, lines)
    values = np.asarray(series["data"])
    outside = np.iscomplexobj(values) or not ((values > -_ROUNDING) & (values < 1 + _ROUNDING)).all()
    if len(values) != len(lines) or outside:
        raise DataError(path, f"dataset {number}: expected {len(lines)} coherences from 0 to 1")
    return np.asarray(np.clip(values, 0.0, 1.0))


def _of_each_force(multiple: FloatArray, response: npt.NDArray[np.complex128]) -> FloatArray:
    """Return the coherences (n_lines, n_outputs, n_inputs) that each force alone would have with the same noise.

    Parameters
    ----------
    multiple : (n_lines, n_outputs) coherence with all forces
    response : (n_lines, n_outputs, n_inputs)
    """
    power = np.abs(response) ** 2
    own = multiple[:, :, None] * power
    rest = (1 - multiple[:, :, None]) * power.sum(axis=2, keepdims=True)
    total = own + rest
    return np.asarray(np.divide(own, total, out=np.zeros(total.shape), where=total > 0))


def write_responses(path: Path, responses: FrequencyResponses, header: Dataset) -> None:
    """Write accelerances, and coherences where they are known, as text of twelve digits, with a header and units.

    An output ``12_-z`` is node 12 in direction -z; another name is ID line 1 with node 0. Inputs have ID line 2.

    Parameters
    ----------
    path : of the file, which is replaced
    responses : to write
    header : as returned by `header_set`

    Raises
    ------
    DataError
        If the file cannot be written.
    """
    with writing(path, DataError):  # pyuff would not state the reason
        path.open("wb").close()
    sets: list[Dataset] = [header, SI_UNITS]
    for (i, output), (k, force) in product(enumerate(responses.outputs), enumerate(responses.inputs)):
        place = {"id1": output, "id2": _FORCE.format(force), **_node(output, "rsp"), **_node(force, "ref")}
        sets.append(_function(_RESPONSE, responses.frequency, responses.response[:, i, k], place))
        if responses.coherence is not None and np.isfinite(responses.coherence[:, i, k]).all():
            sets.append(_function(_COHERENCE, responses.frequency, responses.coherence[:, i, k], place))
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")


def _function(
    kind: int, frequency: FloatArray, values: npt.NDArray[np.complex128] | FloatArray, place: Dataset
) -> Dataset:
    motion, force = (_ACCELERATION, _FORCE_TYPE) if kind == _RESPONSE else (0, 0)
    function: Dataset = pyuff.prepare_58(
        func_type=kind,
        **place,
        abscissa_spacing=1,
        abscissa_spec_data_type=_FREQUENCY,
        ordinate_spec_data_type=motion,
        orddenom_spec_data_type=force,
        binary=0,
        data=values,
        x=frequency,
    )
    return function


def _node(name: str, end: str) -> Dataset:
    """Return node and direction of a name such as ``12_-z``; node 0 of another one."""
    match = _NODE.fullmatch(name)
    node, direction = (0, 0) if match is None else (int(match[1]), _AXES[match[3]] * (-1 if match[2] else 1))
    return {f"{end}_ent_name": "NONE", f"{end}_node": node, f"{end}_dir": direction}


def _of_gravity(series: Dataset) -> float | None:
    """Return the unit of accelerations [m/s2] that are labelled in g, which dataset 164 does not state."""
    label = str(series["ordinate_axis_units_lab"]).strip().lower()
    return ACCELERATIONS["g"] if label in _GRAVITY and series["ordinate_spec_data_type"] == _ACCELERATION else None


def _output(series: Dataset) -> str:
    line = str(series["id1"]).strip()
    return line if not series["rsp_node"] and line not in ("", "NONE") else node_name(series)


def _input(series: Dataset) -> str:
    """Return the name of a force: node and direction, or that of ID line 2 as `write_responses` has it."""
    match = None if series["ref_node"] else re.fullmatch(_FORCE.format("(.+)"), str(series["id2"]).strip())
    return match[1] if match else node_name(series, "ref")


def _check_lines(path: Path, number: int, series: Dataset, first: int, lines: FloatArray) -> None:
    """Refuse lines that are not those of the first response."""
    own = _lines(path, number, series)
    if len(own) != len(lines) or np.abs(own - lines).max() > _SAME * lines[-1]:
        raise DataError(path, f"dataset {number}: expected the lines of dataset {first}")


def _lines(path: Path, number: int, series: Dataset) -> FloatArray:
    """Return the lines [Hz]."""
    x = np.asarray(series["x"], np.float64)
    if len(x) < 3 or not np.isfinite(x).all() or int(series["abscissa_spacing"]) != 1 or not series["abscissa_inc"] > 0:
        raise DataError(path, f"dataset {number}: expected three or more evenly spaced lines")
    return x


def _accelerance(
    path: Path, number: int, series: Dataset, laplace: npt.NDArray[np.complex128]
) -> npt.NDArray[np.complex128]:
    """Return one response as acceleration per force, lengths as in the file."""
    motion, force = int(series["ordinate_spec_data_type"]), int(series["orddenom_spec_data_type"])
    if motion not in _TIMES_LAPLACE or force not in _FORCES:
        raise DataError(path, f"dataset {number}: expected motion per force, found data of type {motion} per {force}")
    values = np.asarray(series["data"], np.complex128)
    if len(values) != len(laplace) or not np.isfinite(values).all():
        raise DataError(path, f"dataset {number}: expected {len(laplace)} finite numbers")
    return np.asarray(laplace ** _TIMES_LAPLACE[motion] * values)
