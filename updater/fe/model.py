"""A structure as stiffness and mass matrices, with what is needed to read and load it at any point."""

import itertools
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import scipy.linalg
from scipy import sparse
from scipy.sparse.linalg import eigsh

from daq import FloatArray, IntArray
from updater.errors import ModelError
from updater.fe.element import Element, local_axes
from updater.structure import AXES, Body, Joint, Member, Structure

MassKind = Literal["lumped", "consistent"]
_COINCIDENT = 1e-6  # m: points nearer than this are the same node
_FREE = 1e-14  # relative strain energy that is rounding: a bending mode's is about (element / member length)^4
_DENSE = 60  # DOFs up to which all modes are solved for at once
_MASSLESS = 1e-13  # least omega^-2 over the largest of a mode with inertia


@dataclass(frozen=True, eq=False, kw_only=True)
class Modes:
    """Undamped modes of a model."""

    frequency: FloatArray  #: (n_modes,) [Hz], ascending
    shape: FloatArray  #: (n_dofs, n_modes) mass-normalised [1/sqrt(kg)]

    @property
    def omega(self) -> FloatArray:
        """Angular frequencies (n_modes,) [rad/s]."""
        return 2 * np.pi * self.frequency


@dataclass(frozen=True, eq=False, kw_only=True)
class Model:
    """Stiffness, mass and the table that says which row is which node and direction."""

    structure: Structure
    nodes: FloatArray  #: (n_nodes, 3) [m]
    dofs: IntArray  #: (n_nodes, 6) row of each node's DOF, -1 where it is held
    elements: tuple[tuple[int, int, Element], ...]  #: start node, end node, constants
    member_names: tuple[str, ...]  #: member that each element belongs to
    stiffness: sparse.csc_array  #: (n_dofs, n_dofs)
    mass: sparse.csc_array  #: (n_dofs, n_dofs)
    twins: tuple[tuple[int, int, Joint], ...] = ()  #: node, its twin on the jointed member, the springs between

    @property
    def n_dofs(self) -> int:
        """Number of free DOFs."""
        return int(self.stiffness.shape[0])

    def modes(self, n: int) -> Modes:
        """Return the lowest `n` modes; a semidefinite mass matrix is fine.

        Raises
        ------
        ModelError
            If the structure is a mechanism or stands free, so that its stiffness is singular, or has fewer modes.
        """
        few = self.n_dofs <= max(6 * n, _DENSE)
        try:
            value, vector = self._dense_modes() if few else self._lowest_modes(n)
        except (RuntimeError, np.linalg.LinAlgError) as error:
            raise ModelError(
                f"{self.structure.name}: the stiffness is singular: a support or a member is missing"
            ) from error
        if value[0] <= 0 or self._strain(vector[:, 0]) <= _FREE:
            raise ModelError(f"{self.structure.name}: it can move without deforming: a support is missing")
        if len(value) < n:
            raise ModelError(f"{self.structure.name}: expected {n} modes, found {len(value)}: the mesh is too coarse")
        return Modes(frequency=np.sqrt(value[:n]) / (2 * np.pi), shape=_signed(vector[:, :n]))

    def _strain(self, shape: FloatArray) -> float:
        """Return a shape's strain energy over what it would be if every DOF moved alone [-]."""
        return float(shape @ (self.stiffness @ shape) / (self.stiffness.diagonal() @ shape**2))

    def _lowest_modes(self, n: int) -> tuple[FloatArray, FloatArray]:
        """Return omega^2 (n,), ascending, and shapes by shift-invert Lanczos about zero."""
        value, vector = eigsh(self.stiffness, n, self.mass, sigma=0.0, v0=np.ones(self.n_dofs))
        order = np.argsort(value)
        return value[order], vector[:, order]

    def _dense_modes(self) -> tuple[FloatArray, FloatArray]:
        """Return omega^2 and shapes of all modes that have inertia, by M b = omega^-2 K b."""
        inverse, vector = scipy.linalg.eigh(self.mass.toarray(), self.stiffness.toarray())
        inert = np.flatnonzero(inverse > _MASSLESS * inverse[-1])[::-1]
        # orthonormal in M to rounding, which division by the smallest omega^-2 is not: then M^-1 = sum b b^T exactly
        gram = vector[:, inert].T @ (self.mass @ vector[:, inert]) / np.sqrt(np.outer(inverse[inert], inverse[inert]))
        root = np.linalg.cholesky(gram)
        return 1 / inverse[inert], scipy.linalg.solve_triangular(
            root, (vector[:, inert] / np.sqrt(inverse[inert])).T, lower=True
        ).T

    def read(self, point: FloatArray, axis: int | None = None) -> FloatArray:
        """Return the rows that read displacements at a point on a member, through the element's shape functions.

        Parameters
        ----------
        point : (3,) array [m]
        axis : global axis 0..5 (x y z rx ry rz), or None for all six

        Returns
        -------
        (6, n_dofs) array, or (n_dofs,) for one axis

        Raises
        ------
        ModelError
            If the point lies on no member.
        """
        start, end, element, xi = self._locate(np.asarray(point, float))
        turn = np.kron(np.eye(4), local_axes(self.nodes[end] - self.nodes[start]))
        local = turn[:6, :6].T @ element.displacement(xi) @ turn
        rows = np.zeros((6, self.n_dofs + 1))  # the last column takes what is held, and is cut off
        rows[:, np.r_[self.dofs[start], self.dofs[end]]] = local
        return rows[:, :-1] if axis is None else rows[axis, :-1]

    def _locate(self, point: FloatArray) -> tuple[int, int, Element, float]:
        first, last, lengths = self._spans
        ends, along = self.nodes[first], self.nodes[last] - self.nodes[first]
        xi = np.clip(np.einsum("ij,ij->i", point - ends, along) / lengths**2, 0, 1)
        distance = np.linalg.norm(point - ends - xi[:, None] * along, axis=1)
        best = int(np.argmin(distance))
        if distance[best] > 1e-4:
            raise ModelError(f"the point {point.tolist()} lies on no member ({distance[best]:.3g} m off)")
        return int(first[best]), int(last[best]), self.elements[best][2], float(xi[best])

    @cached_property
    def _spans(self) -> tuple[IntArray, IntArray, FloatArray]:
        first = np.array([a for a, _, _ in self.elements], np.int32)
        last = np.array([b for _, b, _ in self.elements], np.int32)
        return first, last, np.linalg.norm(self.nodes[last] - self.nodes[first], axis=1)

    @property
    def spans(self) -> list[tuple[int, int]]:
        """Start and end node of each element, member by member."""
        return [(start, end) for start, end, _ in self.elements]

    @cached_property
    def sensor_rows(self) -> FloatArray:
        """Rows (n_sensors, n_dofs) that read the structure's sensors."""
        return np.array(
            [
                s.gain * np.asarray(s.direction) / np.linalg.norm(s.direction) @ self.read(np.asarray(s.at))[:3]
                for s in self.structure.sensor
            ]
        ).reshape(-1, self.n_dofs)

    def turn_rows(self, at: tuple[float, float, float], axis: int) -> FloatArray:
        """Return the row (n_dofs,) that reads the rotation of a node about a global axis 0..2; zeros if it is held.

        Raises
        ------
        ModelError
            If there is no node at the point [m].
        """
        near = np.flatnonzero(np.linalg.norm(self.nodes - at, axis=1) < _COINCIDENT)
        if not len(near):
            raise ModelError(f"support at {list(at)}: no node is there")
        return self._unit(int(self.dofs[near[0], 3 + axis]))

    def joint_rows(self, joint: Joint, axis: int) -> FloatArray:
        """Return the row (n_dofs,) that reads how far a joint's spring is turned about a global axis 0..2."""
        row = np.zeros(self.n_dofs)
        for node, twin, other in self.twins:
            if other == joint:
                row += self._unit(int(self.dofs[twin, 3 + axis])) - self._unit(int(self.dofs[node, 3 + axis]))
        return row

    def _unit(self, dof: int) -> FloatArray:
        row = np.zeros(self.n_dofs)
        if dof >= 0:
            row[dof] = 1.0
        return row

    def total_mass(self) -> float:
        """Return the mass that a rigid translation along x would move, held nodes included [kg]."""
        members = sum(_member_mass(self.structure, m) for m in self.structure.member)
        return members + sum(body.mass for body in self.structure.body)


