"""Error of frequencies by the mesh of plates, shells and solids: elements per wavelength.

With bilinear elements of edge h and consistent mass, the squared frequency at a wavenumber k is ``(k h)^2 / 12``
too large. The mean of ``(k h)^2`` over a mode is read from its displacements: of a wave in two directions, it is twice
the mean square difference along the edges of faces over the mean square displacement.

References
----------
Hughes, T. J. R. (1987). The finite element method. Section 7.3: accuracy of semi-discrete frequencies.
"""

import numpy as np

from daq import FloatArray, IntArray

_DIRECTIONS = 2  # of edges on a face
_PER_SQUARED_FREQUENCY = 1 / 12
_TINY = 1e-300


def mesh_error(corners: IntArray, dofs: IntArray, shape: FloatArray) -> FloatArray:
    """Return the relative error of frequencies that linear elements of this mesh cause, (n_modes,).

    It is an estimate of its size, too large for elements of higher order.

    Parameters
    ----------
    corners : (n_faces, 4) nodes about each face; the last is -1 for a triangle
    dofs : (n_nodes, 6) row of each node's DOF, -1 where there is none
    shape : (n_dofs, n_modes)
    """
    moved = np.zeros((len(dofs), 3, shape.shape[1]))
    for axis in range(3):
        free = dofs[:, axis] >= 0
        moved[free, axis] = shape[dofs[free, axis]]
    closing = np.where(corners[:, 3] >= 0, corners[:, 3], corners[:, 0])
    around = np.column_stack([corners[:, :3], closing])
    first, second = around.ravel(), np.roll(around, -1, axis=1).ravel()
    apart = first != second
    along = np.sum((moved[first[apart]] - moved[second[apart]]) ** 2, axis=1).mean(axis=0)
    size = np.sum(moved[np.unique(around)] ** 2, axis=1).mean(axis=0)
    return np.asarray(_PER_SQUARED_FREQUENCY / 2 * _DIRECTIONS * along / np.maximum(size, _TINY))
