"""Stiffness and mass that another program made, read from Matrix Market or npz files and checked.

A DOF table gives the meaning of the rows: node, its position and the axis (x y z rx ry rz) of every row.
"""

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import scipy  # its parts at their first use
from scipy import sparse
from scipy.sparse.linalg import eigsh

from daq import FloatArray, IndexArray, IntArray
from daq.errors import reading
from daq.files import check_archive
from updater.errors import StructureError
from updater.fe.external.tables import DAMAGED, FACE_COLUMNS, TABLE_COLUMNS, read_faces, read_table
from updater.structure import AXES

_MAX_ROWS = 10_000_000
_BLANK, _NEWLINE = ord(" "), ord("\n")
_SYMMETRIC = 1e-8  # relative to the largest entry: error of truncated digits in a text file
_ROUNDING = 1e-8  # relative to a DOF's own mass: error of an eigenvalue of zero by truncated digits
_OF_WHOLE = 1e-6  # relative excess of a group over the whole by truncated digits
_DENSE = 300  # DOFs up to which all eigenvalues are solved for


@dataclass(frozen=True, eq=False, kw_only=True)
class Matrices:
    """Symmetric matrices and the meaning of their rows."""

    stiffness: sparse.csc_array  #: (n_dofs, n_dofs) [N/m, N, N m]
    mass: sparse.csc_array  #: (n_dofs, n_dofs) [kg, kg m, kg m2]
    nodes: FloatArray  #: (n_nodes, 3) [m]
    dofs: IntArray  #: (n_nodes, 6) row of each node's DOF, -1 where there is none
    #: parts of the stiffness by name, each (n_dofs, n_dofs)
    groups: Mapping[str, sparse.csc_array] = field(default_factory=dict)
    #: (n_faces, 4) nodes about each face of plates, shells and solids; the last is -1 for a triangle
    faces: IntArray = field(default_factory=lambda: np.empty((0, 4), np.int32))


def read_matrices(stiffness: Path, mass: Path, table: Path, faces: Path | None = None) -> Matrices:
    """Read Matrix Market files and a DOF table (CSV with the columns node, x, y, z, axis, a line a row).

    One npz file may contain all of them, as written by `save_matrices`. Faces are a CSV with the columns a, b, c, d:
    names of the nodes about each face, d empty for a triangle.

    Raises
    ------
    StructureError
        Naming the file and the row if one cannot be read, if they do not fit together, or if a matrix is not
        symmetric, not finite, singular by an empty row, or indefinite.
    """
    files = [(path, _changed(path)) for path in (stiffness, mass, table, faces or table)]
    return _read(*files)


def read_group(path: Path, name: str, whole: Matrices) -> sparse.csc_array:
    """Read the stiffness (n_dofs, n_dofs) of a group from a Matrix Market file, or from an npz of `save_matrices`.

    Raises
    ------
    StructureError
        Naming the file and the group if it cannot be read, does not fit the whole, or is stiffer than the whole.
    """
    return _read_group((path, _changed(path)), name, whole)


@lru_cache(maxsize=64)
def _read_group(path: tuple[Path, int], name: str, whole: Matrices) -> sparse.csc_array:
    matrix, what = _matrix(path[0], f"group_{name}"), f"group {name}"
    if matrix.shape != whole.stiffness.shape:
        raise StructureError(path[0], f"{what}: expected {whole.stiffness.shape} entries, found {matrix.shape}")
    _check_entries(path[0], matrix, whole, what)
    diagonal = matrix.diagonal()
    check_part(path[0], what, diagonal, whole)
    held = np.flatnonzero(diagonal > _SYMMETRIC * whole.stiffness.diagonal())
    if not len(held):
        raise StructureError(path[0], f"{what}: there is no stiffness")
    root = sparse.diags_array(diagonal[held] ** -0.5)
    if _least(sparse.csc_array(root @ matrix[held][:, held] @ root)) < -_ROUNDING:
        raise StructureError(path[0], f"{what}: indefinite: some motion has a negative energy")
    return matrix


def check_part(path: Path, what: str, diagonal: FloatArray, whole: Matrices) -> None:
    """Check that the diagonal (n_dofs,) of a part of the stiffness is between zero and that of the whole.

    Raises
    ------
    StructureError
        Naming the file, the part and the row.
    """
    limit = whole.stiffness.diagonal()
    wrong = np.flatnonzero((diagonal < -_SYMMETRIC * limit) | (diagonal > (1 + _OF_WHOLE) * limit))
    if len(wrong):
        row = int(wrong[0])
        raise StructureError(
            path,
            f"{what}: expected 0 to {limit[row]:.6g}, which is the whole, on the diagonal of {_named(whole, row)}, "
            f"found {diagonal[row]:.6g}",
        )


