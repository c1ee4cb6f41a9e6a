"""Files of another finite element program as matrices with a DOF table, groups and faces."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from daq import FloatArray
from updater.errors import StructureError
from updater.fe.external.files import Matrices
from updater.fe.external.programs.harwell_boeing import is_harwell_boeing, read_harwell_boeing
from updater.fe.external.programs.meshes import read_mesh
from updater.fe.external.programs.nastran import is_dmig, read_dmig
from updater.fe.external.programs.numbers import (
    SCALAR,
    LabelledMatrix,
    Row,
    checked_rows,
    numbers,
    read_text,
    symmetric,
)
from updater.fe.external.programs.output4 import read_output4

_FIXED = 1e30  # stiffness on the diagonal from which a DOF is fixed: Abaqus writes 1e36
_MILLIMETRE = 1e-3  # m
_SCALAR_AXIS = 3  # rx: rotations are in no total mass
_OUTSIDE = 0.05  # of the size of the structure: distance of the nodes for scalar points
_LEAST_SIZE = 1e-3  # m


@dataclass(frozen=True, kw_only=True)
class ProgramFiles:
    """Files that another program wrote of one model."""

    stiffness: Path
    mass: Path
    nodes: Path  #: input file, result or table with the nodes
    rows: Path | None = None  #: names of the rows. Default: the file that the program writes next to the matrix
    groups: Mapping[str, Path] = field(default_factory=dict)  #: own stiffness of each group
    doubled: Mapping[str, Path] = field(default_factory=dict)  #: whole stiffness with that of the group doubled
    millimetres: bool = False  #: whether the units are mm, N and t


def read_program_files(files: ProgramFiles) -> Matrices:
    """Read the matrices of another program.

    Rows of fixed DOFs, and rows without stiffness and mass, are left out. Displacements in other coordinate systems are
    turned to the basic one. Scalar points without mass are condensed. Those with mass become rotations about x of nodes
    outside of the structure, which are no part of any total mass.

    Raises
    ------
    StructureError
        Naming the file and the node or row.
    """
    mesh = read_mesh(files.nodes)
    known, points = sorted(mesh.nodes), mesh.rows()
    whole = read_labelled(files.stiffness, files.rows, points)
    mass = _like(read_labelled(files.mass, files.rows, points, files.stiffness, initial="M"), whole)
    parts = {**files.groups, **files.doubled}
    read = {name: read_labelled(path, files.rows, points, files.stiffness) for name, path in parts.items()}
    own = {name: _like(matrix, whole) for name, matrix in read.items()}
    own = {name: matrix - whole.matrix if name in files.doubled else matrix for name, matrix in own.items()}
    both = next((node for node, axis in whole.rows if axis == SCALAR and node in mesh.nodes), None)
    if both is not None:
        raise StructureError(files.stiffness, f"node {both}: expected degrees of freedom 1 to 6, found 0")
    turned = _onto_basic(whole, mesh.axes)
    mass, own = _between(turned, mass), {name: _between(turned, part) for name, part in own.items()}
    whole = replace(whole, matrix=_between(turned, whole.matrix))
    whole = _without_scalar_points(whole, [mass, *own.values()])
    diagonal, moved = whole.matrix.diagonal(), mass.diagonal()
    inside = np.array([node in mesh.nodes or axis == SCALAR for node, axis in whole.rows])
    used = (diagonal < _FIXED) & ((diagonal != 0) | (moved != 0))
    lost = np.flatnonzero(used & ~inside)
    if len(lost):
        node = whole.rows[lost[0]][0]
        raise StructureError(files.nodes, f"node {node} has rows in {files.stiffness.name}, and no position")
    kept = np.flatnonzero(used)
    if not len(kept):
        raise StructureError(files.stiffness, "no row has stiffness")
    rows = [whole.rows[i] for i in kept.tolist()]
    scalars = [node for node, axis in rows if axis == SCALAR]
    turning = np.array([axis >= 3 for _, axis in rows])  # 1 N/mm is 1000 N/m, 1 N mm is 0.001 N m, 1 t is 1000 kg
    scale = np.where(turning, _MILLIMETRE**0.5, _MILLIMETRE**-0.5) if files.millimetres else np.ones(len(rows))
    number = {node: i for i, node in enumerate([*known, *scalars])}
    dofs = np.full((len(number), 6), -1, np.int32)
    for row, (node, axis) in enumerate(rows):
        dofs[number[node], axis if axis != SCALAR else _SCALAR_AXIS] = row
    nodes = _with_places(np.array([mesh.nodes[node] for node in known]), len(scalars))
    nodes = nodes * (_MILLIMETRE if files.millimetres else 1.0)
    return Matrices(
        stiffness=_scaled(whole.matrix[kept][:, kept], scale),
        mass=_scaled(mass[kept][:, kept], scale),
        nodes=nodes,
        dofs=dofs,
        groups={name: _scaled(part[kept][:, kept], scale) for name, part in own.items()},
        faces=mesh.faces(number),
    )


def _onto_basic(whole: LabelledMatrix, axes: Mapping[int, FloatArray]) -> sparse.csc_array:
    """Return the displacements (n, n) in the nodes' own axes of those in the basic system.

    Parameters
    ----------
    axes : (3, 3) by node, where they are others

    Raises
    ------
    StructureError
        If a node with other axes lacks one of three rows.
    """
    onto = sparse.lil_array(sparse.eye_array(len(whole.rows)))
    place = {row: i for i, row in enumerate(whole.rows)}
    for node, own in axes.items():
        for first in (0, 3):
            here = [place[node, axis] for axis in range(first, first + 3) if (node, axis) in place]
            if len(here) == 3:
                for (i, j), value in np.ndenumerate(own):
                    onto[here[i], here[j]] = float(value)
            elif here:
                raise StructureError(
                    whole.path,
                    f"node {node}: its displacements are in a coordinate system: expected degrees of freedom "
                    f"{first + 1} to {first + 3}, found {len(here)} of them",
                )
    return sparse.csc_array(onto)


def _between(onto: sparse.csc_array, matrix: sparse.csc_array) -> sparse.csc_array:
    return sparse.csc_array(onto.T @ matrix @ onto)


def _with_places(nodes: FloatArray, n_scalars: int) -> FloatArray:
    """Return nodes (n_nodes, 3) with further ones outside of them, on no line between them, for scalar points."""
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    step = _OUTSIDE * max(float(np.linalg.norm(high - low)), _LEAST_SIZE) / max(n_scalars, 1)
    return np.vstack([nodes, high + step * np.arange(1, n_scalars + 1)[:, None]])


def _without_scalar_points(whole: LabelledMatrix, moved: Sequence[sparse.csc_array]) -> LabelledMatrix:
    """Return the stiffness with the scalar points condensed that have no mass and are in no group: this is exact.

    Parameters
    ----------
    moved : mass and groups, each (n, n)

    Raises
    ------
    StructureError
        If a scalar point can move without force.
    """
    ones = np.ones(len(whole.rows))
    empty = sum((abs(matrix) @ ones for matrix in moved), 0 * ones) == 0
    scalar = np.array([axis == SCALAR for _, axis in whole.rows]) & empty
    inner = np.flatnonzero(scalar & (np.diff(whole.matrix.indptr) > 0) & (whole.matrix.diagonal() < _FIXED))
    if not len(inner):
        return whole
    across = whole.matrix[inner]
    near = np.flatnonzero(np.diff(across.indptr) > 0)
    joined = across[:, near].toarray()
    try:
        part = joined.T @ splu(sparse.csc_array(across[:, inner])).solve(joined)
    except RuntimeError as error:
        raise StructureError(whole.path, f"scalar point {whole.rows[inner[0]][0]}: a motion needs no force") from error
    onto = sparse.csc_array((np.ones(len(near)), (near, np.arange(len(near)))), shape=(len(scalar), len(near)))
    others = sparse.diags_array(np.where(np.isin(np.arange(len(scalar)), inner), 0.0, 1.0))
    left = others @ (whole.matrix - onto @ sparse.csc_array(part) @ onto.T) @ others
    return replace(whole, matrix=sparse.csc_array(left))


def _like(matrix: LabelledMatrix, whole: LabelledMatrix) -> sparse.csc_array:
    """Return a matrix in the order of another's rows; rows that only the other has are zero.

    Raises
    ------
    StructureError
        If it has an entry at a row that the other has not.
    """
    place = {row: i for i, row in enumerate(whole.rows)}
    filled = np.diff(matrix.matrix.indptr) > 0
    missing = [row for row, has in zip(matrix.rows, filled.tolist(), strict=True) if has and row not in place]
    if missing:
        node, axis = missing[0]
        raise StructureError(matrix.path, f"node {node}: degree of freedom {axis + 1} is not in {whole.path.name}")
    own = [i for i, row in enumerate(matrix.rows) if row in place]
    to = np.array([place[matrix.rows[i]] for i in own], np.intp)
    onto = sparse.csc_array((np.ones(len(own)), (to, own)), shape=(len(whole.rows), len(matrix.rows)))
    return sparse.csc_array(onto @ matrix.matrix @ onto.T)


def _scaled(matrix: sparse.csc_array, scale: FloatArray) -> sparse.csc_array:
    factor = sparse.diags_array(scale)
    scaled = sparse.csc_array(factor @ matrix @ factor)
    return sparse.csc_array((scaled + scaled.T) / 2)


def read_labelled(
    path: Path, rows: Path | None, points: Sequence[Row], like: Path | None = None, initial: str = "K"
) -> LabelledMatrix:
    """Read a matrix in the format that its ending and content show.

    Parameters
    ----------
    path : of the matrix
    rows : file with the names of its rows. Default: the file of the same name that the program writes (.dof, .mapping)
    points : rows of all points, in the order of Nastran's OUTPUT4 files
    like : matrix whose names of rows are meant if it has no file of its own
    initial : of the name of the matrix that is meant, in a file of Nastran that has several

    Raises
    ------
    StructureError
        Naming the file and what is wrong.
    """
    if path.suffix.lower() == ".op4":
        return read_output4(path, points, initial)
    text = read_text(path)
    every = text.splitlines()
    lines = [line for line in every if line.strip()]
    if not lines:
        raise StructureError(path, "no matrix can be read: the file is empty")
    if is_dmig(lines):
        return read_dmig(path, lines, initial)
    if is_harwell_boeing(every):
        return read_harwell_boeing(path, every, rows or _names(path, ".mapping", like))
    data = [line for line in lines if not line.startswith("*")]
    width = len(data[0].replace(",", " ").split()) if data else 0
    if width == 5:
        return _abaqus(path, data)
    if width == 3:
        return _calculix(path, data, rows or _names(path, ".dof", like))
    raise StructureError(path, "expected a matrix of Abaqus, CalculiX, Ansys (HBMAT) or Nastran (.op4, DMIG)")


def _names(path: Path, suffix: str, like: Path | None) -> Path:
    own = path.with_suffix(suffix)
    return own if like is None or own.exists() else like.with_suffix(suffix)


def _calculix(path: Path, lines: Sequence[str], names: Path) -> LabelledMatrix:
    """Read row, column and value per line; names are NODE.AXIS, one line per row."""
    found: list[Row] = []
    for line in read_text(names).split():
        node, _, axis = line.partition(".")
        if not (node.isdecimal() and axis.isdecimal()):
            raise StructureError(names, f"expected NODE.AXIS, found {line!r:.40}")
        found.append((int(node), int(axis) - 1))
    rows = checked_rows(names, found)
    table = numbers(path, lines, 3)
    row, column = (table[:, :2].astype(np.int64) - 1).T
    return LabelledMatrix(path, symmetric(path, row, column, table[:, 2], len(rows)), rows)


def _abaqus(path: Path, lines: Sequence[str]) -> LabelledMatrix:
    """Read node, axis, node, axis and value per line: FORMAT=MATRIX INPUT."""
    table = numbers(path, lines, 5)
    pairs = table[:, :4].astype(np.int64).reshape(-1, 2)
    names, number = np.unique(pairs, axis=0, return_inverse=True)
    rows = checked_rows(path, ((int(node), int(axis) - 1) for node, axis in names.tolist()))
    row, column = number.reshape(-1, 2).T
    return LabelledMatrix(path, symmetric(path, row, column, table[:, 4], len(rows)), rows)
