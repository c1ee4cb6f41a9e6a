"""Finite element model: stiffness and mass matrices, interpolation and loads at any point."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.linalg
from scipy import sparse

from daq import FloatArray, IndexArray, IntArray
from updater.errors import MechanismError, ModelError
from updater.fe.eigen import Modes, NegativeMassError, lowest_modes
from updater.fe.external.faces import Faces
from updater.fe.mechanism import free_motion
from updater.fe.mesh import COINCIDENT, SpanIndex
from updater.structure import AXES, Axis, Body, Joint, Structure, sensor_axes

Spring = tuple[str, tuple[float, float, float], Axis]  #: member of a joint, none of a support's; place; axis


class Interpolation(Protocol):
    """Interpolation between two nodes: displacements along the element."""

    @property
    def length(self) -> float:
        """Length [m]."""

    def axes(self, direction: FloatArray) -> FloatArray:
        """Return local axes (3, 3)."""

    def displacement(self, xi: FloatArray) -> FloatArray:
        """Return N (n, 6, 12) at shares xi (n,) of the length."""


@dataclass(frozen=True)
class AtNode:
    """Node whose own DOFs are read."""

    length: float = 0.0

    def axes(self, direction: FloatArray) -> FloatArray:
        """Return the global axes: no direction is meant."""
        del direction
        return np.eye(3)

    def displacement(self, xi: FloatArray) -> FloatArray:
        """Return the first of both nodes."""
        return np.eye(6, 12) * (1 - xi[:, None, None])


@dataclass(frozen=True, eq=False, kw_only=True)
class Model:
    """Stiffness, mass and the table of nodes and directions of the rows."""

    structure: Structure
    nodes: FloatArray  #: (n_nodes, 3) [m]
    dofs: IntArray  #: (n_nodes, 6) row of each node's DOF, -1 where it is held
    elements: tuple[tuple[int, int, Interpolation], ...]  #: start node, end node, constants
    member_names: tuple[str, ...]  #: member that each element belongs to
    stiffness: sparse.csc_array  #: (n_dofs, n_dofs)
    mass: sparse.csc_array  #: (n_dofs, n_dofs)
    twins: tuple[tuple[int, int, Joint], ...] = ()  #: node, its twin on the jointed member, the springs between
    loose: tuple[int, ...] = ()  #: nodes on no member
    #: parts of the stiffness of external matrices by name, each (n_dofs, n_dofs)
    groups: Mapping[str, sparse.csc_array] = field(default_factory=dict)
    faces: Faces | None = None  #: of external matrices, on which points may be that are on no member

    @property
    def n_dofs(self) -> int:
        """Number of free DOFs."""
        return int(self.stiffness.shape[0])

    @cached_property
    def elements_of(self) -> Mapping[str, Sequence[int]]:
        """Numbers of the elements of each member, by its name."""
        found = defaultdict(list)
        for i, name in enumerate(self.member_names):
            found[name].append(i)
        return found

    @cached_property
    def _readable(self) -> tuple[tuple[int, int, Interpolation], ...]:
        """Elements, and after them the nodes on no member."""
        return (*self.elements, *((node, node, AtNode()) for node in self.loose))

    def modes(self, n: int) -> Modes:
        """Return the lowest `n` modes; a semidefinite mass matrix is fine, and bodies that were taken off.

        They are solved for once, and not to be changed.

        Raises
        ------
        MechanismError
            If the structure is a mechanism or free; the message states the motion.
        ModelError
            If it buckles under its preload, has fewer modes, or a body takes off more mass than moves; names the body.
        """
        if n not in self._solved:
            self._solved[n] = self._lowest_modes(n)
        return self._solved[n]

    def mesh_error(self, shape: FloatArray) -> FloatArray:
        """Return the relative error of frequencies by the mesh of faces, (n_modes,) of shapes (n_dofs, n_modes).

        It is zero without faces: members are cubic, and an error of theirs is in the cause `mesh_error`.
        """
        if self.faces is None:
            return np.zeros(shape.shape[1])
        return self.faces.mesh_error(self.dofs, shape)

    @cached_property
    def _solved(self) -> dict[int, Modes]:
        """Modes by their number."""
        return {}

    def _lowest_modes(self, n: int) -> Modes:
        removed = [body for body in self.structure.body if body.mass < 0]
        try:
            return lowest_modes(self.stiffness, self.mass, n, self.structure.name, removed=bool(removed))
        except NegativeMassError as error:
            shape = error.shape
            moved = [self.read(np.asarray(body.at)) @ shape for body in removed]
            energy = [float(m @ body_mass(body) @ m) for m, body in zip(moved, removed, strict=True)]
            worst = removed[int(np.argmin(energy))]
            raise ModelError(
                f"{self.structure.name}: body at {list(worst.at)}: its mass of {worst.mass:g} kg takes off more than "
                "the structure moves there"
            ) from error
        except MechanismError as error:
            moves = free_motion(self.nodes, self.dofs, self.stiffness)
            raise MechanismError("; ".join([str(error), *moves.texts(self._at)])) from error

    def _at(self, node: int) -> str:
        """Return the members that have a node, and where it is."""
        names = {name for name, (a, b) in zip(self.member_names, self.spans, strict=True) if node in (a, b)}
        return f"{' and '.join(sorted(names)) or 'what no member names'} at {np.round(self.nodes[node], 4).tolist()}"

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
        rows = self.reader(np.asarray(point, float)[None]).toarray()
        return rows if axis is None else rows[axis]

    def reader(self, points: FloatArray) -> sparse.csr_array:
        """Return a function that reads displacements and rotations at many points on members, as `read` at one.

        Parameters
        ----------
        points : (n, 3) [m]

        Returns
        -------
        (6 n, n_dofs) sparse array, six rows a point

        Raises
        ------
        ModelError
            If a point lies on no member and no face.
        """
        points = np.asarray(points, float).reshape(-1, 3)
        if self.faces is None:
            return self._on_spans(*self._index.locate(points))
        found, xi, others = self._index.nearest(points)
        if not len(others):
            return self._on_spans(found, xi)
        order = np.argsort(np.concatenate([np.setdiff1d(np.arange(len(points)), others), others]))
        rows = sparse.vstack([self._on_spans(found, xi), self.faces.reader(points[others], self.dofs, self.n_dofs)])
        return sparse.csr_array(rows)[(6 * order[:, None] + np.arange(6)).ravel()]

    def _on_spans(self, found: IndexArray, xi: FloatArray) -> sparse.csr_array:
        """Return the rows (6 n, n_dofs) that read points at shares xi (n,) of the lengths of spans found (n,)."""
        local, axes = np.empty((len(found), 6, 12)), np.empty((len(found), 3, 3))
        for element, direction, here in self._by_kind(found):
            local[here], axes[here] = element.displacement(xi[here]), element.axes(direction)
        blocks = local.reshape(-1, 2, 3, 4, 3)
        block = np.asarray(np.einsum("nax,npacb,nby->npxcy", axes, blocks, axes, optimize=True).reshape(-1, 6, 12))
        dofs = np.concatenate([self.dofs[self._index.first[found]], self.dofs[self._index.last[found]]], axis=1)
        row = np.broadcast_to(np.arange(6 * len(found)).reshape(-1, 6, 1), block.shape)
        column = np.broadcast_to(dofs[:, None, :], block.shape)
        keep = (column >= 0) & (block != 0)
        return sparse.csr_array((block[keep], (row[keep], column[keep])), shape=(6 * len(found), self.n_dofs))

    def _by_kind(self, spans: IndexArray) -> Iterator[tuple[Interpolation, FloatArray, IndexArray]]:
        """Yield elements (n,) kind by kind: one of the kind, its direction (3,), which of them are of it."""
        places: defaultdict[int, list[int]] = defaultdict(list)
        for i, span in enumerate(spans.tolist()):
            places[id(self._readable[span][2])].append(i)
        for here in places.values():
            first, last, element = self._readable[spans[here[0]]]
            yield element, self.nodes[last] - self.nodes[first], np.array(here)

    @cached_property
    def _index(self) -> SpanIndex:
        ends = np.array([span[:2] for span in self._readable], np.intp)
        return SpanIndex(self.nodes, ends[:, 0], ends[:, 1])

    @property
    def spans(self) -> list[tuple[int, int]]:
        """Start and end node of each element, member by member."""
        return [(start, end) for start, end, _ in self.elements]

    @cached_property
    def sensor_rows(self) -> FloatArray:
        """Rows (n_sensors, n_dofs) that read the structure's sensors."""
        return self._read_along(np.array([sensor_axes(s.direction)[0] for s in self.structure.sensor]))

    @cached_property
    def cross_rows(self) -> FloatArray:
        """Rows (2, n_sensors, n_dofs) that read the two axes across each sensor with its gain."""
        axes = np.array([sensor_axes(s.direction)[1:] for s in self.structure.sensor]).reshape(-1, 2, 3)
        return np.array([self._read_along(axes[:, k]) for k in range(2)])

    @cached_property
    def offset_rows(self) -> FloatArray:
        """Rows (3, n_sensors, n_dofs) of the change of the sensors per metre of offset along each global axis."""
        way = np.array([sensor_axes(s.direction)[0] for s in self.structure.sensor]).reshape(-1, 3)
        return np.array([self._read_along(np.cross(offset, way), first=3) for offset in np.eye(3)])

    def _read_along(self, way: FloatArray, *, first: int = 0) -> FloatArray:
        """Return rows (n_sensors, n_dofs) that read the sensors' places along vectors (n_sensors, 3).

        Parameters
        ----------
        first : 0 for displacements, 3 for rotations
        """
        sensors = self.structure.corrected_sensors
        way = way.reshape(-1, 3) * np.array([s.gain for s in sensors])[:, None]
        try:
            at = self.reader(np.array([s.at for s in sensors], float))
        except ModelError as error:  # matrices from elsewhere have their nodes somewhere else
            raise ModelError(f"a sensor: {error}") from error
        column = 6 * np.arange(len(sensors))[:, None] + first + np.arange(3)
        of_points = sparse.csr_array(
            (way.ravel(), column.ravel(), 3 * np.arange(len(sensors) + 1)), (len(way), at.shape[0])
        )
        return np.asarray((of_points @ at).toarray())

    def node_rows(self, at: tuple[float, float, float], axis: int) -> FloatArray:
        """Return the row (n_dofs,) that reads a node along (0..2) or about (3..5) a global axis; zeros if it is held.

        Raises
        ------
        ModelError
            If there is no node at the point [m].
        """
        near = np.flatnonzero(np.linalg.norm(self.nodes - at, axis=1) < COINCIDENT)
        near = np.setdiff1d(near, [twin for _, twin, _ in self.twins])
        if not len(near):
            raise ModelError(f"support at {list(at)}: no node is there")
        free = (self.dofs[near] >= 0).any(1)  # of two at a grounded spring of external matrices, one is held
        return self._unit(int(self.dofs[near[int(np.argmax(free))], axis]))

    def support_rows(self, at: tuple[float, float, float], axis: Axis) -> FloatArray:
        """Return the row (n_dofs,) that reads how far a support's spring is strained along or about a global axis.

        Raises
        ------
        ModelError
            If there is no node at the point [m].
        """
        row = self.node_rows(at, AXES.index(axis))
        for i, ground in enumerate(self.structure.ground):
            row -= ground.motion(at)[AXES.index(axis)] * self._unit(self._first_ground + i)
        return row

    @property
    def _first_ground(self) -> int:
        """DOF of the first ground: these follow those of the nodes."""
        return int(self.dofs.max()) + 1

    def joint_rows(self, joint: Joint, axis: int) -> FloatArray:
        """Return the row (n_dofs,) that reads how far a joint's spring is turned about a global axis 0..2."""
        row = np.zeros(self.n_dofs)
        for node, twin, other in self.twins:
            if other == joint:
                row += self._unit(int(self.dofs[twin, 3 + axis])) - self._unit(int(self.dofs[node, 3 + axis]))
        return row

    def spring_rows(self) -> dict[Spring, tuple[FloatArray, float]]:
        """Return the row (n_dofs,) that reads each spring's strain, and its stiffness [N/m or N m/rad]."""
        found = {}
        for support in self.structure.grounded_supports:
            for axis, stiffness in support.stiffness.items():
                found["", support.at, axis] = self.support_rows(support.at, axis), stiffness
        for i, ground in enumerate(self.structure.ground):
            found[f"ground {i}", ground.at[0], ground.axis] = self._unit(self._first_ground + i), ground.stiffness
        for joint in self.structure.joint:
            for turn, stiffness in joint.stiffness.items():
                found[joint.member, joint.at, turn] = self.joint_rows(joint, AXES.index(turn) - 3), stiffness
        return found

    def _unit(self, dof: int) -> FloatArray:
        row = np.zeros(self.n_dofs)
        if dof >= 0:
            row[dof] = 1.0
        return row

    def total_mass(self) -> float:
        """Return the mass that a rigid translation would move [kg], held nodes included where it has members."""
        if self.structure.external is not None:
            return self._moved_mass
        structure = self.structure
        members = sum(
            structure.material[m.material].density * structure.section[m.section].area * m.length
            for m in structure.member
        )
        parts = (self.structure.segment, self.structure.body, self.structure.oscillator)
        return members + float(sum(part.mass for kind in parts for part in kind))

    @cached_property
    def _moved_mass(self) -> float:
        """Mass of the free DOFs, by the translation that moves most of it [kg]."""
        translations = np.zeros((self.n_dofs + 1, 3))  # the last row is that of fixed DOFs, and is cut off
        for axis in range(3):
            translations[self.dofs[:, axis], axis] = 1
        moved = translations[:-1]
        return float((moved * (self.mass @ moved)).sum(0).max())


def body_mass(body: Body) -> FloatArray:
    """Return the mass matrix (6, 6) of a rigid body about the point it is fixed to."""
    x, y, z = body.offset
    arm = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]], float)  # u_centre = u + arm @ rotation
    rigid = np.block([[np.eye(3), arm], [np.zeros((3, 3)), np.eye(3)]])
    own = scipy.linalg.block_diag(body.mass * np.eye(3), np.diag(body.inertia))
    return np.asarray(rigid.T @ own @ rigid)
