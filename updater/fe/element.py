"""A straight two-node frame element in its own axes: x along it, 12 DOFs (u v w rx ry rz at each end).

Shape functions are the exact static ones of a uniform Timoshenko beam (Przemieniecki 1968, ch. 5 and 11; with no
shear flexibility, phi = 0, they are Hermite's cubics), so that stiffness is exact and position inside an element has
a meaning.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from daq import FloatArray
from updater.structure import Material, Section, Vector, local_axes

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
    tension: float = 0.0  #: axial force [N], negative in compression
    local_y: Vector | None = None  #: approximate direction of the local y axis. Default: horizontal
    turning: Vector = (1.0, 1.0, 1.0)  #: factors on the stiffness in twist and in bending about y and z [-]
    stretching: tuple[float, float] = (1.0, 1.0)  #: factors on the stiffness along the axis and in shear [-]
    rotary: float = 1.0  #: factor on rotary and polar inertia [-]

    def axes(self, direction: FloatArray) -> FloatArray:
        """Return (3, 3), rows = local x, y, z of the element that points in a direction (3,)."""
        return local_axes(direction, self.local_y)

    def rotation(self, direction: FloatArray) -> FloatArray:
        """Return the matrix (12, 12) that turns the DOFs of both ends from global to local axes."""
        axes, turn = self.axes(direction), np.zeros((12, 12))
        for k in range(0, 12, 3):
            turn[k : k + 3, k : k + 3] = axes
        return turn

    def shear_parameter(self, plane: int) -> float:
        """Return phi = 12 E I / (kappa G A L^2), 0 for Euler-Bernoulli."""
        if not self.shear_flexible:
            return 0.0
        return float(12 * self.rigidity[5 - plane] / (self.rigidity[1 + plane] * self.length**2))

    @cached_property
    def rigidity(self) -> FloatArray:
        """Return E A, kappa G A along y and z, G J, E I about y and z (6,) [N], [N m2], as its factors make them."""
        young, shear = self.material.youngs_modulus, self.material.shear_modulus
        stretched = [young * self.section.area, *(shear * self.section.shear_area(axis) for axis in (0, 1))]
        turned = [shear * self.section.torsion_constant, *(young * moment for moment in self.section.second_moment)]
        along, across = self.stretching
        return np.array([along, across, across, *self.turning]) * [*stretched, *turned]

    def turned(self, factor: float) -> "Element":
        """Return the same element with a factor on its stiffness in bending and twist."""
        twist, about_y, about_z = self.turning
        return replace(self, turning=(factor * twist, factor * about_y, factor * about_z))

    def with_factor(self, action: int, factor: float) -> "Element":
        """Return the same element with a factor on one part of its stiffness: along it, in twist or in bending.

        Parameters
        ----------
        action : 0 along the axis, 3 in twist, 4 and 5 in bending about y and z
        """
        along, across = self.stretching
        if action == 0:
            return replace(self, stretching=(factor * along, across))
        twist, about_y, about_z = (t * (factor if i == action else 1.0) for i, t in enumerate(self.turning, start=3))
        return replace(self, turning=(twist, about_y, about_z))

    @property
    def stiffness(self) -> FloatArray:
        """Stiffness matrix (12, 12), preload included."""
        elastic = self.elastic_stiffness
        return elastic + self.tension * self.geometric_stiffness() if self.tension else elastic

    @cached_property
    def elastic_stiffness(self) -> FloatArray:
        """Stiffness matrix (12, 12) of the element without preload."""
        length, axial, twist = self.length, *self.rigidity[[0, 3]]
        k = np.zeros((12, 12))
        bar = np.array([[1.0, -1.0], [-1.0, 1.0]])
        k[np.ix_([0, 6], [0, 6])] = axial / length * bar
        k[np.ix_([3, 9], [3, 9])] = twist / length * bar
        for plane, (dofs, sign) in enumerate(_PLANES):
            phi = self.shear_parameter(plane)
            c = self.rigidity[5 - plane] / (length**3 * (1 + phi))
            a, near, far = 6 * length * sign, (4 + phi) * length**2, (2 - phi) * length**2
            k[np.ix_(dofs, dofs)] = c * np.array(
                [[12, a, -12, a], [a, near, -a, far], [-12, -a, 12, -a], [a, far, -a, near]]
            )
        return k

    def geometric_stiffness(self) -> FloatArray:
        """Return the contribution of a tension of 1 N to the stiffness matrix (12, 12) [1/m].

        The tension does work as the axis turns, int (v'^2 + w'^2) / 2 dx, and as the section twists about it,
        (I_y + I_z) / A int rx'^2 / 2 dx. Exact for the shape functions; buckling loads converge with fourth order.

        References
        ----------
        Przemieniecki (1968), s. 15.3; McGuire, Gallagher & Ziemian (2000), s. 9.2; for beams that shear,
        Timoshenko & Gere (1961), s. 2.17, the first of the two formulas (Engesser's).
        """
        k = np.zeros((12, 12))
        for x, weight in zip(_GAUSS_X, _GAUSS_W, strict=True):
            for plane, (dofs, sign) in enumerate(_PLANES):
                turn = np.array([1, sign, 1, sign]) * self._slope((1 + x) / 2, self.shear_parameter(plane))
                k[np.ix_(dofs, dofs)] += weight * self.length / 2 * np.outer(turn, turn)
        twist = sum(self.section.second_moment) / self.section.area / self.length
        k[np.ix_([3, 9], [3, 9])] = twist * np.array([[1.0, -1.0], [-1.0, 1.0]])
        return k

    def displacement(self, xi: FloatArray) -> FloatArray:
        """Return N (n, 6, 12): displacements and rotations at x = xi L, xi (n,), from the DOFs of the ends."""
        n = np.zeros((len(xi), 6, 12))
        n[:, 0, 0] = n[:, 3, 3] = 1 - xi
        n[:, 0, 6] = n[:, 3, 9] = xi
        for plane, (dofs, sign) in enumerate(_PLANES):
            value, rotation = self._bending(xi, self.shear_parameter(plane))
            turn = np.array([1, sign, 1, sign])
            n[:, 1 + plane, dofs] = value.T * turn
            n[:, 5 - plane, dofs] = rotation.T * (turn * sign)
        return n

    def _bending(self, xi: FloatArray, phi: float) -> tuple[FloatArray, FloatArray]:
        """Return deflections and rotations (4, n) in a plane at shares (n,) of the length."""
        length, x2, x3 = self.length, xi**2, xi**3
        value = np.array(
            [
                1 - 3 * x2 + 2 * x3 + phi * (1 - xi),
                length * (xi - 2 * x2 + x3 + phi / 2 * (xi - x2)),
                3 * x2 - 2 * x3 + phi * xi,
                length * (-x2 + x3 - phi / 2 * (xi - x2)),
            ]
        )
        rotation = np.array(
            [
                6 / length * (x2 - xi),
                1 - 4 * xi + 3 * x2 + phi * (1 - xi),
                6 / length * (xi - x2),
                -2 * xi + 3 * x2 + phi * xi,
            ]
        )
        return value / (1 + phi), rotation / (1 + phi)

    def _slope(self, xi: float, phi: float) -> FloatArray:
        """Return the derivative of the deflection by x, which is not the section's rotation where it shears."""
        steep, near, far = 6 * (xi**2 - xi) - phi, 1 - 4 * xi + 3 * xi**2, 3 * xi**2 - 2 * xi
        shear = phi / 2 * (1 - 2 * xi)
        slope = np.array([steep / self.length, near + shear, -steep / self.length, far - shear])
        return np.asarray(slope / (1 + phi))

    @cached_property
    def consistent_mass(self) -> FloatArray:
        """Consistent mass matrix (12, 12) with rotary and polar inertia, by Gauss quadrature (exact)."""
        iy, iz = self.section.second_moment
        turning = self.rotary * np.array([iy + iz, iy, iz])
        inertia = self.material.density * np.array([*[self.section.area] * 3, *turning])
        n = self.displacement((1 + _GAUSS_X) / 2)
        weight = self.length / 2 * _GAUSS_W
        return np.asarray(n.reshape(-1, 12).T @ (np.outer(weight, inertia).reshape(-1, 1) * n.reshape(-1, 12)))

    def lumped_mass(self) -> FloatArray:
        """Return the particle-lumped mass matrix (12, 12): half the mass at each end, no rotary inertia."""
        half = self.material.density * self.section.area * self.length / 2
        return np.diag(np.tile([half] * 3 + [0.0] * 3, 2))
