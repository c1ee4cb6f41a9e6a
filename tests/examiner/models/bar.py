"""A bar of a space frame, and its elements: three-node Timoshenko beams with reduced integration.

Bars lie along a global axis a; their two cross axes are a + 1 and a + 2 (modulo 3), so that local and global components
are the same numbers in another order. A bar's mesh is uneven and has nodes where its zones begin and end.

References
----------
Hughes, Taylor & Kanoknukulchai (1977). A simple and efficient finite element for plate bending. Int. J. Numer. Meth.
Engng 11, 1529-1543 (selective reduced integration; here of the quadratic beam: two Gauss points cure the locking).
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from daq import FloatArray

Vector = tuple[float, float, float]
_G2 = np.array([-1.0, 1.0]) / np.sqrt(3), np.ones(2)
_G3 = np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)]), np.array([5.0, 8.0, 5.0]) / 9


def vector(values: Iterable[float]) -> Vector:
    """Return three components as a tuple."""
    x, y, z = (float(v) for v in values)
    return x, y, z


@dataclass(frozen=True, kw_only=True)
class Zone:
    """A stretch of a bar that differs; factors on the bar's own stiffness about its two cross axes and its own."""

    start: float  #: along the bar [m]
    end: float
    bend1: float = 1.0
    bend2: float = 1.0
    twist: float = 1.0
    mass: float = 0.0  #: more per length [kg/m]


@dataclass(frozen=True, kw_only=True)
class Bar:
    """A straight bar with a doubly symmetric section."""

    name: str
    start: Vector
    axis: int
    length: float
    size: float  #: of elements, roughly [m]
    modulus: float
    shear_modulus: float
    density: float
    area: float
    second_moment: tuple[float, float]
    torsion_constant: float
    shear_factor: float
    breaks: tuple[float, ...] = ()  #: where there must be a node [m]
    zones: tuple[Zone, ...] = ()
    preload: float = 0.0  #: tension [N]

    @property
    def order(self) -> list[int]:
        """Global axes of the bar's own and its two cross axes."""
        return [(self.axis + i) % 3 for i in range(3)]

    def point(self, s: float) -> Vector:
        """Point at s [m]."""
        x, y, z = (c + s * (i == self.axis) for i, c in enumerate(self.start))
        return x, y, z

    def ends(self) -> FloatArray:
        """Ends of the elements [m]: between the breaks evenly, but the lengths alternate by a quarter."""
        stops = sorted({0.0, self.length, *self.breaks, *(e for z in self.zones for e in (z.start, z.end))})
        found = [0.0]
        for a, b in pairwise(stops):
            n = max(2, round((b - a) / self.size))
            lengths = np.where(np.arange(n) % 2, 1.25, 1.0)
            found += [*list(a + (b - a) * np.cumsum(lengths)[:-1] / lengths.sum()), b]
        return np.array(found)

    def at(self, s: float) -> tuple[FloatArray, float]:
        """Stiffness (axial, shear, shear, twist, bend1, bend2) and mass a length at s."""
        bend1, bend2, twist, mass = 1.0, 1.0, 1.0, self.density * self.area
        for zone in self.zones:
            if zone.start < s < zone.end:
                bend1, bend2, twist, mass = bend1 * zone.bend1, bend2 * zone.bend2, twist * zone.twist, mass + zone.mass
        e, shear = self.modulus, self.shear_factor * self.shear_modulus * self.area
        first, second = self.second_moment
        torsion = self.shear_modulus * self.torsion_constant * twist
        return np.array([e * self.area, shear, shear, torsion, e * first * bend1, e * second * bend2]), mass


def shape_functions(xi: float) -> tuple[FloatArray, FloatArray]:
    """Quadratic shape functions and their derivatives by xi."""
    return np.array([xi * (xi - 1) / 2, 1 - xi**2, xi * (xi + 1) / 2]), np.array([xi - 0.5, -2 * xi, xi + 0.5])


def element(bar: Bar, a: float, b: float) -> tuple[FloatArray, FloatArray]:
    """Stiffness and mass (18, 18): three nodes of (u_t, u_1, u_2, theta_t, theta_1, theta_2)."""
    stiffness, mass, half = np.zeros((18, 18)), np.zeros((18, 18)), (b - a) / 2
    section, line = bar.at((a + b) / 2)
    for xi, weight in zip(*_G2, strict=True):
        n, d = shape_functions(xi)
        strain = np.zeros((6, 3, 6))
        for component in range(6):
            strain[component, :, component] = d / half
        strain[1, :, 5] = -n  # gamma_1 = u_1' - theta_2
        strain[2, :, 4] = n  # gamma_2 = u_2' + theta_1
        flat = strain.reshape(6, 18)
        leaning = flat[1:3] * (np.arange(18) % 6 < 3)  # u_1' and u_2' alone
        tension = bar.preload * leaning.T @ leaning
        stiffness += weight * half * (flat.T * section @ flat + tension)
    first, second = (bar.density * i for i in bar.second_moment)
    inertia = np.array([line, line, line, first + second, first, second])
    for xi, weight in zip(*_G3, strict=True):
        n, _ = shape_functions(xi)
        spread = np.einsum("a,ij->iaj", n, np.eye(6)).reshape(6, 18)
        mass += weight * half * (spread.T * inertia) @ spread
    return stiffness, mass
