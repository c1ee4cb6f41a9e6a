"""A model of matrices that another program made, read and loaded along straight lines of their nodes.

The element behind a line is not known. Between two nodes with rotations displacements are Hermite's cubics, the exact
ones of a slender beam; between nodes without, they are linear, and so exact to second order in the nodes' distance.
"""

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.spatial import KDTree

from daq import FloatArray, IndexArray, IntArray
from updater.errors import ModelError, StructureError
from updater.fe.external.faces import Faces
from updater.fe.external.files import Matrices, check_part, read_group, read_matrices
from updater.fe.model import Model
from updater.structure import AXES, ON_MEMBER, External, Member, Structure, Support, local_axes

_POINTS = 21  # of a member without nodes at its ends, which must be on faces
BoolArray = npt.NDArray[np.bool_]
_WHOLE = 1e-6  # relative: error of truncated digits in a text file
_NONE = 1e-12  # of the largest stiffness


@dataclass(frozen=True)
class Line:
    """Line between two nodes."""

    length: float  #: [m]
    turns: bool  #: whether its nodes have rotations

    def axes(self, direction: FloatArray) -> FloatArray:
        """Return (3, 3), rows = local x, y, z; about the line no axis is singled out."""
        return local_axes(direction)

    def displacement(self, xi: FloatArray) -> FloatArray:
        """Return N (n, 6, 12): displacements and rotations at x = xi L from the DOFs of the ends."""
        n = np.zeros((len(xi), 6, 12))
        n[:, 0, 0] = n[:, 3, 3] = 1 - xi
        n[:, 0, 6] = n[:, 3, 9] = xi
        for v, turn, sign in ((1, 5, 1.0), (2, 4, -1.0)):  # w falls as ry grows
            columns = [v, turn, 6 + v, 6 + turn]
            n[:, v, columns] = self._value(xi).T * np.array([1, sign, 1, sign])
            n[:, turn, columns] = self._slope(xi).T * np.array([sign, 1, sign, 1])
        return n

    def _value(self, x: FloatArray) -> FloatArray:
        nothing = np.zeros(len(x))
        if not self.turns:
            return np.array([1 - x, nothing, x, nothing])
        first, last = (x - 2 * x**2 + x**3) * self.length, (x**3 - x**2) * self.length
        return np.array([1 - 3 * x**2 + 2 * x**3, first, 3 * x**2 - 2 * x**3, last])

    def _slope(self, x: FloatArray) -> FloatArray:
        if not self.turns:
            return np.tile(np.array([[-1.0], [0.0], [1.0], [0.0]]) / self.length, len(x))
        rise = 6 * (x - x**2) / self.length
        return np.array([-rise, 1 - 4 * x + 3 * x**2, rise, 3 * x**2 - 2 * x])


def external_model(structure: Structure, external: External, *, lumped: bool) -> Model:
    """Return the model of a structure's matrices, with the supports that its file adds.

    Parameters
    ----------
    structure : with members that are lines of the matrices' nodes
    external : where the matrices are
    lumped : whether the mass is put in particles

    Raises
    ------
    StructureError
        If the matrices cannot be read or are none of a structure; names file and row.
    ModelError
        If a member or support is not where the matrices have nodes.
    """
    found = read_matrices(external.stiffness, external.mass, external.dofs, external.faces)
    nodes = _with_feet(structure.support, found.nodes)
    dofs = np.vstack([found.dofs, np.full((len(nodes) - len(found.nodes), 6), -1, np.int32)])
    tree = KDTree(nodes)
    faces = Faces(nodes, found.faces) if len(found.faces) else None
    free = np.any(dofs >= 0, axis=1)
    lines = [_line(member, nodes, tree, free, faces) for member in structure.member]
    pairs = [pair for line in lines for pair in itertools.pairwise(line.tolist())]
    mass = _particles(found) if lumped else found.mass
    stiffness, groups = _stiffness(external, found)
    stiffness = stiffness + _springs(structure.support, tree, dofs, found.stiffness.shape[0])
    held = _held(structure.support, tree, dofs)
    kept = np.setdiff1d(np.arange(stiffness.shape[0]), held)
    return Model(
        structure=structure,
        nodes=nodes,
        dofs=_renumbered(dofs, kept),
        elements=_elements(np.array(pairs, np.intp).reshape(-1, 2), nodes, np.any(dofs[:, 3:] >= 0, axis=1)),
        member_names=tuple(m.name for m, line in zip(structure.member, lines, strict=True) for _ in line[1:]),
        stiffness=sparse.csc_array(stiffness[kept][:, kept]),
        mass=sparse.csc_array(mass[kept][:, kept]),
        loose=_loose(lines, free),
        faces=faces,
        groups={name: sparse.csc_array(part[kept][:, kept]) for name, part in groups.items()},
    )