def _changed(path: Path) -> int:
    with reading(path, StructureError):
        return path.stat().st_mtime_ns


@lru_cache(maxsize=4)
def _read(
    stiffness: tuple[Path, int], mass: tuple[Path, int], table: tuple[Path, int], faces: tuple[Path, int]
) -> Matrices:
    """Read the files, once for every change of them."""
    k, m = _matrix(stiffness[0], "stiffness"), _matrix(mass[0], "mass")
    nodes, dofs, names = read_table(table[0])
    if faces != table:
        corners = read_faces(faces[0], names)
    else:
        corners = read_faces(table[0], names) if table[0].suffix == ".npz" else np.empty((0, 4), np.int32)
    n = int(dofs.max(initial=-1)) + 1
    for path, matrix in ((stiffness[0], k), (mass[0], m)):
        if matrix.shape != (n, n):
            raise StructureError(path, f"expected {n} x {n} entries as {table[0].name} has rows, found {matrix.shape}")
    found = Matrices(stiffness=k, mass=m, nodes=nodes, dofs=dofs, faces=corners)
    _check(stiffness[0], k, found, "stiffness")
    _check(mass[0], m, found, "mass")
    return replace(found, stiffness=whole_blocks(k, dofs))


def whole_blocks(stiffness: sparse.csc_array, dofs: IntArray) -> sparse.csc_array:
    """Return the same matrix with zeros stored wherever two nodes have an entry in common.

    Rows of a node that have one pattern are ordered as one by the solver, which fills less.

    Parameters
    ----------
    stiffness : (n_dofs, n_dofs)
    dofs : (n_nodes, 6) row of each node's DOF, -1 where there is none
    """
    node, axis = np.nonzero(dofs >= 0)
    of_node = sparse.csr_array((np.ones(len(node)), (dofs[node, axis], node)), shape=(stiffness.shape[0], len(dofs)))
    pattern = (of_node @ (of_node.T @ abs(stiffness) @ of_node) @ of_node.T).tocoo()
    own = stiffness.tocoo()
    row, column = (np.concatenate([own.coords[i], pattern.coords[i]]) for i in (0, 1))
    return sparse.csc_array((np.concatenate([own.data, np.zeros(pattern.nnz)]), (row, column)), shape=own.shape)


def save_matrices(path: Path, matrices: Matrices) -> None:
    """Write matrices to one npz file, or to .mtx files, dofs.csv and faces.csv in a folder.

    Nodes without a row are not in dofs.csv, so that faces with such a node need the npz.

    Parameters
    ----------
    path : ends in .npz, or an existing folder
    matrices : to write; the npz holds `nodes`, `dofs`, `faces` and, of each matrix by columns, `NAME_data`,
        `NAME_indices` and `NAME_indptr`, as scipy.sparse has them
    """
    both = {"stiffness": matrices.stiffness, "mass": matrices.mass}
    both |= {f"group_{name}": sparse.csc_array(matrix) for name, matrix in matrices.groups.items()}
    if path.suffix == ".npz":
        parts = {f"{name}_{part}": getattr(a, part) for name, a in both.items() for part in _PARTS}
        np.savez_compressed(path, nodes=matrices.nodes, dofs=matrices.dofs, faces=matrices.faces, **parts)
        return
    for name, a in both.items():
        scipy.io.mmwrite(path / f"{name}.mtx", sparse.coo_array(a), symmetry="symmetric", precision=17)
    node, axis = np.nonzero(matrices.dofs >= 0)
    order = np.argsort(matrices.dofs[node, axis])
    with (path / "dofs.csv").open("w", newline="", encoding="utf-8") as file:
        lines = ((node[i], *matrices.nodes[node[i]].tolist(), AXES[axis[i]]) for i in order)
        csv.writer(file).writerows([TABLE_COLUMNS, *lines])
    if len(matrices.faces):
        with (path / "faces.csv").open("w", newline="", encoding="utf-8") as file:
            corners = (["" if node < 0 else node for node in face] for face in matrices.faces.tolist())
            csv.writer(file).writerows([FACE_COLUMNS, *corners])


_PARTS = ("data", "indices", "indptr")


def _matrix(path: Path, name: str) -> sparse.csc_array:
    try:
        if path.suffix == ".npz":
            check_archive(path)
            with np.load(path) as file:
                data, indices, indptr = (file[f"{name}_{part}"] for part in _PARTS)
            check_indices(data, indices, indptr)
            matrix = sparse.csc_array((data.astype(float), indices, indptr), shape=(len(indptr) - 1,) * 2)
        else:
            _check_stated(path)
            matrix = sparse.csc_array(scipy.io.mmread(path, spmatrix=False), dtype=float)
    except DAMAGED as error:
        raise StructureError(path, f"{name}: no matrix can be read: {error}".splitlines()[0]) from error
    return matrix


