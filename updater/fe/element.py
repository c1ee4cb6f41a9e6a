"""A straight two-node frame element in its own axes: x along it, 12 DOFs (u v w rx ry rz at each end).

Shape functions are the exact static ones of a uniform Timoshenko beam (Przemieniecki 1968, ch. 5 and 11; with no
shear flexibility, phi = 0, they are Hermite's cubics), so that stiffness is exact and position inside an element has
a meaning.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from updater.structure import Material, Section

#: DOFs bending in the x-y plane (v, rz), and in the x-z plane (w, ry, which turns the other way)
_PLANES = (((1, 5, 7, 11), 1.0), ((2, 4, 8, 10), -1.0))
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(5)


@dataclass(frozen=True)
class Element:
    """Constants of one element."""

    length: float  #: [m]
    material: Material
    section: Section
    shear_flexible: bool  #: Timoshenko if true, Euler-Bernoulli if not

    def shear_parameter(self, plane: int) -> float:
        """Return phi = 12 E I / (kappa G A L^2), 0 for Euler-Bernoulli."""
        if not self.shear_flexible:
            return 0.0
        shear = self.section.shear_factor * self.material.shear_modulus * self.section.area
        return 12 * self.material.youngs_modulus * self._second_moment(plane) / (shear * self.length**2)

    def _second_moment(self, plane: int) -> float:
        return self.section.second_moment[1 - plane]

    def stiffness(self) -> FloatArray:
        """Return the stiffness matrix (12, 12)."""
        length, e = self.length, self.material.youngs_modulus
        k = np.zeros((12, 12))
        bar = np.array([[1.0, -1.0], [-1.0, 1.0]])
        k[np.ix_([0, 6], [0, 6])] = e * self.section.area / length * bar
        k[np.ix_([3, 9], [3, 9])] = self.material.shear_modulus * self.section.torsion_constant / length * bar
        for plane, (dofs, sign) in enumerate(_PLANES):
            phi = self.shear_parameter(plane)
            c = e * self._second_moment(plane) / (length**3 * (1 + phi))
            a, near, far = 6 * length * sign, (4 + phi) * length**2, (2 - phi) * length**2
            k[np.ix_(dofs, dofs)] = c * np.array(
                [[12, a, -12, a], [a, near, -a, far], [-12, -a, 12, -a], [a, far, -a, near]]
            )
        return k

    def displacement(self, xi: float) -> FloatArray:
        """Return N (6, 12): displacements and rotations at x = xi L from the DOFs of the ends."""
        n = np.zeros((6, 12))
        n[0, [0, 6]] = n[3, [3, 9]] = 1 - xi, xi
        for plane, (dofs, sign) in enumerate(_PLANES):
            value, slope = self._bending(xi, self.shear_parameter(plane))
            turn = np.array([1, sign, 1, sign])
            n[1 + plane, list(dofs)] = value * turn
            n[5 - plane, list(dofs)] = slope * turn * sign
        return n

    def _bending(self, xi: float, phi: float) -> tuple[FloatArray, FloatArray]:
        length, x2, x3 = self.length, xi**2, xi**3
        value = np.array(
            [
                1 - 3 * x2 + 2 * x3 + phi * (1 - xi),
                length * (xi - 2 * x2 + x3 + phi / 2 * (xi - x2)),
                3 * x2 - 2 * x3 + phi * xi,
                length * (-x2 + x3 - phi / 2 * (xi - x2)),
            ]
        )
        slope = np.array(
            [
                6 / length * (x2 - xi),
                1 - 4 * xi + 3 * x2 + phi * (1 - xi),
                6 / length * (xi - x2),
                -2 * xi + 3 * x2 + phi * xi,
            ]
        )
        return value / (1 + phi), slope / (1 + phi)

    def consistent_mass(self) -> FloatArray:
        """Return the consistent mass matrix (12, 12) with rotary and polar inertia, by Gauss quadrature (exact)."""
        iy, iz = self.section.second_moment
        inertia = self.material.density * np.array([self.section.area] * 3 + [iy + iz, iy, iz])
        mass = np.zeros((12, 12))
        for x, weight in zip(_GAUSS_X, _GAUSS_W, strict=True):
            n = self.displacement((1 + x) / 2)
            mass += weight * self.length / 2 * n.T @ (inertia[:, None] * n)
        return mass

    def lumped_mass(self) -> FloatArray:
        """Return the particle-lumped mass matrix (12, 12): half the mass at each end, no rotary inertia."""
        half = self.material.density * self.section.area * self.length / 2
        return np.diag(np.tile([half] * 3 + [0.0] * 3, 2))


def local_axes(direction: FloatArray) -> FloatArray:
    """Return (3, 3), rows = local x, y, z; local y is horizontal, or global y for a vertical member."""
    x = direction / np.linalg.norm(direction)
    vertical = abs(x[2]) > 1 - 1e-9
    y = np.array([0.0, 1.0, 0.0]) if vertical else np.cross([0.0, 0.0, 1.0], x)
    y = y / np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])