def _member_mass(structure: Structure, member: Member) -> float:
    return structure.material[member.material].density * structure.section[member.section].area * member.length


def _signed(shape: FloatArray) -> FloatArray:
    """Turn each mode so that its largest entry is positive: the same on every machine."""
    peak = shape[np.argmax(np.abs(shape), axis=0), np.arange(shape.shape[1])]
    return np.asarray(shape * np.sign(peak))


class _Mesh:
    """Nodes and DOF numbers while a model is being built."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.nodes: list[FloatArray] = []
        self.twins: list[tuple[int, int, Joint]] = []  # node, its twin on the jointed member, the springs
        self.spans: list[tuple[int, int, Member]] = []
        for member in structure.member:
            self._add(member)

    def _add(self, member: Member) -> None:
        line = [self._node(p, member) for p in self._stations(member)]
        self.spans += [(a, b, member) for a, b in itertools.pairwise(line)]

    def _stations(self, member: Member) -> FloatArray:
        """Nodes of one member, with one wherever another member ends on it or a joint, support stands."""
        even = np.linspace(0, member.length, member.elements + 1)
        axis = np.subtract(member.end, member.start) / member.length
        marked = [p for m in self.structure.member if m is not member for p in (m.start, m.end)]
        marked += [support.at for support in self.structure.support] + [joint.at for joint in self.structure.joint]
        for point in marked:
            s = float(np.dot(np.subtract(point, member.start), axis))
            off = np.linalg.norm(np.subtract(point, member.point(s)))
            if (
                off < _COINCIDENT
                and -_COINCIDENT < s < member.length + _COINCIDENT
                and np.abs(even - s).min() > _COINCIDENT
            ):
                even = np.sort(np.append(even, s))
        return member.point(even)

    def _node(self, point: FloatArray, member: Member) -> int:
        plain = [i for i in self._near(point) if i not in {twin for _, twin, _ in self.twins}]
        if not plain:
            self.nodes.append(point)
            plain = [len(self.nodes) - 1]
        own = (j for j in self.structure.joint if j.member == member.name)
        joint = next((j for j in own if np.linalg.norm(np.subtract(j.at, point)) < _COINCIDENT), None)
        if joint is None:
            return plain[0]
        twins = [twin for node, twin, other in self.twins if node == plain[0] and other is joint]
        if not twins:
            self.nodes.append(point)
            self.twins.append((plain[0], len(self.nodes) - 1, joint))
            twins = [len(self.nodes) - 1]
        return twins[0]

    def _near(self, point: FloatArray) -> list[int]:
        """Return the nodes at a point, first made first."""
        if not self.nodes:
            return []
        return list(np.flatnonzero(np.linalg.norm(np.array(self.nodes) - point, axis=1) < _COINCIDENT))

    def find(self, at: tuple[float, float, float], what: str) -> int:
        near = self._near(np.asarray(at))
        if not near:
            raise ModelError(f"{what} at {list(at)}: no member passes there")
        return int(near[0])

    def number(self) -> IntArray:
        """Return the DOFs' numbers: held ones -1, twins share what their joint leaves rigid."""
        free = np.ones((len(self.nodes), 6), bool)
        for support in self.structure.support:
            free[self.find(support.at, "support"), [AXES.index(a) for a in support.fixed]] = False
        for _, twin, joint in self.twins:
            free[twin] = [axis in joint.stiffness for axis in AXES]
        dofs = np.full(free.shape, -1, np.int32)
        dofs[free] = np.arange(free.sum())
        for node, twin, _ in self.twins:
            dofs[twin] = np.where(free[twin], dofs[twin], dofs[node])
        return dofs