def check_indices(data: FloatArray, indices: IndexArray, indptr: IndexArray) -> None:
    """Refuse columns and rows outside a matrix: scipy would follow them in memory."""
    n = len(indptr) - 1
    if not data.ndim == indices.ndim == indptr.ndim == 1 or not 0 < n <= _MAX_ROWS:
        raise ValueError(f"expected one-dimensional arrays of up to {_MAX_ROWS} rows, found {indptr.shape}")
    if indptr[0] != 0 or (np.diff(indptr) < 0).any() or not indptr[-1] == len(indices) == len(data):
        raise ValueError(f"indptr: expected ascending places up to {len(data)}, found {indptr.min()} to {indptr.max()}")
    if len(indices) and not 0 <= indices.min() <= indices.max() < n:
        raise ValueError(f"indices: expected rows 0 to {n - 1}, found {indices.min()} to {indices.max()}")


def _check_stated(path: Path) -> None:
    """Refuse a Matrix Market file whose lines do not match its header: scipy's reader crashes on some of them."""
    rows, columns, entries, form, field, _ = scipy.io.mminfo(path)
    size = path.stat().st_size
    if max(rows, columns) > _MAX_ROWS or entries > size:
        raise ValueError(f"{rows} x {columns} with {entries} entries in {size} bytes, expected up to {_MAX_ROWS} rows")
    n_values = {"pattern": 0, "complex": 2}.get(field, 1) + 2 * (form == "coordinate")
    with path.open("rb") as file:
        while (line := file.readline()).startswith(b"%") or not line.strip():
            if not line:
                raise ValueError("expected numbers of rows, columns and entries")
        body = np.frombuffer(b"\n" + file.read() + b"\n", np.uint8)
    blank, ends = body <= _BLANK, np.flatnonzero(body == _NEWLINE)
    begins = np.flatnonzero(blank[:-1] & ~blank[1:])
    per_line = np.diff(np.searchsorted(begins, ends))
    wrong = np.flatnonzero((per_line > 0) & (per_line != n_values))
    if len(wrong):
        raise ValueError(f"expected {n_values} numbers per line, found {per_line[wrong[0]]}")


def _check_entries(path: Path, matrix: sparse.csc_array, found: Matrices, what: str) -> None:
    """Check that entries are finite and symmetric."""
    if not np.isfinite(matrix.data).all():
        raise StructureError(path, f"{what}: an entry is not finite")
    skew = abs(matrix - matrix.T).tocoo()
    if skew.nnz and skew.data.max() > _SYMMETRIC * abs(matrix).max():
        worst = int(np.argmax(skew.data))
        first, second = _named(found, int(skew.row[worst])), _named(found, int(skew.col[worst]))
        raise StructureError(path, f"{what}: not symmetric between {first} and {second}")


def _check(path: Path, matrix: sparse.csc_array, found: Matrices, what: str) -> None:
    _check_entries(path, matrix, found, what)
    diagonal, filled = matrix.diagonal(), np.diff(matrix.indptr) > 0
    wrong = np.flatnonzero((diagonal < 0) | ((diagonal == 0) & (filled if what == "mass" else True)))
    if len(wrong):
        raise StructureError(path, f"{what}: {diagonal[wrong[0]]:g} on the diagonal of {_named(found, int(wrong[0]))}")
    if what == "mass":
        heavy = np.flatnonzero(diagonal > 0)
        if not len(heavy):
            raise StructureError(path, "mass: there is none")
        root = sparse.diags_array(diagonal[heavy] ** -0.5)
        if _least(sparse.csc_array(root @ matrix[heavy][:, heavy] @ root)) < -_ROUNDING:
            raise StructureError(path, "mass: indefinite: some motion has a negative kinetic energy")


def _least(matrix: sparse.csc_array) -> float:
    """Return the least eigenvalue of a matrix with a diagonal of ones: a mass's are of order one or zero."""
    n = matrix.shape[0]
    if n <= _DENSE:
        return float(np.linalg.eigvalsh(matrix.toarray())[0])
    start = np.random.default_rng(0).standard_normal(n)
    return float(eigsh(matrix, 1, which="SA", v0=start, tol=1e-2, return_eigenvectors=False)[0])


def _named(found: Matrices, row: int) -> str:
    node, axis = np.argwhere(found.dofs == row)[0]
    return f"{AXES[axis]} at {found.nodes[node].round(4).tolist()} (row {row})"
