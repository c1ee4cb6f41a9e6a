"""Rotations of a frame that a stiffness resists: of element ends and of springs.

Rotations are for flexibility what particles are for mass: in a frame without redundant members, the flexibility of a
hinge, f_j = (R K^-1 R^T)_jj, is that of its own element or spring alone, L / (E I), L / (G J) or 1 / k. With redundant
members it is less, because the others contribute.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from daq import FloatArray, IndexArray, IntArray
from updater.errors import ModelError
from updater.fe.factorization import factorise
from updater.fe.model import Model
from updater.structure import AXES

_TURNS = AXES[3:]
_MAX_ELEMENTS = 1000  # largest number of elements with hinges; of more every n-th, between which increments are smooth
_BLOCK = 256  # hinges whose flexibility is computed together


@dataclass(frozen=True, eq=False, kw_only=True)
class Hinges:
    """Relative rotations of a model, elements first."""

    name: tuple[str, ...]  #: (n,) of the member; `foot 0`, `joint of ..` for a spring
    position: FloatArray  #: (n, 3) an element's middle, a spring's node [m]
    axis: IndexArray  #: (n,) of elements 0 twist, 1 and 2 bending about the local y and z; of springs the global axis
    rows: sparse.csr_array  #: (n, n_dofs) rows that give their rotation [rad]


def hinges_of(model: Model) -> Hinges:
    """Return the hinges of all elements and rotational springs that are free to turn.

    Raises
    ------
    ModelError
        If there is none: the nodes of a model have no rotations.
    """
    found = [*_of_elements(model), *_of_supports(model), *_of_joints(model)]
    rows = sparse.csr_array(sparse.vstack([row for _, _, _, row in found]))
    turning = np.flatnonzero(abs(rows).sum(1) > 0)
    if not len(turning):
        raise ModelError(f"{model.structure.name}: no node can turn, so that no element's bending can be read")
    return Hinges(
        name=tuple(found[i][0] for i in turning),
        position=np.array([found[i][1] for i in turning]),
        axis=np.array([found[i][2] for i in turning], np.intp),
        rows=rows[turning],
    )


_Hinge = tuple[str, FloatArray, int, sparse.csr_array]


def _of_elements(model: Model) -> list[_Hinge]:
    found = []
    every = -(-len(model.elements) // _MAX_ELEMENTS)
    for name, (first, last, element) in list(zip(model.member_names, model.elements, strict=True))[::every]:
        middle = model.nodes[[first, last]].mean(0)
        axes = element.axes(model.nodes[last] - model.nodes[first])
        dofs = np.concatenate([model.dofs[last, 3:], model.dofs[first, 3:]])
        free = np.flatnonzero(dofs >= 0)
        turn = np.concatenate([axes, -axes], axis=1)[:, free]
        found += [(name, middle, axis, _row(model, dofs[free], turn[axis])) for axis in range(3)]
    return found


def _row(model: Model, dofs: IntArray, values: FloatArray) -> sparse.csr_array:
    return sparse.csr_array((values, (np.zeros(len(dofs), np.intp), dofs)), shape=(1, model.n_dofs))


def _of_supports(model: Model) -> list[_Hinge]:
    return [
        (f"foot {i}", np.array(support.at), axis, sparse.csr_array(model.node_rows(support.at, 3 + axis)[None]))
        for i, support in enumerate(model.structure.support)
        for axis, name in enumerate(_TURNS)
        if name in support.stiffness
    ]


def _of_joints(model: Model) -> list[_Hinge]:
    return [
        (f"joint of {joint.member}", np.array(joint.at), axis, sparse.csr_array(model.joint_rows(joint, axis)[None]))
        for joint in model.structure.joint
        for axis, name in enumerate(_TURNS)
        if name in joint.stiffness
    ]


def flexibility(model: Model, rows: sparse.csr_array) -> FloatArray:
    """Return the diagonal (n,) of R K^-1 R^T, by one factorisation of the stiffness matrix K.

    Parameters
    ----------
    model : with the stiffness matrix [N/m, N m/rad]
    rows : (n, n_dofs) R, each row a displacement [m] or rotation [rad]; the result is in m/N or rad/(N m)
    """
    solve = factorise(model.stiffness)
    blocks = (rows[i : i + _BLOCK].toarray() for i in range(0, len(rows.indptr) - 1, _BLOCK))
    return np.concatenate([(right * solve(right.T).T).sum(1) for right in blocks])