class _Matrix:
    """A sparse symmetric matrix gathered from small blocks."""

    def __init__(self) -> None:
        self.rows: list[IntArray] = []
        self.columns: list[IntArray] = []
        self.values: list[FloatArray] = []

    def add(self, dofs: IntArray, block: FloatArray) -> None:
        keep = np.flatnonzero(dofs >= 0)
        row, column = np.meshgrid(dofs[keep], dofs[keep], indexing="ij")
        self.rows.append(row.ravel())
        self.columns.append(column.ravel())
        self.values.append(block[np.ix_(keep, keep)].ravel())

    def build(self, n: int) -> sparse.csc_array:
        index = (np.concatenate(self.rows), np.concatenate(self.columns))
        return sparse.csc_array((np.concatenate(self.values), index), shape=(n, n))


def build_model(structure: Structure, *, shear_flexible: bool = False, mass: MassKind = "lumped") -> Model:
    """Assemble a model; the defaults are the paper's (Euler-Bernoulli, particle-lumped mass).

    Raises
    ------
    ModelError
        If a support, joint or body does not lie on a member.
    """
    mesh = _Mesh(structure)
    dofs = mesh.number()
    k, m = _Matrix(), _Matrix()
    elements = tuple(_element(mesh, span, shear_flexible=shear_flexible) for span in mesh.spans)
    alike: dict[tuple[str, float], tuple[FloatArray, FloatArray]] = {}  # elements of a member share their matrices
    for (start, end, element), (_, _, member) in zip(elements, mesh.spans, strict=True):
        key = member.name, round(element.length, 12)
        if key not in alike:
            alike[key] = _global_matrices(element, mesh.nodes[end] - mesh.nodes[start], mass)
        rows = np.r_[dofs[start], dofs[end]]
        k.add(rows, alike[key][0])
        m.add(rows, alike[key][1])
    for node, twin, joint in mesh.twins:
        for turn_axis, value in joint.stiffness.items():
            pair = dofs[[node, twin], AXES.index(turn_axis)]
            k.add(pair, value * np.array([[1.0, -1.0], [-1.0, 1.0]]))
    for support in structure.support:
        for axis, value in support.stiffness.items():
            k.add(dofs[[mesh.find(support.at, "support")], AXES.index(axis)], np.array([[value]]))
    n = int(dofs.max()) + 1
    bare = Model(
        structure=structure,
        nodes=np.array(mesh.nodes),
        dofs=dofs,
        elements=elements,
        member_names=tuple(member.name for _, _, member in mesh.spans),
        stiffness=k.build(n),
        mass=m.build(n),
        twins=tuple(mesh.twins),
    )
    return _with_bodies(bare) if structure.body else bare


