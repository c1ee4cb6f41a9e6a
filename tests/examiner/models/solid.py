"""An upright bar as a solid: no beam theory at all, by scikit-fem's 20-node hexahedra with reduced integration.

The bar lies on an elastic bedding; its reference is a beam in a structure file. Sensors are on vertices of the mesh.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.sparse.linalg import eigsh
from skfem import Basis, BilinearForm, ElementHexS2, ElementVector, FacetBasis, MeshHex
from skfem.helpers import ddot, dot, sym_grad, trace

from daq import FloatArray
from tests.examiner.models.specimen import Motion, Sensor

LENGTH, WIDTH, DEPTH = 1.3, 0.040, 0.015  #: along z, x, y [m]
HEIGHTS = (0.30, 0.55, 0.80, 1.05, 1.30)
_LAYER = 0.045  # m, of elements along the bar
_POISSON = 0.3

STRUCTURE = f"""
name = "upright bar"

[material.steel]
youngs_modulus = 210e9
poisson_ratio = {_POISSON}
density = 7850

[section.flat]
shape = "rectangle"
width = {DEPTH}
height = {WIDTH}

[[member]]
name = "bar"
from = [0.0, 0.0, 0.0]
to = [0.0, 0.0, {LENGTH}]
material = "steel"
section = "flat"
elements = 26
local_y = [0, 1, 0]

[[support]]
at = [0.0, 0.0, 0.0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]
""" + "".join(
    f'\n[[sensor]]\nchannel = "z{round(1000 * z):04d}_{axis}"\nat = [0.0, 0.0, {z}]\ndirection = {unit}\n'
    for z in HEIGHTS
    for axis, unit in (("x", [1, 0, 0]), ("y", [0, 1, 0]))
)  #: what the user believes


@dataclass(frozen=True, kw_only=True)
class SolidBar:
    """The bar; stretches are (from, to, factor on the modulus) [m], patches (middle, length, mass) on the y face."""

    modulus: float
    density: float
    bedding: float  #: of the foot, stiffness an area [N/m3]
    soft: tuple[tuple[float, float, float], ...] = ()
    patches: tuple[tuple[float, float, float], ...] = ()

    def motion(self, sensors: tuple[Sensor, ...], forces: tuple[Sensor, ...], n_modes: int) -> Motion:
        """Modes at sensors and at forces."""
        mesh = self._mesh([s.s for s in (*sensors, *forces)])
        basis = Basis(mesh, ElementVector(ElementHexS2()), intorder=3)
        stiffness, mass = self._matrices(mesh, basis)
        value, vector = eigsh(stiffness, n_modes, mass, sigma=0.0, v0=np.ones(basis.N))
        order = np.argsort(value)
        seen, pushed = (
            np.array([np.array(s.direction) @ vector[self._dofs(mesh, basis, s.s)][:, order] for s in which]).T
            for which in (sensors, forces)
        )
        return Motion(np.sqrt(value[order]) / (2 * np.pi), seen, pushed)

    def _mesh(self, places: list[float]) -> MeshHex:
        edges = [e for a, b, _ in self.soft for e in (a, b)]
        edges += [e for z, length, _ in self.patches for e in (z - length / 2, z + length / 2)]
        stops = np.unique(np.round([0.0, LENGTH, *places, *edges], 9))
        layers = [np.linspace(a, b, max(1, round((b - a) / _LAYER)) + 1)[1:] for a, b in pairwise(stops)]
        x, y = np.linspace(-WIDTH / 2, WIDTH / 2, 3), np.linspace(-DEPTH / 2, DEPTH / 2, 3)
        return MeshHex.init_tensor(x, y, np.concatenate([[0.0], *layers]))

    def _matrices(self, mesh: MeshHex, basis: Basis) -> tuple[Any, Any]:
        """Return stiffness and mass, those of foot and patches included."""

        def local(z: FloatArray) -> FloatArray:
            modulus = np.full(z.shape, self.modulus)
            for a, b, factor in self.soft:
                modulus[(z > a) & (z < b)] *= factor
            return modulus

        def elastic(u: Any, v: Any, w: Any) -> FloatArray:
            e = local(w["x"][2])
            shear, lame = e / (2 * (1 + _POISSON)), e * _POISSON / ((1 + _POISSON) * (1 - 2 * _POISSON))
            a, b = sym_grad(u), sym_grad(v)
            return np.asarray(2 * shear * ddot(a, b) + lame * trace(a) * trace(b))

        def inert(u: Any, v: Any, _: Any) -> FloatArray:
            return np.asarray(dot(u, v))

        foot = FacetBasis(mesh, basis.elem, facets=mesh.facets_satisfying(lambda x: np.isclose(x[2], 0.0)))
        stiffness = BilinearForm(elastic).assemble(basis) + self.bedding * BilinearForm(inert).assemble(foot)
        mass = self.density * BilinearForm(inert).assemble(Basis(mesh, basis.elem, intorder=4))
        for middle, length, carried in self.patches:
            on = mesh.facets_satisfying(
                lambda x, m=middle, h=length / 2: np.isclose(x[1], DEPTH / 2) & (np.abs(x[2] - m) < h)
            )
            mass = mass + carried / (WIDTH * length) * BilinearForm(inert).assemble(
                FacetBasis(mesh, basis.elem, facets=on)
            )
        return stiffness, mass

    @staticmethod
    def _dofs(mesh: MeshHex, basis: Basis, z: float) -> np.ndarray:
        axis = np.abs(mesh.p - np.array([[0.0], [0.0], [z]])).sum(0)
        return np.asarray(basis.nodal_dofs[:, int(np.argmin(axis))])
