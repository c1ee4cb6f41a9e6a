"""The lowest modes of a sparse model, with a mass that may be semidefinite.

K b = omega^2 M b is solved by Lanczos on K^-1 M, or as all of M b = omega^-2 K b if it is small.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy import sparse

from daq import FloatArray
from updater.errors import MechanismError, ModelError
from updater.fe.lanczos import block_lanczos
from updater.fe.solver import factorise

_FREE = 1e-14  # relative strain energy that is rounding: a bending mode's is about (element / member length)^4
_DENSE = 60  # DOFs up to which all modes are solved for at once
_MASSLESS = 1e-13  # least omega^-2 over the largest of a mode with inertia
_LOOSE = "it can move without deforming: a support is missing"


@dataclass(frozen=True, eq=False, kw_only=True)
class Modes:
    """Undamped modes of a model."""

    frequency: FloatArray  #: (n_modes,) [Hz], ascending
    shape: FloatArray  #: (n_dofs, n_modes) mass-normalised [1/sqrt(kg)]

    @property
    def omega(self) -> FloatArray:
        """Angular frequencies (n_modes,) [rad/s]."""
        return 2 * np.pi * self.frequency


def lowest_modes(
    stiffness: sparse.csc_array, mass: sparse.csc_array, n: int, name: str, *, pardiso: bool | None = None
) -> Modes:
    """Return the lowest `n` modes of a structure that is held; a semidefinite mass matrix is fine.

    Parameters
    ----------
    stiffness, mass : (n_dofs, n_dofs)
    n : number of modes
    name : of the structure, for what is raised
    pardiso : as for `factorise`

    Raises
    ------
    MechanismError
        If it is a mechanism or stands free, so that its stiffness is singular.
    ModelError
        If it buckles under its preload, or has fewer modes.
    """
    few = stiffness.shape[0] <= max(6 * n, _DENSE)
    try:
        value, shape = _all(stiffness, mass) if few else block_lanczos(factorise(stiffness, pardiso=pardiso), mass, n)
    except ModelError as error:
        raise type(error)(f"{name}: {error}") from error
    if value[0] <= 0 or strain(stiffness, shape[:, 0]) <= _FREE:
        raise MechanismError(f"{name}: {_LOOSE}")
    if len(value) < n:
        raise ModelError(f"{name}: expected {n} modes, found {len(value)}: the mesh is too coarse")
    return Modes(frequency=np.sqrt(value[:n]) / (2 * np.pi), shape=_signed(shape[:, :n]))


def strain(stiffness: sparse.csc_array, shape: FloatArray) -> float:
    """Return a shape's strain energy over what it would be if every DOF moved alone [-]."""
    return float(shape @ (stiffness @ shape) / (stiffness.diagonal() @ shape**2))


def _all(stiffness: sparse.csc_array, mass: sparse.csc_array) -> tuple[FloatArray, FloatArray]:
    """Return omega^2 and shapes of all modes that have inertia, by M b = omega^-2 K b."""
    factorise(stiffness)  # says what is wrong with it
    try:
        inverse, vector = scipy.linalg.eigh(mass.toarray(), stiffness.toarray())
    except np.linalg.LinAlgError as error:  # singular but for rounding, which a processor's own decides
        raise MechanismError(_LOOSE) from error
    inert = np.flatnonzero(inverse > _MASSLESS * inverse[-1])[::-1]
    # orthonormal in M to rounding, which division by the smallest omega^-2 is not: then M^-1 = sum b b^T exactly
    gram = vector[:, inert].T @ (mass @ vector[:, inert]) / np.sqrt(np.outer(inverse[inert], inverse[inert]))
    root = np.linalg.cholesky(gram)
    return 1 / inverse[inert], scipy.linalg.solve_triangular(
        root, (vector[:, inert] / np.sqrt(inverse[inert])).T, lower=True
    ).T


def _signed(shape: FloatArray) -> FloatArray:
    """Turn each mode so that its largest entry is positive: the same on every machine."""
    peak = shape[np.argmax(np.abs(shape), axis=0), np.arange(shape.shape[1])]
    return np.asarray(shape * np.sign(peak))
