"""Datasets of a universal file, their units, and names of nodes.

References
----------
Structural Dynamics Research Corporation: universal file format, datasets 58 (function at nodal DOF) and 164 (units),
kept by the University of Cincinnati, www.ceas3.uc.edu/sdrluff.
"""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyuff

from daq.errors import DataError, reading

FUNCTIONS = (58, 164)  #: datasets that functions and their units are read from
SI_UNITS = {"type": 164, "units_code": 1, "length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15}
_AXES = {1: "x", 2: "y", 3: "z", 4: "rx", 5: "ry", 6: "rz"}

Dataset = dict[str, Any]  # as pyuff returns it


def datasets(path: Path, kinds: Collection[int] = FUNCTIONS) -> list[tuple[int, Dataset]]:
    """Return all datasets with their numbers, counted from 1; those of other kinds have their type only.

    Raises
    ------
    DataError
        Naming the file and the dataset that cannot be read.
    """
    with reading(path, DataError):
        path.open("rb").close()
    number = 0
    try:
        file = pyuff.UFF(str(path))
        found = []
        for number, kind in enumerate(map(int, file.get_set_types()), 1):
            found.append((number, file.read_sets(number - 1) if kind in kinds else {"type": kind}))
    except Exception as error:  # pyuff raises nothing narrower
        raise DataError(path, f"dataset {number}: cannot be read: {error}".splitlines()[0]) from error
    return found


def length_unit(path: Path, sets: Sequence[tuple[int, Dataset]]) -> float:
    """Return the length units of a file per metre, 1 if it does not state them."""
    return _unit(path, sets, "length")


def force_unit(path: Path, sets: Sequence[tuple[int, Dataset]]) -> float:
    """Return the force units of a file per newton, 1 if it does not state them."""
    return _unit(path, sets, "force")


def _unit(path: Path, sets: Sequence[tuple[int, Dataset]], kind: str) -> float:
    factor = next((float(s[kind]) for _, s in sets if s["type"] == 164), 1.0)
    if not 0 < factor < np.inf:
        raise DataError(path, f"dataset 164: expected a positive factor of {kind}, found {factor}")
    return factor


def node_name(series: Dataset, end: str = "rsp") -> str:
    """Return the name of a node and direction, of the response (`rsp`) or of the reference (`ref`)."""
    entity, direction = str(series[f"{end}_ent_name"]).strip(), int(series[f"{end}_dir"])
    axis = ("-" if direction < 0 else "") + _AXES.get(abs(direction), "")
    return "_".join(part for part in (entity if entity != "NONE" else "", str(series[f"{end}_node"]), axis) if part)
