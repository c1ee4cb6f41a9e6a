"""Points on the faces of plates, shells and solids: displacements from the corners' shape functions.

Triangles are linear, quadrilaterals bilinear. Where the corners have rotations, the deflection across the face has the
linked term 1/2 sum N_i theta_i x (x - x_i), with which a quadratic deflection is exact. Where they have none, rotations
are those of the face.

The error of frequencies by such a mesh follows from the elements per wavelength. With bilinear elements of edge h and
consistent mass, the squared frequency at a wavenumber k is ``(k h)^2 / 12`` too large. The mean of ``(k h)^2`` over a
mode is read from its displacements: of a wave in two directions, it is twice the mean square difference along the edges
of faces over the mean square displacement.

References
----------
Hughes, T. J. R. (1987). The finite element method. Section 7.3: accuracy of semi-discrete frequencies.
Xu, Z. (1992). A thick-thin triangular plate element. Int. J. Numer. Methods Eng. 33, 963-973 (linked interpolation).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial import KDTree

from daq import FloatArray, IntArray
from updater.errors import ModelError

_OFF = 0.05  # of a face's size: distance from its plane within which a point is on it, as on a curved shell
_INSIDE = 1e-3  # share of a face's size by which a point may be outside its edges
_ITERATIONS = 20  # of Newton's method on a quadrilateral
_CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
_DIRECTIONS = 2  # of edges on a face
_PER_SQUARED_FREQUENCY = 1 / 12
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Faces:
    """Triangles and quadrilaterals between nodes."""

    nodes: FloatArray  #: (n_nodes, 3) [m]
    corners: IntArray  #: (n_faces, 4) nodes in order about each face; the last is -1 for a triangle

    @cached_property
    def _centres(self) -> FloatArray:
        used = (self.corners >= 0)[:, :, None]
        return np.asarray((self.nodes[self.corners] * used).sum(1) / used.sum(1))

    @cached_property
    def _reach(self) -> float:
        """Largest distance of a corner from the centre of its face [m]."""
        away = np.linalg.norm(self.nodes[self.corners] - self._centres[:, None], axis=2)
        return float(np.where(self.corners >= 0, away, 0).max(initial=0.0))

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self._centres)

    def on(self, points: FloatArray) -> bool:
        """Return whether all points (n, 3) are on faces."""
        return all(next(self._faces_at(point), None) is not None for point in points)

    def reader(self, points: FloatArray, dofs: IntArray, n_dofs: int) -> sparse.csr_array:
        """Return rows (6 n, n_dofs) that read displacements and rotations at points (n, 3).

        Parameters
        ----------
        dofs : (n_nodes, 6) row of each node's DOF, -1 where it is held

        Raises
        ------
        ModelError
            If a point is on no face.
        """
        rows, columns, values = [], [], []
        for number, point in enumerate(points):
            here = next(self._faces_at(point), None)
            if here is None:
                raise ModelError(f"the point {point.tolist()} lies on no member and on no face")
            block, corner = here.block(dofs), dofs[here.nodes].ravel()
            axis, column = np.nonzero((block != 0) & (corner >= 0))
            rows.append(6 * number + axis)
            columns.append(corner[column])
            values.append(block[axis, column])
        index = (np.concatenate(rows), np.concatenate(columns))
        return sparse.csr_array((np.concatenate(values), index), shape=(6 * len(points), n_dofs))

    def _faces_at(self, point: FloatArray) -> Iterator["_Place"]:
        """Yield the places of a point (3,) on faces that hold it."""
        near = self._tree.query_ball_point(point, self._reach * (1 + _OFF))
        for face in sorted(near, key=lambda f: float(np.linalg.norm(self._centres[f] - point))):
            corner = self.corners[face][self.corners[face] >= 0]
            place = _place(self.nodes[corner], corner, point)
            if place is not None:
                yield place

    def mesh_error(self, dofs: IntArray, shape: FloatArray) -> FloatArray:
        """Return the relative error of frequencies that linear elements of this mesh cause, (n_modes,).

        It is an estimate of its size, too large for elements of higher order. Faces count by their area.

        Parameters
        ----------
        dofs : (n_nodes, 6) row of each node's DOF, -1 where there is none
        shape : (n_dofs, n_modes)
        """
        moved = np.zeros((len(dofs), 3, shape.shape[1]))
        for axis in range(3):
            free = dofs[:, axis] >= 0
            moved[free, axis] = shape[dofs[free, axis]]
        last = np.where(self.corners[:, 3] >= 0, self.corners[:, 3], self.corners[:, 0])
        around = np.column_stack([self.corners[:, :3], last])
        diagonals = self.nodes[around[:, 2:]] - self.nodes[around[:, :2]]
        area = np.linalg.norm(np.cross(diagonals[:, 0], diagonals[:, 1]), axis=1)
        following = np.roll(around, -1, axis=1)
        weight = area[:, None] * (around != following)
        weight /= max(weight.sum(), _TINY)
        along, size = np.zeros(shape.shape[1]), np.zeros(shape.shape[1])
        for own, start, end in zip(weight.T, around.T, following.T, strict=True):
            along += own @ np.sum((moved[start] - moved[end]) ** 2, axis=1)
            size += own @ np.sum(moved[start] ** 2, axis=1)
        return np.asarray(_PER_SQUARED_FREQUENCY / 2 * _DIRECTIONS * along / np.maximum(size, _TINY))


@dataclass(frozen=True, eq=False)
class _Place:
    """A point on a face of k corners."""

    nodes: IntArray  #: (k,)
    weight: FloatArray  #: (k,) shape functions [-]
    slope: FloatArray  #: (k, 3) their gradients in the face [1/m]
    away: FloatArray  #: (k, 3) from each corner to the point [m]
    normal: FloatArray  #: (3,)

    def block(self, dofs: IntArray) -> FloatArray:
        """Return displacements and rotations (6, 6 k) from the corners' DOFs."""
        k, normal = len(self.nodes), self.normal
        block = np.zeros((6, k, 6))
        for i in range(k):
            block[:3, i, :3] = self.weight[i] * np.eye(3)
        if (dofs[self.nodes, 3:] >= 0).any():
            for i in range(k):
                block[3:, i, 3:] = self.weight[i] * np.eye(3)
                # n . (theta x r) = theta . (r x n), half of it
                block[:3, i, 3:] = 0.5 * self.weight[i] * np.outer(normal, np.cross(self.away[i], normal))
        else:  # theta = n x grad(u_n) reversed in the face, about the normal half the curl
            for i in range(k):
                turned = np.cross(normal, self.slope[i])
                block[3:, i, :3] = -np.outer(turned, normal) + 0.5 * np.outer(normal, turned)
        return block.reshape(6, 6 * k)


