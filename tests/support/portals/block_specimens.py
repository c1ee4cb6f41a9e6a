"""Frames of solid bars with a solid block where they meet, and the files of their owners.

The truth is of solids, the file of beams that meet at a point.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh
from skfem import Basis, BilinearForm, ElementHexS2, ElementVector, MeshHex
from skfem.helpers import ddot, dot, sym_grad, trace

from daq import FloatArray, IndexArray
from updater import Structure, parse_structure

Point = tuple[float, float, float]
MODULUS, DENSITY = 210e9, 7850.0  #: of the file
_RIGID = 1e12  # N/m and N m/rad: of the foot along its axes and where it does not yield
_TINY = 1e-3  # kg and kg m2 of the foot's plate, which does not move
POISSON = 0.3
_UNITS = {"x": 0, "y": 1, "z": 2}


@dataclass(frozen=True, eq=False, kw_only=True)
class Specimen:
    """A frame clamped by one foot at the origin; the last six DOFs are those of the foot's rigid plate."""

    text: str  #: structure file
    stiffness: sparse.csr_array
    mass: sparse.csr_array
    translations: sparse.csr_array  #: (3 n_nodes, n_dofs), of the free nodes and those of the foot
    nodes: FloatArray  #: (n_nodes, 3) [m]
    foot: FloatArray  #: stiffness about x, y and z [N m/rad]
    facts: Mapping[str, float] = field(default_factory=dict)  #: what was drawn

    @property
    def file(self) -> Structure:
        """Structure as its owner describes it."""
        return parse_structure(self.text)

    def motion(self, at: Point) -> sparse.csr_array:
        """Return rows (3, n_dofs): mean motion of the section, of any member, whose nodes are nearest to a point."""
        file = self.file
        member = next(member for member in file.member if member.passes(at))
        axis = int(np.argmax(np.abs(np.subtract(member.end, member.start))))
        across = np.delete(self.nodes - at, axis, axis=1)
        width = 1.01 * max(file.section[member.section].edge or (0.0,))
        near = np.flatnonzero((np.abs(across) < width).all(1))
        distance = np.abs(self.nodes[near, axis] - at[axis])
        own = near[distance < distance.min() + 1e-7]
        column = own + len(self.nodes) * np.arange(3)[:, None]
        row = np.repeat(np.arange(3), len(own))
        mean = sparse.csr_array(
            (np.full(column.size, 1 / len(own)), (row, column.ravel())), shape=(3, self.translations.shape[0])
        )
        return sparse.csr_array(mean @ self.translations)

    def modes(
        self, n: int, *, loosened: Mapping[str, float] | None = None, body: tuple[Point, float] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return frequencies (n,) [Hz] and shapes (n, n_channels) of unit norm.

        Parameters
        ----------
        loosened : factors on the foot's stiffness about its axes
        body : point and mass [kg]
        """
        springs = np.full(6, _RIGID)
        springs[3:] = self.foot * [(loosened or {}).get(axis, 1.0) for axis in ("rx", "ry", "rz")]
        stiffness = self.stiffness + _at_the_end(springs, self.stiffness.shape[0])
        mass = self.mass + _at_the_end(np.full(6, _TINY), self.mass.shape[0])
        if body is not None:
            rows = self.motion(body[0])
            mass = mass + body[1] * (rows.T @ rows)
        rows = sparse.vstack([self.motion(s.at)[[int(np.argmax(np.abs(s.direction)))]] for s in self.file.sensor])
        value, vector = eigsh(
            sparse.csc_array(stiffness), n + 10, sparse.csc_array(mass), sigma=0.0, v0=np.ones(mass.shape[0])
        )
        shape = np.asarray((rows @ vector).T)
        size = np.linalg.norm(shape, axis=1)
        seen = np.flatnonzero(size > 0.2 * np.median(size[:n]))[:n]  # not those along the bars
        return np.sqrt(value[seen]) / (2 * np.pi), shape[seen] / size[seen, None]


def _at_the_end(values: FloatArray, n: int) -> sparse.csr_array:
    return sparse.csr_array(sparse.diags_array(np.concatenate([np.zeros(n - len(values)), values])))


def _clamped(nodes: FloatArray, dofs: IndexArray, held: IndexArray, n: int) -> sparse.csr_array:
    """Return all DOFs (n, n_free + 6) by the free ones and those of a rigid plate at the origin that holds nodes."""
    free = np.setdiff1d(np.arange(n), dofs[held])
    plate = np.zeros((n, 6))
    for i in held:
        x, y, z = nodes[i]
        plate[dofs[i, :3]] = np.hstack([np.eye(3), [[0, z, -y], [-z, 0, x], [y, -x, 0]]])
        plate[dofs[i, 3:], 3:] = np.eye(3)[: dofs.shape[1] - 3]
    rows = sparse.csr_array((np.ones(len(free)), (free, np.arange(len(free)))), shape=(n, len(free)))
    return sparse.csr_array(sparse.hstack([rows, sparse.csr_array(plate)]))


def draw_specimen(seed: int) -> Specimen:
    """Draw two solid bars with a block where they meet: dimensions, modulus, density and foot."""
    random = np.random.default_rng((seed, 5))
    b, height, length = random.uniform(0.03, 0.04), random.uniform(0.8, 1.1), random.uniform(0.5, 0.7)
    short = length * random.uniform(0.5, 0.8)
    half, block = b / 2, b * random.uniform(0.8, 1.1)  # half of the block
    top = height + half
    fine = b / 2  # two across a bar: one is a sixth too stiff in twist
    mesh = MeshHex.init_tensor(
        grid_lines(
            (-short, -block, 0.04), (-block, -half, b), (-half, half, fine), (half, block, b), (block, length, 0.04)
        ),
        grid_lines((-block, -half, b), (-half, half, fine), (half, block, b)),
        grid_lines(
            (0.0, height - block, 0.04),
            (height - block, height - half, b),
            (height - half, top, fine),
            (top, height + block, b),
        ),
    )
    x, y, z = mesh.p[:, mesh.t].mean(1)
    up, along = (abs(x) < half) & (abs(y) < half) & (z < top), (abs(y) < half) & (abs(z - height) < half)
    middle = (abs(x) < block) & (abs(z - height) < block)
    mesh = mesh.restrict(np.flatnonzero(up | along | middle))
    modulus, density = draw_steel(random)
    mass = DENSITY * (8 * block**3 - b**2 * (3 * block))
    body = [((0, 0, height), mass, mass * (2 * block) ** 2 / 6)]
    text = file_text(
        {"bar": f'shape = "rectangle"\nwidth = {b:.6f}\nheight = {b:.6f}'},
        {"column": ("bar", (0, 0, 0), (0, 0, height)), "beam": ("bar", (-short, 0, height), (length, 0, height))},
        body,
    )
    return solid_specimen(
        mesh,
        modulus,
        density,
        text=text,
        foot=MODULUS * b**4 / 12 / height / random.uniform(0.01, 0.03, 3),
        facts={
            "b": b,
            "block": 2 * block,
            "mass": mass,
            "E": modulus / MODULUS,
            "rho": density / DENSITY,
        },
    )


def draw_steel(random: np.random.Generator) -> tuple[float, float]:
    """Draw modulus [Pa] and density [kg/m3]; those of the file are off by as much."""
    return MODULUS * (1 + 0.01 * random.standard_normal()), DENSITY * (1 + 0.005 * random.standard_normal())


def solid_specimen(
    mesh: MeshHex, modulus: float, density: float, *, text: str, foot: FloatArray, facts: Mapping[str, float]
) -> Specimen:
    """Return a specimen of solids, whose nodes at a height of 0 stand on the foot."""
    shear, lame = modulus / (2 * (1 + POISSON)), modulus * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    basis = Basis(mesh, ElementVector(ElementHexS2()), intorder=4)

    def elastic(u: Any, v: Any, _: Any) -> FloatArray:
        a, c = sym_grad(u), sym_grad(v)
        return np.asarray(2 * shear * ddot(a, c) + lame * trace(a) * trace(c))

    def inert(u: Any, v: Any, _: Any) -> FloatArray:
        return np.asarray(density * dot(u, v))

    nodes, of_dof = np.unique(basis.doflocs.round(9).T, axis=0, return_inverse=True)
    dofs = np.empty((len(nodes), 3), int)
    for numbers in (basis.nodal_dofs, basis.edge_dofs):
        for axis, own in enumerate(numbers):
            dofs[of_dof[own], axis] = own
    whole = _clamped(nodes, dofs, np.flatnonzero(nodes[:, 2] < 1e-9), basis.N)
    return Specimen(
        text=text,
        stiffness=sparse.csr_array(whole.T @ BilinearForm(elastic).assemble(basis) @ whole),
        mass=sparse.csr_array(whole.T @ BilinearForm(inert).assemble(basis) @ whole),
        translations=whole[dofs.T.ravel()],
        nodes=nodes,
        foot=foot,
        facts=facts,
    )


def grid_lines(*parts: tuple[float, float, float]) -> FloatArray:
    """Return lines of a grid through parts (start, end, largest size) [m]."""
    found = [np.linspace(a, b, max(1, int(np.ceil((b - a) / size - 1e-9))) + 1) for a, b, size in parts]
    return np.unique(np.round(np.concatenate(found), 7))


def file_text(sections: Mapping[str, str], members: Mapping[str, tuple[str, Any, Any]], bodies: Any = ()) -> str:
    """Return a structure file: one foot, sensors along both axes across each member."""
    text = ['name = "frame"', "[mesh]", "element_length = 0.04", "[material.steel]"]
    text += [f"youngs_modulus = {MODULUS}", f"poisson_ratio = {POISSON}", f"density = {DENSITY}"]
    text += [f"[section.{name}]\n{constants}" for name, constants in sections.items()]
    for name, (section, start, end) in members.items():
        text.append(
            f'[[member]]\nname = "{name}"\nfrom = {_point(start)}\nto = {_point(end)}\nmaterial = "steel"\n'
            f'section = "{section}"'
        )
    for at, mass, inertia in bodies:
        text.append(f"[[body]]\nat = {_point(at)}\nmass = {mass:.4g}\ninertia = {[float(f'{inertia:.4g}')] * 3}")
    text.append('[[support]]\nat = [0, 0, 0]\nfixed = ["x", "y", "z", "rx", "ry", "rz"]')
    for name, (_, start, end) in members.items():
        along = int(np.argmax(np.abs(np.subtract(end, start))))
        for share in (0.25, 0.5, 0.75, 1.0) if along == 2 else (0.0, 0.2, 0.7, 1.0):
            at = np.add(start, share * np.subtract(end, start))
            if along == 0 and share == 0.0 and not start[0]:
                continue  # at the axis of the column
            for axis, k in _UNITS.items():
                if k != along:
                    text.append(
                        f'[[sensor]]\nchannel = "{name}_{share:g}_{axis}"\nat = {_point(at)}\n'
                        f"direction = {[int(j == k) for j in range(3)]}"
                    )
    return "\n".join(text) + "\n"


def _point(at: Any) -> list[float]:
    return [round(float(x), 6) for x in at]