def _loose(lines: list[IndexArray], free: BoolArray) -> tuple[int, ...]:
    """Return the nodes on no member; of two at one point, such as both ends of a spring, the one with rows first."""
    loose = np.setdiff1d(np.arange(len(free)), np.concatenate(lines))
    return (*loose[free[loose]].tolist(), *loose[~free[loose]].tolist())


def _stiffness(external: External, found: Matrices) -> tuple[sparse.csc_array, dict[str, sparse.csc_array]]:
    """Return the stiffness (n, n) with its factors, and that of each group: K = K_rest + sum f_i K_i."""
    whole, groups, diagonal = found.stiffness, {}, np.zeros(found.stiffness.shape[0])
    shared = SharedElements(found.stiffness, found.dofs) if len(external.group) > 1 else None
    for name, group in external.group.items():
        own = read_group(group.stiffness, name, found)
        diagonal += own.diagonal()
        check_part(group.stiffness, f"group {name}, with the groups before it", diagonal, found)
        if shared and (both := shared.with_group(name, own)):
            other, pair = both
            first, second = (found.nodes[node].round(4).tolist() for node in pair)
            raise StructureError(
                group.stiffness,
                f"groups {other} and {name} share elements: both have those between {first} and {second}",
            )
        groups[name] = own * (group.factor * external.factor)
        whole = whole + own * (group.factor - 1)
    return whole * external.factor, groups


def _elements(pairs: IndexArray, nodes: FloatArray, turning: BoolArray) -> tuple[tuple[int, int, Line], ...]:
    """Return the elements between pairs (n, 2) of nodes; equal ones with the same direction are one element."""
    along = nodes[pairs[:, 1]] - nodes[pairs[:, 0]]
    turns = turning[pairs].any(1)
    kinds, which = np.unique(np.column_stack([np.round(along, 9), turns]), axis=0, return_inverse=True)
    lines = [Line(float(np.linalg.norm(kind[:3])), bool(kind[3])) for kind in kinds]
    return tuple((a, b, lines[kind]) for (a, b), kind in zip(pairs.tolist(), which.tolist(), strict=True))


def _with_feet(supports: tuple[Support, ...], nodes: FloatArray) -> FloatArray:
    """Add nodes where something is held that the matrices have no rows for: another program left them out."""
    tree = KDTree(nodes)
    feet = [s.at for s in supports if s.fixed and tree.query(s.at)[0] > ON_MEMBER]
    return np.vstack([nodes, np.array(feet, float).reshape(-1, 3)])


def _line(member: Member, nodes: FloatArray, tree: KDTree, free: BoolArray, faces: Faces | None) -> IndexArray:
    """Return the nodes along a member; none if it has no node at an end and is on faces.

    Of two nodes at one point the one without rows, the grounded end of a spring, is left out.
    """
    near = np.array(tree.query_ball_point(member.point(member.length / 2), member.length / 2 + ON_MEMBER), np.intp)
    away = np.asarray(nodes[near] - member.start)
    along = away @ (np.subtract(member.end, member.start) / member.length)
    on = np.linalg.norm(nodes[near] - member.point(along), axis=1) < ON_MEMBER
    order = np.argsort(along[on])
    line: IndexArray = near[on][order]
    along = along[on][order]
    double = np.flatnonzero(np.diff(along) < ON_MEMBER)
    grounded = np.where(free[line[double]], double + 1, double)
    if free[line[grounded]].any():
        raise ModelError(f"member {member.name}: two of the matrices' nodes lie at {nodes[line[double[0]]].tolist()}")
    line, along = np.delete(line, grounded), np.delete(along, grounded)
    apart = len(line) < 2 or along[0] > ON_MEMBER or along[-1] < member.length - ON_MEMBER
    if apart and faces is not None and faces.on(member.point(np.linspace(0, member.length, _POINTS))):
        return np.empty(0, np.intp)
    if apart:
        raise ModelError(
            f"member {member.name}: the matrices need a node at each end of it, or faces all along it, found "
            f"{len(line)} nodes on it"
        )
    return line