def _place(corners: FloatArray, nodes: IntArray, point: FloatArray) -> _Place | None:
    """Return where a point (3,) is on a face of corners (k, 3), None if it is not on it."""
    diagonals = corners[2] - corners[0], (corners[3] if len(corners) == 4 else corners[0]) - corners[1]
    normal = np.cross(*diagonals)
    length = float(np.linalg.norm(normal))
    size = float(np.linalg.norm(diagonals[0]))
    if length <= 1e-12 * size**2:
        return None
    normal = normal / length
    away = point - corners
    if abs(float(away.mean(0) @ normal)) > _OFF * size:
        return None
    first = diagonals[0] / size
    axes = np.array([first, np.cross(normal, first)])
    flat, at = (corners - corners[0]) @ axes.T, (point - corners[0]) @ axes.T
    found = _triangle(flat, at) if len(corners) == 3 else _quadrilateral(flat, at)
    if found is None:
        return None
    weight, slope = found
    return _Place(nodes, weight, slope @ axes, away, normal)


def _triangle(flat: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return shape functions (3,) and gradients (3, 2) at a point of the plane, None outside."""
    inverse = np.linalg.inv(np.vstack([flat.T, np.ones(3)]))
    weight = inverse @ np.append(at, 1.0)
    return (weight, inverse[:, :2]) if weight.min() >= -_INSIDE else None


def _quadrilateral(flat: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return shape functions (4,) and gradients (4, 2) at a point of the plane, None outside."""
    local = np.zeros(2)
    for _ in range(_ITERATIONS):
        side = 1 + _CORNERS * local
        weight = side.prod(1) / 4
        slope = _CORNERS * side[:, ::-1] / 4
        jacobian = slope.T @ flat
        if abs(float(np.linalg.det(jacobian))) < 1e-14 * float(np.abs(flat).max()) ** 2:
            return None
        step = np.linalg.solve(jacobian.T, at - weight @ flat)
        if np.abs(step).max() < 1e-12:
            break
        local = np.clip(local + step, -3.0, 3.0)
    if np.abs(local).max() > 1 + 2 * _INSIDE:
        return None
    return weight, np.asarray(np.linalg.solve(jacobian, slope.T).T, float)
