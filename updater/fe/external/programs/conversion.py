"""Files of another finite element program as matrices with a DOF table, groups and faces."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy import sparse

from daq import FloatArray
from updater.errors import StructureError
from updater.fe.external.files import Matrices
from updater.fe.external.programs.formats import read_labelled
from updater.fe.external.programs.meshes import read_mesh
from updater.fe.external.programs.numbers import LabelledMatrix

_FIXED = 1e30  # stiffness on the diagonal from which a DOF is fixed: Abaqus writes 1e36
_MILLIMETRE = 1e-3  # m


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

    Rows of fixed DOFs, and rows without stiffness and mass, are left out.

    Raises
    ------
    StructureError
        Naming the file and the node or row.
    """
    mesh = read_mesh(files.nodes)
    known = sorted(mesh.nodes)
    whole = read_labelled(files.stiffness, files.rows, known)
    mass = _like(read_labelled(files.mass, files.rows, known, files.stiffness, initial="M"), whole)
    parts = {**files.groups, **files.doubled}
    read = {name: read_labelled(path, files.rows, known, files.stiffness) for name, path in parts.items()}
    own = {name: _like(matrix, whole) for name, matrix in read.items()}
    own = {name: matrix - whole.matrix if name in files.doubled else matrix for name, matrix in own.items()}
    diagonal, moved = whole.matrix.diagonal(), mass.diagonal()
    inside = np.array([node in mesh.nodes for node, _ in whole.rows])
    used = (diagonal < _FIXED) & ((diagonal != 0) | (moved != 0))
    lost = np.flatnonzero(used & ~inside)
    if len(lost):
        node = whole.rows[lost[0]][0]
        raise StructureError(files.nodes, f"node {node} has rows in {files.stiffness.name}, and no position")
    kept = np.flatnonzero(used)
    if not len(kept):
        raise StructureError(files.stiffness, "no row has stiffness")
    rows = [whole.rows[i] for i in kept.tolist()]
    turning = np.array([axis >= 3 for _, axis in rows])  # 1 N/mm is 1000 N/m, 1 N mm is 0.001 N m, 1 t is 1000 kg
    scale = np.where(turning, _MILLIMETRE**0.5, _MILLIMETRE**-0.5) if files.millimetres else np.ones(len(rows))
    number = {node: i for i, node in enumerate(known)}
    dofs = np.full((len(known), 6), -1, np.int32)
    for row, i in enumerate(kept.tolist()):
        node, axis = whole.rows[i]
        dofs[number[node], axis] = row
    nodes = np.array([mesh.nodes[node] for node in known]) * (_MILLIMETRE if files.millimetres else 1.0)
    return Matrices(
        stiffness=_scaled(whole.matrix[kept][:, kept], scale),
        mass=_scaled(mass[kept][:, kept], scale),
        nodes=nodes,
        dofs=dofs,
        groups={name: _scaled(part[kept][:, kept], scale) for name, part in own.items()},
        faces=mesh.faces(number),
    )


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
