"""Matrices of the model that is in OpenSeesPy's domain."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy import sparse

from daq import FloatArray, IntArray
from updater.errors import ModelError
from updater.fe.external.files import Matrices

#: axes 0..5 of a node's DOFs, by the dimensions of the model and the number of DOFs per node
_AXES = {(2, 2): (0, 1), (2, 3): (0, 1, 5), (3, 3): (0, 1, 2), (3, 6): (0, 1, 2, 3, 4, 5)}
_MAX_ROWS = 6000  # of dense matrices that OpenSees prints: over a gigabyte of numbers of Python


def opensees_matrices(ops: Any, groups: Mapping[str, Sequence[int]] | None = None) -> Matrices:  # noqa: ANN401 - a module
    """Return stiffness and mass of OpenSeesPy's domain, with the stiffness of groups of its elements.

    The elements of the groups are removed from the domain, and its analysis is replaced: call it last, or wipe the
    domain afterwards. Fixed DOFs have no rows. DOFs that a constraint ties to a retained node have none either:
    sensors and bodies belong at the retained node.

    Parameters
    ----------
    ops : the module `openseespy.opensees`
    groups : name -> tags of its elements

    Raises
    ------
    ModelError
        If the domain is empty or too large, its nodes have other DOFs than displacements and rotations, a group has an
        element that is not in it, or two groups have the same element.
    """
    known, chosen = set(ops.getEleTags() or []), dict(groups or {})
    group_of: dict[int, str] = {}
    for name, tags in chosen.items():
        for tag in tags:
            if tag not in known:
                raise ModelError(f"group {name}: the domain of OpenSees has no element {tag}")
            if tag in group_of:
                raise ModelError(f"groups {group_of[tag]} and {name} share the element {tag} of OpenSees")
        group_of |= dict.fromkeys(tags, name)
    stiffness = _printed(ops, mass=0, stiffness=1)
    tags, nodes, dofs = _table(ops)
    faces = _faces(ops, {tag: i for i, tag in enumerate(tags)})
    mass = _printed(ops, mass=1, stiffness=0)
    rest, own = stiffness, {}
    for name, tags in chosen.items():
        for tag in tags:
            ops.remove("element", tag)
        less = _printed(ops, mass=0, stiffness=1)
        own[name] = sparse.csc_array(rest - less)
        rest = less
    return Matrices(stiffness=stiffness, mass=mass, nodes=nodes, dofs=dofs, groups=own, faces=faces)


def _printed(ops: Any, *, mass: float, stiffness: float) -> sparse.csc_array:  # noqa: ANN401
    """Return a matrix (n, n) as the integrator GimmeMCK assembles it."""
    ops.wipeAnalysis()
    ops.constraints("Transformation")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.algorithm("Linear")
    ops.integrator("GimmeMCK", mass, 0.0, stiffness)
    ops.analysis("Transient")
    ops.initialize()  # numbers the DOFs; the matrix is assembled when it is printed
    n = int(ops.systemSize())
    if not 0 < n <= _MAX_ROWS:
        raise ModelError(f"the domain of OpenSees: expected 1 to {_MAX_ROWS} free DOFs, found {n}")
    matrix = np.array(ops.printA("-ret"), float).reshape(n, n)
    return sparse.csc_array((matrix + matrix.T) / 2)


def _faces(ops: Any, number: Mapping[int, int]) -> IntArray:  # noqa: ANN401
    """Return the corners (n_faces, 4) of elements of three or four nodes that have six DOFs each."""
    every = [ops.eleNodes(tag) for tag in ops.getEleTags() or []]
    shells = [nodes for nodes in every if len(nodes) in (3, 4) and all(ops.getNDF(node)[0] == 6 for node in nodes)]
    found = [[*(number[node] for node in nodes), -1][:4] for nodes in shells]
    return np.array(found, np.int32).reshape(-1, 4)


def _table(ops: Any) -> tuple[list[int], FloatArray, IntArray]:  # noqa: ANN401
    """Return tags and positions of nodes (n_nodes, 3), and the rows of their DOFs (n_nodes, 6)."""
    tied = set(ops.getConstrainedNodes() or [])
    tags, nodes, dofs = ops.getNodeTags(), [], []
    for tag in tags:
        place, rows = ops.nodeCoord(tag), ops.nodeDOFs(tag)
        axes = _AXES.get((len(place), ops.getNDF(tag)[0]))
        if axes is None:
            raise ModelError(
                f"node {tag} of OpenSees: expected displacements and rotations, found {ops.getNDF(tag)[0]} DOFs"
            )
        if tag in tied:  # its own DOFs are listed first, then those of the retained node
            held = {k - 1 for k in ops.getConstrainedDOFs(tag)}
            axes = tuple(axis for k, axis in enumerate(axes) if k not in held)
        own = np.full(6, -1, np.int32)
        own[list(axes)] = rows[: len(axes)]
        nodes.append([*place, 0.0][:3])
        dofs.append(own)
    return tags, np.array(nodes, float).reshape(-1, 3), np.array(dofs, np.int32).reshape(-1, 6)
