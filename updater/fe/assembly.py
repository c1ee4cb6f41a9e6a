"""Stiffness and mass of a frame, assembled from its elements, springs and bodies."""

from dataclasses import replace
from typing import Literal

import numpy as np
import scipy.linalg
from scipy import sparse

from daq import FloatArray, IntArray
from updater.fe.element import Element
from updater.fe.external.model import external_model
from updater.fe.mesh import Mesh
from updater.fe.model import Model, body_mass
from updater.structure import AXES, Material, Member, Structure, Vector

MassKind = Literal["lumped", "consistent"]


class _Matrix:
    """A sparse symmetric matrix gathered from many equal-sized blocks at a time."""

    def __init__(self) -> None:
        self._rows: list[IntArray] = []
        self._columns: list[IntArray] = []
        self._values: list[FloatArray] = []

    def add(self, dofs: IntArray, blocks: FloatArray) -> None:
        """Add blocks (n, k, k) at rows and columns (n, k); fixed DOFs (-1) are left out.

        Zeros are kept: rows of a node that have one pattern are ordered as one by the solver, which fills less.
        """
        row, column = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
        keep = (row >= 0) & (column >= 0)
        self._rows.append(row[keep])
        self._columns.append(column[keep])
        self._values.append(blocks[keep])

    def build(self, n: int) -> sparse.csc_array:
        index = (np.concatenate(self._rows), np.concatenate(self._columns))
        return sparse.csc_array((np.concatenate(self._values), index), shape=(n, n))


def build_model(structure: Structure, *, shear_flexible: bool = False, mass: MassKind = "lumped") -> Model:
    """Assemble a model; the defaults are the paper's (Euler-Bernoulli, particle-lumped mass).

    Raises
    ------
    ModelError
        If a support, joint or body does not lie on a member.
    StructureError
        If matrices that the structure names cannot be used.
    """
    if structure.external is not None:
        bare = external_model(structure, structure.external, lumped=mass == "lumped")
    else:
        bare = _frame(structure, shear_flexible=shear_flexible, mass=mass)
    whole = _on_grounds(bare) if structure.ground else bare
    whole = _with_bodies(whole) if structure.body else whole
    whole = _with_oscillators(whole) if structure.oscillator else whole
    if structure.recorder is None or structure.recorder.clock == 1:
        return whole
    # stiffness is mass over squared time, and this is the recorder's
    squared = structure.recorder.clock**2
    groups = {name: part * squared for name, part in whole.groups.items()}
    return replace(whole, stiffness=whole.stiffness * squared, groups=groups)


def _frame(structure: Structure, *, shear_flexible: bool, mass: MassKind) -> Model:
    mesh = Mesh(structure.model_copy(update={"support": structure.grounded_supports}))
    dofs = mesh.number()
    kinds = _Kinds(mesh, shear_flexible=shear_flexible, mass=mass)
    rows = np.concatenate([dofs[kinds.first], dofs[kinds.last]], axis=1)
    k, m = _Matrix(), _Matrix()
    k.add(rows, np.array(kinds.stiffness)[kinds.which])
    m.add(rows, np.array(kinds.mass)[kinds.which])
    _add_springs(k, mesh, dofs)
    n = int(dofs.max()) + 1
    return Model(
        structure=structure,
        nodes=mesh.nodes,
        dofs=dofs,
        elements=tuple((a, b, kinds.element[i]) for (a, b, _), i in zip(mesh.spans, kinds.which, strict=True)),
        member_names=tuple(member.name for _, _, member in mesh.spans),
        stiffness=k.build(n),
        mass=m.build(n),
        twins=tuple(mesh.twins),
    )


class _Kinds:
    """Elements of a member share their matrices, as long as they are of a length."""

    def __init__(self, mesh: Mesh, *, shear_flexible: bool, mass: MassKind) -> None:
        self.first = np.array([a for a, _, _ in mesh.spans])
        self.last = np.array([b for _, b, _ in mesh.spans])
        self.element: list[Element] = []
        self.stiffness: list[FloatArray] = []  # of each kind (12, 12), global axes
        self.mass: list[FloatArray] = []
        along = mesh.nodes[self.last] - mesh.nodes[self.first]
        known: dict[tuple[str | float | tuple[float, ...], ...], int] = {}
        self.which = np.empty(len(along), np.intp)  # kind of each span
        for i, ((first, last, member), length) in enumerate(
            zip(mesh.spans, np.linalg.norm(along, axis=1), strict=True)
        ):
            part = _part(mesh, member, (mesh.nodes[first] + mesh.nodes[last]) / 2)
            key = member.name, round(float(length), 12), part[0].density, *part[1:]
            if key not in known:
                known[key] = len(self.element)
                section = mesh.structure.section[member.section]
                shape = section, shear_flexible, member.preload, member.local_y
                element = Element(float(length), part[0], *shape, turning=part[1], stretching=part[2], rotary=part[3])
                self._add(element, along[i], mass)
            self.which[i] = known[key]

    def _add(self, element: Element, direction: FloatArray, mass: MassKind) -> None:
        turn = element.rotation(direction)
        local = element.consistent_mass if mass == "consistent" else element.lumped_mass()
        self.element.append(element)
        self.stiffness.append(turn.T @ element.stiffness @ turn)
        self.mass.append(turn.T @ local @ turn)