def _element(mesh: _Mesh, span: tuple[int, int, Member], *, shear_flexible: bool) -> tuple[int, int, Element]:
    start, end, member = span
    length = float(np.linalg.norm(mesh.nodes[end] - mesh.nodes[start]))
    material, section = mesh.structure.material[member.material], mesh.structure.section[member.section]
    return start, end, Element(length, material, section, shear_flexible)


def _global_matrices(element: Element, direction: FloatArray, mass: MassKind) -> tuple[FloatArray, FloatArray]:
    turn = np.kron(np.eye(4), local_axes(direction))
    local = element.consistent_mass() if mass == "consistent" else element.lumped_mass()
    return turn.T @ element.stiffness() @ turn, turn.T @ local @ turn


def body_mass(body: Body) -> FloatArray:
    """Return the mass matrix (6, 6) of a rigid body about the point it is fixed to."""
    x, y, z = body.offset
    arm = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]], float)  # u_centre = u + arm @ rotation
    rigid = np.block([[np.eye(3), arm], [np.zeros((3, 3)), np.eye(3)]])
    own = scipy.linalg.block_diag(body.mass * np.eye(3), np.diag(body.inertia))
    return np.asarray(rigid.T @ own @ rigid)


def _with_bodies(model: Model) -> Model:
    mass = model.mass
    for body in model.structure.body:
        rows = sparse.csc_array(model.read(np.asarray(body.at)))
        mass = mass + rows.T @ sparse.csc_array(body_mass(body)) @ rows
    return replace(model, mass=sparse.csc_array(mass))
