"""Mass matrix of a rigid body that is fixed to a point of a structure."""

import numpy as np
import scipy.linalg

from daq import FloatArray
from updater.structure import Body


def body_mass(body: Body) -> FloatArray:
    """Return the mass matrix (6, 6) of a rigid body about the point it is fixed to."""
    x, y, z = body.offset
    arm = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]], float)  # u_centre = u + arm @ rotation
    rigid = np.block([[np.eye(3), arm], [np.zeros((3, 3)), np.eye(3)]])
    own = scipy.linalg.block_diag(body.mass * np.eye(3), np.diag(body.inertia))
    return np.asarray(rigid.T @ own @ rigid)
