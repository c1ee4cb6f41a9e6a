"""Nodes and trace lines of universal files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from daq import DataError
from daq.files import read_geometry

NODES = {"type": 15, "node_nums": [1, 2, 7], "x": [0.0, 0.0, 500.0], "y": [0.0, 250.0, 0.0], "z": [0.0, 1000.0, 2000.0]}
UNITS = {"type": 164, "units_code": 9, "length": 1000.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15}


def line(*nodes: int) -> dict[str, Any]:
    return {"type": 82, "trace_num": 1, "nodes": np.array(nodes), "id": "frame", "color": 0}


def universal(path: Path, *sets: Any) -> Path:
    pyuff.UFF(str(path)).write_sets(list(sets), "overwrite")
    return path


def test_nodes_and_lines_are_read_in_metres(tmp_path: Path) -> None:
    found = read_geometry(universal(tmp_path / "a.uff", UNITS, NODES, line(1, 2, 0, 2, 7)))
    assert found is not None
    assert found.nodes == {1: (0.0, 0.0, 0.0), 2: (0.0, 0.25, 1.0), 7: (0.5, 0.0, 2.0)}
    assert found.lines == ((1, 2), (2, 7))


def test_double_precision_nodes_are_read(tmp_path: Path) -> None:
    zeros = {name: np.zeros(3, int) for name in ("def_cs", "disp_cs", "color")}
    found = read_geometry(universal(tmp_path / "a.uff", NODES | zeros | {"type": 2411}))
    assert found is not None
    assert found.nodes[7] == (500.0, 0.0, 2000.0)


def test_file_without_nodes_has_no_geometry(tmp_path: Path) -> None:
    assert read_geometry(universal(tmp_path / "a.uff", UNITS)) is None


@pytest.mark.parametrize(
    ("sets", "message"),
    [
        ((NODES, line(1, 3)), "dataset 2: node 3 of the trace line is not among the nodes"),
        ((NODES | {"z": [0.0, float("nan"), 1.0]},), "dataset 1: expected a number and three finite coordinates"),
    ],
)
def test_inconsistent_geometry_is_refused(tmp_path: Path, sets: Any, message: str) -> None:
    with pytest.raises(DataError, match=rf"a\.uff: {message}"):
        read_geometry(universal(tmp_path / "a.uff", *sets))
