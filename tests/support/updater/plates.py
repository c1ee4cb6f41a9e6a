"""A table: a plate on four feet. The model is of OpenSees' shells, the measured one of scikit-fem's triangles."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh
from skfem import Basis, BilinearForm, ElementTriMorley, MeshTri
from skfem.helpers import dd, ddot, eye, trace

from daq import FloatArray
from oma import ModalEstimate
from tests.support.opensees import ops
from tests.support.updater.frames import noisy_estimates
from updater import save_matrices
from updater.fe import opensees_matrices

LENGTH, WIDTH, THICKNESS = 1.5, 0.8, 0.008  # m
MODULUS, POISSON, DENSITY = 70e9, 0.33, 2700.0
FOOT = 2.0e5  # N/m, of each along z
FEET = {"foot_sw": (0.2, 0.1), "foot_se": (1.3, 0.2), "foot_nw": (0.1, 0.7), "foot_ne": (1.2, 0.7)}  # no symmetry
PANELS = (3, 2)
SENSORS = [(x, y) for x in (0.0, 0.5, 1.0, 1.5) for y in (0.0, 0.4, 0.8)]
CHANNELS = tuple(f"z{k}" for k in range(len(SENSORS)))
N_MODES = 9
LINES = (0.2, 0.6)  # m, y of the lines along which a mass is sought


def panel_of(x: float, y: float) -> str:
    """Return the panel at a point."""
    return f"panel_{min(int(x / LENGTH * PANELS[0]), 2)}{min(int(y / WIDTH * PANELS[1]), 1)}"


#: lines of a mesh that is coarse between the feet, at nodes of which they are: elements of up to 0.25 m
COARSE = (np.array([0.0, 0.1, 0.2, 0.5, 0.75, 1.0, 1.2, 1.3, 1.5]), np.array([0.0, 0.1, 0.2, 0.4, 0.7, 0.8]))


def write_table(
    folder: Path,
    *,
    along: int = 15,
    across: int = 8,
    mesh: tuple[FloatArray, FloatArray] | None = None,
    panels: float = 0.03,
    supports: bool = False,
) -> Path:
    """Write the structure file and the matrices of a model of ShellMITC4 elements with groups of them.

    Parameters
    ----------
    along, across : numbers of equal elements
    mesh : lines of the mesh in x and in y, in place of equal elements
    panels : uncertainty of the panels' stiffness
    supports : whether the feet are springs of the structure file, in place of groups
    """
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    ops.section("ElasticMembranePlateSection", 1, MODULUS, POISSON, THICKNESS, DENSITY)
    xs, ys = mesh or (np.linspace(0, LENGTH, along + 1), np.linspace(0, WIDTH, across + 1))
    tag = np.arange(1, len(xs) * len(ys) + 1).reshape(len(xs), len(ys))
    for i, j in np.ndindex(tag.shape):
        ops.node(int(tag[i, j]), float(xs[i]), float(ys[j]), 0.0)
    groups: dict[str, list[int]] = {}
    for element, (i, j) in enumerate(np.ndindex(len(xs) - 1, len(ys) - 1), start=1):
        corners = (tag[i, j], tag[i + 1, j], tag[i + 1, j + 1], tag[i, j + 1])
        ops.element("ShellMITC4", element, *map(int, corners), 1)
        groups.setdefault(panel_of(xs[i : i + 2].mean(), ys[j : j + 2].mean()), []).append(element)
    ops.uniaxialMaterial("Elastic", 1, FOOT)
    ops.uniaxialMaterial("Elastic", 2, 10 * FOOT)
    for number, (name, (x, y)) in enumerate(() if supports else FEET.items(), start=1):
        node, ground = int(tag[np.abs(xs - x).argmin(), np.abs(ys - y).argmin()]), 100_000 + number
        ops.node(ground, x, y, 0.0)
        ops.fix(ground, 1, 1, 1, 1, 1, 1)
        ops.element("zeroLength", ground, ground, node, "-mat", 2, 2, 1, "-dir", 1, 2, 3)
        groups[name] = [ground]
    save_matrices(folder / "table.npz", opensees_matrices(ops, groups))
    ops.wipe()
    text = ['name = "table"\n[external]\nmatrices = "table.npz"\n']
    text += [f"[external.group.{n}]\nuncertainty = {0.3 if n in FEET else panels}\n" for n in groups]
    text += [f'[[member]]\nname = "y = {y}"\nfrom = [0, {y}, 0]\nto = [{LENGTH}, {y}, 0]\n' for y in LINES]
    if supports:
        along_axes = f"x = {10 * FOOT}, y = {10 * FOOT}, z = {FOOT}"
        text += [f"[[support]]\nat = [{x}, {y}, 0]\nstiffness = {{ {along_axes} }}\n" for x, y in FEET.values()]
    for channel, (x, y) in zip(CHANNELS, SENSORS, strict=True):
        text.append(f'[[sensor]]\nchannel = "{channel}"\nat = [{x}, {y}, 0]\ndirection = [0, 0, 1]\n')
    (folder / "table.toml").write_text("\n".join(text), encoding="utf-8")
    return folder / "table.toml"


@dataclass(frozen=True, kw_only=True)
class Table:
    """The measured table: thin-plate theory on unstructured triangles, with hidden effects."""

    modulus: float = MODULUS
    factors: Mapping[str, float] = field(default_factory=dict)  #: of the stiffness of panels and feet
    mass: tuple[float, float, float] | None = None  #: x, y [m], mass [kg]

    def modes(self) -> tuple[FloatArray, FloatArray]:
        """Return frequencies (n_modes,) [Hz] and shapes (n_modes, n_sensors)."""
        mesh = MeshTri.init_tensor(np.linspace(0, LENGTH, 46), np.linspace(0, WIDTH, 25))
        basis = Basis(mesh, ElementTriMorley())
        x, y = mesh.p[:, mesh.t].mean(1)
        panel = np.array([self.factors.get(panel_of(a, b), 1.0) for a, b in zip(x, y, strict=True)])
        bending = self.modulus * THICKNESS**3 / (12 * (1 - POISSON**2)) * panel

        def stiffness(u: object, v: object, w: dict[str, FloatArray]) -> FloatArray:
            curvature = dd(u)
            moment = (1 - POISSON) * curvature + POISSON * eye(trace(curvature), 2)
            return np.asarray(bending[:, None] * ddot(moment, dd(v)))

        k = BilinearForm(stiffness).assemble(basis)
        m = BilinearForm(lambda u, v, _: DENSITY * THICKNESS * u * v).assemble(basis)
        at = basis.probes(np.array(list(FEET.values())).T)
        spring = FOOT * np.array([self.factors.get(name, 1.0) for name in FEET])
        k = k + at.T @ sparse.diags_array(spring) @ at
        if self.mass is not None:
            body = basis.probes(np.array([self.mass[:2]]).T)
            m = m + self.mass[2] * (body.T @ body)
        value, vector = eigsh(sparse.csc_matrix(k), N_MODES, sparse.csc_matrix(m), sigma=0.0, v0=np.ones(k.shape[0]))
        shape = basis.probes(np.array(SENSORS).T) @ vector
        return np.sqrt(value) / (2 * np.pi), shape.T


def windows(modes: tuple[FloatArray, FloatArray], n: int, random: np.random.Generator) -> list[ModalEstimate]:
    """Return windows with 0.02 to 0.05 % of error in frequency and 0.5 % of unit norm in shape."""
    frequency, shape = modes
    exact = shape / np.linalg.norm(shape, axis=1, keepdims=True)
    std = 5e-4 * np.sqrt(frequency[0] / frequency)
    return noisy_estimates(frequency, exact, CHANNELS, n, random, std=std, shape_std=5e-3)
