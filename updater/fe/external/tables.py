"""DOF tables and faces of external matrices: CSV, or arrays in an npz file."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from daq import DataError, FloatArray, IntArray
from daq.files import DAMAGED_FILE, check_archive
from updater.errors import StructureError
from updater.structure import AXES

DAMAGED = (*DAMAGED_FILE, OSError, DataError)
TABLE_COLUMNS = ("node", "x", "y", "z", "axis")
FACE_COLUMNS = ("a", "b", "c", "d")


def read_table(path: Path) -> tuple[FloatArray, IntArray, tuple[str, ...]]:
    """Return nodes (n_nodes, 3), the rows of their DOFs (n_nodes, 6), and their names: numbers from 0 of an npz.

    Raises
    ------
    StructureError
        Naming the file and the line.
    """
    if path.suffix == ".npz":
        try:
            check_archive(path)
            with np.load(path) as file:
                nodes, dofs = np.asarray(file["nodes"], float), np.asarray(file["dofs"], np.int32)
            return *_checked_table(nodes, dofs), tuple(map(str, range(len(nodes))))
        except DAMAGED as error:
            raise StructureError(path, f"no DOF table can be read: {error}") from error
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            return _numbered(path, csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise StructureError(path, f"no DOF table can be read: {error}") from error


def _checked_table(nodes: FloatArray, dofs: IntArray) -> tuple[FloatArray, IntArray]:
    """Return nodes (n_nodes, 3) and rows (n_nodes, 6), once each row from 0 on is there once."""
    if nodes.shape != (len(nodes), 3) or not np.isfinite(nodes).all():
        raise ValueError(f"nodes: expected finite numbers (n_nodes, 3), found {nodes.shape}")
    if dofs.shape != (len(nodes), 6) or not np.array_equal(np.sort(dofs[dofs >= 0]), np.arange((dofs >= 0).sum())):
        raise ValueError(f"dofs: expected ({len(nodes)}, 6) with each row once, found {dofs.shape}")
    return nodes, dofs


def _numbered(path: Path, lines: Iterable[dict[str, str]]) -> tuple[FloatArray, IntArray, tuple[str, ...]]:
    places: dict[str, tuple[float, ...]] = {}
    numbers: dict[str, list[int]] = {}
    for row, line in enumerate(lines):
        what = f"line {row + 2}"
        try:
            node, axis = line["node"].strip(), AXES.index(line["axis"].strip())
            place = tuple(float(line[c]) for c in TABLE_COLUMNS[1:4])
        except (KeyError, ValueError, AttributeError, TypeError) as error:
            raise StructureError(path, f"{what}: expected {', '.join(TABLE_COLUMNS)} ({', '.join(AXES)})") from error
        own = numbers.setdefault(node, [-1] * 6)
        if own[axis] >= 0 or places.setdefault(node, place) != place:
            raise StructureError(path, f"{what}: node {node} has {AXES[axis]} already, or is somewhere else")
        own[axis] = row
    nodes, dofs = np.array([*places.values()], float), np.array([*numbers.values()], np.int32)
    return nodes.reshape(-1, 3), dofs.reshape(-1, 6), tuple(numbers)


def read_faces(path: Path, names: Sequence[str]) -> IntArray:
    """Return the corners (n_faces, 4) of faces, -1 as the last of a triangle; none of an npz without `faces`.

    Parameters
    ----------
    path : CSV with the columns a, b, c, d, or npz with the array `faces`
    names : of the nodes

    Raises
    ------
    StructureError
        Naming the file and the line, or the shape of the array.
    """
    try:
        if path.suffix == ".npz":
            check_archive(path)
            with np.load(path) as file:
                faces = np.asarray(file["faces"] if "faces" in file else np.empty((0, 4)), np.int32)
        else:
            with path.open(newline="", encoding="utf-8-sig") as lines:
                faces = _corners(path, csv.DictReader(lines), names)
    except (*DAMAGED, UnicodeDecodeError, csv.Error) as error:
        raise StructureError(path, f"no faces can be read: {error}") from error
    whole = faces.ndim == 2 and faces.shape[1] == 4
    if not whole or (faces >= len(names)).any() or (faces[:, :3] < 0).any() or (faces[:, 3:] < -1).any():
        raise StructureError(
            path, f"faces: expected (n_faces, 4) nodes, the last -1 for triangles, found {faces.shape}"
        )
    return faces


def _corners(path: Path, lines: Iterable[dict[str, str]], names: Sequence[str]) -> IntArray:
    number = {name: i for i, name in enumerate(names)} | {"": -1}
    found = []
    for row, line in enumerate(lines):
        corners = [number.get((line.get(column) or "").strip()) for column in FACE_COLUMNS]
        if None in corners or -1 in corners[:3]:
            expected = ", ".join(FACE_COLUMNS)
            raise StructureError(path, f"line {row + 2}: expected three or four nodes of the DOF table ({expected})")
        found.append(corners)
    return np.array(found, np.int32).reshape(-1, 4)