def _part(mesh: Mesh, member: Member, point: FloatArray) -> tuple[Material, Vector, tuple[float, float], float]:
    """Return the material of a member at a point on it (3,) [m], and factors on stiffness and rotary inertia."""
    if not mesh.structure.segment:
        return mesh.structure.material[member.material], (1.0, 1.0, 1.0), (1.0, 1.0), 1.0
    return mesh.structure.part_at(member, float(np.linalg.norm(point - member.start)))


def _add_springs(stiffness: _Matrix, mesh: Mesh, dofs: IntArray) -> None:
    """Add the springs of joints and of supports."""
    for node, twin, joint in mesh.twins:
        for axis, value in joint.stiffness.items():
            stiffness.add(dofs[[[node, twin]], AXES.index(axis)], value * np.array([[[1.0, -1.0], [-1.0, 1.0]]]))
    for support in mesh.structure.support:
        for turn_axis, value in support.stiffness.items():
            stiffness.add(dofs[[[mesh.find(support.at, "support")]], AXES.index(turn_axis)], np.array([[[value]]]))


def _on_grounds(model: Model) -> Model:
    """Append a DOF to the model for each ground, and let the springs of its supports end there."""
    grounds = model.structure.ground
    own = np.eye(model.n_dofs + len(grounds))[model.n_dofs :]
    none = sparse.csc_array((len(grounds), len(grounds)))
    stiffness, mass = (sparse.csc_array(sparse.block_diag([part, none])) for part in (model.stiffness, model.mass))
    whole = replace(model, stiffness=stiffness, mass=mass)
    for support in model.structure.grounded_supports:
        motion = np.array([ground.motion(support.at) for ground in grounds])
        for axis, spring in support.stiffness.items():
            moved = motion[:, AXES.index(axis)] @ own
            if moved.any():
                at = np.append(model.node_rows(support.at, AXES.index(axis)), np.zeros(len(grounds)))
                rows = sparse.csr_array(np.array([at, moved]))
                stiffness = stiffness + rows.T @ (spring * np.array([[0.0, -1.0], [-1.0, 1.0]])) @ rows
    spring, heavy = np.array([[ground.stiffness, ground.mass] for ground in grounds]).T
    corner = sparse.csc_array(own.T)
    return replace(
        whole,
        stiffness=sparse.csc_array(stiffness + corner @ sparse.diags_array(spring) @ corner.T),
        mass=sparse.csc_array(mass + corner @ sparse.diags_array(heavy) @ corner.T),
    )


def _with_bodies(model: Model) -> Model:
    bodies = model.structure.body
    rows = model.reader(np.array([body.at for body in bodies]))
    own = sparse.csr_array(scipy.linalg.block_diag(*(body_mass(body) for body in bodies)))
    return replace(model, mass=sparse.csc_array(model.mass + rows.T @ own @ rows))


def _with_oscillators(model: Model) -> Model:
    """Append a DOF to the model for each: its displacement along its direction."""
    parts = model.structure.oscillator
    at = model.reader(np.array([part.at for part in parts]))
    way = np.array([part.direction for part in parts])
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    along = scipy.linalg.block_diag(*(np.append(d, np.zeros(3)) for d in way)) @ at  # (n, n_dofs) of their feet
    mass = np.array([part.mass for part in parts])
    spring = mass * (2 * np.pi * np.array([part.frequency for part in parts])) ** 2
    ways = [np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]) - np.pad(np.outer(d, d), (0, 3)) for d in way]
    riding = sparse.csr_array(scipy.linalg.block_diag(*(m * across for m, across in zip(mass, ways, strict=True))))
    pulled = sparse.csr_array(spring[:, None] * along)
    stiffness = sparse.block_array(
        [[model.stiffness + sparse.csr_array(along).T @ pulled, -pulled.T], [-pulled, sparse.diags_array(spring)]]
    )
    whole = sparse.block_diag([model.mass + at.T @ riding @ at, sparse.diags_array(mass)])
    none = sparse.csc_array((len(mass), len(mass)))
    groups = {name: sparse.csc_array(sparse.block_diag([part, none])) for name, part in model.groups.items()}
    return replace(model, stiffness=sparse.csc_array(stiffness), mass=sparse.csc_array(whole), groups=groups)
