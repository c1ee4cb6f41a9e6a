"""Coordinate systems of Nastran: positions and directions in the basic system.

References
----------
MSC Nastran quick reference guide: bulk data entries CORD1R, CORD1C, CORD1S, CORD2R, CORD2C, CORD2S, GRID and GRDSET.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from daq import FloatArray
from updater.fe.external.programs.nastran import nastran_number

_BASIC = 0
_BY_GRIDS = 1  # form of a system through three grid points; the other one has three points of its own
_POINTS = 3
_MOST_NESTED = 100
_KINDS = "RCS"  # rectangular, cylindrical, spherical
_TINY = 1e-9  # of the distance of two points: a smaller one is none


@dataclass(frozen=True, eq=False)
class CoordinateSystem:
    """Right-handed axes, and the meaning of three coordinates about them."""

    kind: str  #: R: x, y, z; C: r, theta, z; S: r, theta from the z axis, phi. Angles in degrees
    origin: FloatArray  #: (3,) in the basic system
    axes: FloatArray  #: (3, 3) unit vectors x, y, z in the basic system

    def position(self, coordinates: FloatArray) -> FloatArray:
        """Return the point (3,) in the basic system of coordinates (3,)."""
        first, second, third = coordinates
        if self.kind == "C":
            angle = np.radians(second)
            coordinates = np.array([first * np.cos(angle), first * np.sin(angle), third])
        elif self.kind == "S":
            polar, angle = np.radians([second, third])
            across = first * np.sin(polar)
            coordinates = np.array([across * np.cos(angle), across * np.sin(angle), first * np.cos(polar)])
        return np.asarray(self.origin + coordinates @ self.axes)

    def directions(self, point: FloatArray) -> FloatArray:
        """Return the unit vectors (3, 3) of displacements at a point (3,) of the basic system."""
        if self.kind == "R":
            return self.axes
        away = self.axes @ (point - self.origin)
        angle = np.arctan2(away[1], away[0])  # on the z axis, r is along x
        radial = np.array([np.cos(angle), np.sin(angle), 0.0])
        around = np.array([-np.sin(angle), np.cos(angle), 0.0])
        if self.kind == "C":
            return np.array([radial, around, [0.0, 0.0, 1.0]]) @ self.axes
        polar = np.arctan2(np.hypot(away[0], away[1]), away[2])
        outward = np.sin(polar) * radial + np.array([0.0, 0.0, np.cos(polar)])
        down = np.cos(polar) * radial - np.array([0.0, 0.0, np.sin(polar)])
        return np.array([outward, down, around]) @ self.axes


@dataclass
class GridPoints:
    """Cards of grid points and of coordinate systems, resolved on demand: either may refer to the other."""

    grids: dict[int, Sequence[str]] = field(default_factory=dict)  #: fields of GRID by number
    systems: dict[int, tuple[str, int, Sequence[str]]] = field(default_factory=dict)  #: kind, 1 or 2, further fields
    default: Sequence[str] = ()  #: fields of GRDSET
    _points: dict[int, FloatArray] = field(default_factory=dict)
    _axes: dict[int, CoordinateSystem] = field(default_factory=dict)
    _open: list[int] = field(default_factory=list)  # systems that are being resolved

    def add(self, card: Sequence[str]) -> None:
        """Add a card; other ones are passed over.

        Raises
        ------
        ValueError
            If its number is none.
        """
        name = card[0]
        if name == "GRID":
            self.grids[int(card[1])] = card
        elif name == "GRDSET":
            self.default = card
        elif name[:4] == "CORD" and name[4:5] in ("1", "2") and name[5:] in tuple(_KINDS):
            form = int(name[4])
            each = [card[1:]] if form == 2 else [card[k : k + 4] for k in (1, 5)]
            for fields in each:
                if fields and fields[0]:
                    self.systems[int(fields[0])] = (name[5], form, fields[1:])

    def points(self) -> dict[int, tuple[float, float, float]]:
        """Return the points of all grids in the basic system.

        Raises
        ------
        ValueError
            Naming the grid or the coordinate system.
        """
        found = {}
        for number in self.grids:
            x, y, z = self._point(number).tolist()
            found[number] = (x, y, z)
        return found

    def directions(self) -> Mapping[int, FloatArray]:
        """Return the axes (3, 3) of displacements of the grids whose displacements are not in the basic system.

        Raises
        ------
        ValueError
            Naming the grid or the coordinate system.
        """
        systems = {number: self._system_of(number, 6) for number in self.grids}
        return {k: self._system(s).directions(self._point(k)) for k, s in systems.items() if s != _BASIC}

    def _system_of(self, number: int, at: int) -> int:
        """Return the number of a grid's coordinate system in a field; that of GRDSET where it is empty."""
        own, common = ([*card, *[""] * 7][at] for card in (self.grids[number], self.default))
        return int(own or common or _BASIC)

    def _point(self, number: int) -> FloatArray:
        if number not in self._points:
            if number not in self.grids:
                raise ValueError(f"coordinate system: node {number} is missing")
            fields = [*self.grids[number], "", "", ""][3:6]
            system = self._system(self._system_of(number, 2))
            self._points[number] = system.position(_vector(fields))
        return self._points[number]

    def _system(self, number: int) -> CoordinateSystem:
        if number == _BASIC:
            return CoordinateSystem("R", np.zeros(3), np.eye(3))
        if number not in self._axes:
            if number not in self.systems:
                raise ValueError(f"coordinate system {number} is missing")
            if number in self._open:
                raise ValueError(f"coordinate system {number} refers to itself")
            if len(self._open) >= _MOST_NESTED:
                raise ValueError(f"coordinate systems: expected up to {_MOST_NESTED} in each other")
            self._open.append(number)
            kind, form, fields = self.systems[number]
            if form == _BY_GRIDS:
                numbers = [int(word) for word in fields if word]
                points = [self._point(grid) for grid in numbers]
            else:
                base = self._system(int(fields[0] or _BASIC))
                words = [*fields[1:], *[""] * 9]
                points = [base.position(_vector(words[k : k + 3])) for k in (0, 3, 6)]
            if len(points) != _POINTS:
                raise ValueError(f"coordinate system {number}: expected three points, found {len(points)}")
            self._open.pop()
            origin, along, plane = points
            self._axes[number] = CoordinateSystem(kind, origin, _axes(number, along - origin, plane - origin))
        return self._axes[number]


def _vector(words: Sequence[str]) -> FloatArray:
    found = np.array([float(nastran_number(word)) for word in words])
    if not np.isfinite(found).all():
        raise ValueError(f"expected finite numbers, found {' '.join(words)!r:.40}")
    return found


def _axes(number: int, along: FloatArray, plane: FloatArray) -> FloatArray:
    """Return the axes (3, 3) with z along a vector (3,), and another vector (3,) in the x-z plane."""
    length, size = np.linalg.norm(along), np.linalg.norm(plane)
    z = along / max(float(length), _TINY * float(size), _TINY)
    across = plane - (plane @ z) * z
    if not (length > _TINY * size and np.linalg.norm(across) > _TINY * size):
        raise ValueError(f"coordinate system {number}: its three points are on a line")
    x = across / np.linalg.norm(across)
    return np.array([x, np.cross(z, x), z])
