"""Errors that the frequencies of a finite element model are expected to have: by the mesh of faces and by walls.

A mesh makes all frequencies too high, the inertia of a wall lowers all that strain one of its springs. Each of these
errors has one factor for all modes; the mesh also has an error of each mode.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from updater.fe import Model, Modes
from updater.reference.segment_sensitivity import wall_errors

#: times the estimated error of a mesh: standard deviation of that part of the frequencies' error that has one factor
#: for all modes; measured on a table of plates (docs/validation/model/mesh_error.md)
COMMON_MESH_ERROR = 1.5


@dataclass(frozen=True, eq=False, kw_only=True)
class FrequencyError:
    """Standard deviations of ln f of a model's modes."""

    mesh: FloatArray  #: (n_modes,) by the mesh of faces, of each mode alone
    walls: FloatArray  #: (n_modes, n_springs) by the inertia of walls at each spring, with one factor for all modes

    @property
    def common(self) -> FloatArray:
        """Errors (n_modes, 1 + n_springs) that have one factor each for all modes: of the mesh, and of each spring."""
        return np.column_stack([COMMON_MESH_ERROR * self.mesh, self.walls])

    @property
    def covariance(self) -> FloatArray:
        """Covariance (n_modes, n_modes) of ln f."""
        return np.asarray(mesh_covariance(self.mesh) + self.walls @ self.walls.T)

    @property
    def std(self) -> FloatArray:
        """Standard deviation (n_modes,) of ln f of each mode, without the mesh's part that is common to all modes."""
        return np.asarray(np.sqrt(self.mesh**2 + (self.walls**2).sum(1)))

    def only(self, modes: IndexArray) -> "FrequencyError":
        """Return the errors of some modes."""
        return FrequencyError(mesh=self.mesh[modes], walls=self.walls[modes])


def mesh_covariance(mesh_error: FloatArray) -> FloatArray:
    """Return the covariance (n, n) of ln f by a mesh: an error of each mode (n,), and one with a factor for all."""
    common = COMMON_MESH_ERROR * mesh_error
    return np.asarray(np.diag(mesh_error**2) + np.outer(common, common))


def frequency_error(model: Model, modes: Modes) -> FrequencyError:
    """Return the errors that the frequencies of a model are expected to have.

    Parameters
    ----------
    model : with the springs of walls in its structure
    modes : of it
    """
    return FrequencyError(mesh=model.mesh_error(modes.shape), walls=wall_errors(model, modes))