def _node(support: Support, tree: KDTree, dofs: IntArray) -> int:
    """Return the node at a support, one with rows if there is any."""
    near = tree.query_ball_point(support.at, ON_MEMBER, return_sorted=True)
    if not near:
        raise ModelError(f"support at {list(support.at)}: the matrices have no node there")
    return int(near[int(np.argmax((dofs[near] >= 0).any(1)))])


def _held(supports: tuple[Support, ...], tree: KDTree, dofs: IntArray) -> IntArray:
    """Return the rows (n,) of the file."""
    rows = [dofs[_node(s, tree, dofs), AXES.index(axis)] for s in supports for axis in s.fixed]
    return np.array([row for row in rows if row >= 0], np.int32)


def _springs(supports: tuple[Support, ...], tree: KDTree, dofs: IntArray, n: int) -> sparse.csc_array:
    """Return the stiffness (n, n) of the file's springs."""
    diagonal = np.zeros(n)
    for support in supports:
        for axis, value in support.stiffness.items():
            row = dofs[_node(support, tree, dofs), AXES.index(axis)]
            if row < 0:
                raise ModelError(f"support at {list(support.at)}: the matrices have no {axis} there")
            diagonal[row] += value
    return sparse.csc_array(sparse.diags_array(diagonal))


def _renumbered(dofs: IntArray, kept: IndexArray) -> IntArray:
    """Return the DOF table of some rows only."""
    number = np.full(dofs.max() + 2, -1, np.int32)  # the last one is -1's own
    number[kept] = np.arange(len(kept))
    renumbered: IntArray = number[dofs]
    return renumbered


def _particles(found: Matrices) -> sparse.csc_array:
    """Return the mass in particles: the diagonal, scaled to each direction's total (Hinton, Rock & Zienkiewicz 1976).

    Every particle's mass is positive, and a rigid translation moves the mass it did; rotations lose their inertia.
    """
    diagonal, lumped = found.mass.diagonal(), np.zeros(found.mass.shape[0])
    for axis in range(3):
        rows = found.dofs[:, axis][found.dofs[:, axis] >= 0]
        if len(rows):
            lumped[rows] = diagonal[rows] * found.mass[rows][:, rows].sum() / diagonal[rows].sum()
    return sparse.csc_array(sparse.diags_array(lumped))


class SharedElements:
    """Pairs of nodes whose whole stiffness is in one group: if it is in a second one, an element is in both.

    The stiffness between two nodes is a sum over the elements with both nodes. Disjoint groups cannot both have the
    whole of it. Between opposite corners of a quadrilateral, and on a beam, one element has it all. Not found are
    shared elements of which each pair of nodes has further elements, and springs to the ground.
    """

    def __init__(self, stiffness: sparse.csc_array, dofs: IntArray) -> None:
        """Prepare for groups of a stiffness (n_dofs, n_dofs) with the rows of each node (n_nodes, 6)."""
        node, axis = np.nonzero(dofs >= 0)
        ones = np.ones(len(node))
        self._of_node = sparse.csr_array((ones, (dofs[node, axis], node)), shape=(stiffness.shape[0], len(dofs)))
        self._stiffness = stiffness
        self._largest = float(abs(stiffness).max())
        self._all = self._between_nodes(stiffness)
        self._groups: dict[str, sparse.csr_array] = {}

    def with_group(self, name: str, group: sparse.csc_array) -> tuple[str, tuple[int, int]] | None:
        """Add a group (n_dofs, n_dofs); return an earlier group with an element of it and two nodes, None if none."""
        margin = sparse.csr_array(_WHOLE * self._all - self._between_nodes(self._stiffness - group))
        own = sparse.csr_array(margin > 0)
        for other, pairs in self._groups.items():
            first, second = own.multiply(pairs).nonzero()
            if len(first):
                return other, (int(first[0]), int(second[0]))
        self._groups[name] = own
        return None

    def _between_nodes(self, matrix: sparse.csc_array) -> sparse.csr_array:
        """Return the sum of the sizes of entries between two different nodes, (n_nodes, n_nodes), a triangle."""
        sums = sparse.triu(sparse.csr_array(self._of_node.T @ abs(matrix) @ self._of_node), k=1, format="csr")
        sums.data[sums.data <= _NONE * self._largest] = 0.0
        return sparse.csr_array(sums)
