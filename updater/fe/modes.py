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


class NegativeMassError(ModelError):
    """A mass whose softest shape (n_dofs,) has a negative kinetic energy: more was taken off than moves."""

    def __init__(self, message: str, shape: FloatArray) -> None:
        super().__init__(message)
        self.shape = shape


def lowest_modes(
    stiffness: sparse.csc_array,
    mass: sparse.csc_array,
    n: int,
    name: str,
    *,
    removed: bool = False,
    pardiso: bool | None = None,
) -> Modes:
    """Return the lowest `n` modes of a structure that is held; a semidefinite mass matrix is fine.

    A point mass that was taken off makes the consistent mass indefinite: shapes so local that it exceeds all that they
    move have an imaginary frequency, of large absolute value. The modes below that are those of the structure without
    the mass, and they alone are returned.

    Parameters
    ----------
    stiffness, mass : (n_dofs, n_dofs)
    n : number of modes
    name : of the structure, for what is raised
    removed : whether masses were taken off, so that the mass matrix may be indefinite
    pardiso : as for `factorise`

    Raises
    ------
    MechanismError
        If it is a mechanism or stands free, so that its stiffness is singular.
    NegativeMassError
        If an imaginary frequency is lower than the first natural frequency.
    ModelError
        If it buckles under its preload, or has fewer modes.
    """
    few = stiffness.shape[0] <= max(6 * n, _DENSE)
    try:
        if few:
            inverse, vector = _all(stiffness, mass)
        else:
            inner = stiffness if removed else mass
            inverse, vector = block_lanczos(factorise(stiffness, pardiso=pardiso), mass, n, inner)
    except ModelError as error:
        raise type(error)(f"{name}: {error}") from error
    if -inverse[-1] > max(inverse[0], 0.0):
        raise NegativeMassError(f"{name}: more mass is taken off than there is", vector[:, -1])
    inert = inverse > _MASSLESS * inverse[0]
    inverse, vector = inverse[inert], vector[:, inert]
    shape = _mass_normalised(inverse, vector, mass) if few or removed else vector
    if not len(inverse) or strain(stiffness, shape[:, 0]) <= _FREE:
        raise MechanismError(f"{name}: {_LOOSE}")
    if len(inverse) < n:
        raise ModelError(f"{name}: expected {n} modes, found {len(inverse)}: the mesh is too coarse")
    return Modes(frequency=np.sqrt(1 / inverse[:n]) / (2 * np.pi), shape=_signed(shape[:, :n]))


def strain(stiffness: sparse.csc_array, shape: FloatArray) -> float:
    """Return a shape's strain energy over what it would be if every DOF moved alone [-]."""
    return float(shape @ (stiffness @ shape) / (stiffness.diagonal() @ shape**2))


def _all(stiffness: sparse.csc_array, mass: sparse.csc_array) -> tuple[FloatArray, FloatArray]:
    """Return 1/omega^2, descending, and vectors orthonormal in K of all modes, by M b = omega^-2 K b."""
    factorise(stiffness)  # says what is wrong with it
    try:
        inverse, vector = scipy.linalg.eigh(mass.toarray(), stiffness.toarray())
    except np.linalg.LinAlgError as error:  # singular but for rounding, which a processor's own decides
        raise MechanismError(_LOOSE) from error
    return inverse[::-1], vector[:, ::-1]


def _mass_normalised(inverse: FloatArray, vector: FloatArray, mass: sparse.csc_array) -> FloatArray:
    """Return vectors (n_dofs, n) that are orthonormal in K as ones that are in M, to rounding.

    Division by the root of the smallest 1/omega^2 alone is not exact; with it, M^-1 = sum b b^T over all modes.
    """
    gram = vector.T @ (mass @ vector) / np.sqrt(np.outer(inverse, inverse))
    root = np.linalg.cholesky(gram)
    scaled = (vector / np.sqrt(inverse)).T
    return np.asarray(scipy.linalg.solve_triangular(root, scaled, lower=True).T)


def _signed(shape: FloatArray) -> FloatArray:
    """Turn each mode so that its largest entry is positive: the same on every machine."""
    peak = shape[np.argmax(np.abs(shape), axis=0), np.arange(shape.shape[1])]
    return np.asarray(shape * np.sign(peak))
