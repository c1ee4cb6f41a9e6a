"""Lowest modes by block Lanczos on K^-1 M, all vectors kept and orthogonalised against each other.

K^-1 M is symmetric in the inner product of M and in that of K. The mass gives one as long as it is semidefinite; with
bodies of negative mass it is not, and the stiffness, which is positive definite, takes its place.

Right-hand sides are solved for four at a time, half the cost of one by one with a large factor, and modes of equal
frequency, which a symmetric structure has, come together instead of by rounding.

References
----------
Grimes, R. G., Lewis, J. G. & Simon, H. D. (1994). A shifted block Lanczos algorithm for solving sparse symmetric
generalized eigenproblems. SIAM J. Matrix Anal. Appl. 15(1), 228-272.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy import sparse

from daq import FloatArray
from updater.errors import MechanismError, ModelError
from updater.fe.factorization import Solve, factorise

_BLOCK = 4
_TOLERANCE = 1e-9  # of a Ritz vector's residual over its value: the value errs by the square of that
_MAX = 20  # vectors to one mode, before giving up
_DEPENDENT = 1e-14  # relative to the largest squared length in a block: less is rounding


class _Basis:
    """Vectors that are orthonormal in an inner product."""

    def __init__(self, inner: sparse.csc_array) -> None:
        self._inner = inner
        self.vectors = np.zeros((inner.shape[0], 0), order="F")
        self._weighed = self.vectors

    def beside(self, block: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the components (k, b) of vectors (n, b) in the basis, and the residuals of the vectors."""
        components = self._weighed.T @ block
        block = block - self.vectors @ components
        again = self._weighed.T @ block  # once is not enough for rounding, twice is
        return components + again, block - self.vectors @ again

    def normalised(self, block: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return orthonormal vectors that span a block (n, b), and the root (b', b): block = vectors @ root."""
        square, turn = np.linalg.eigh(block.T @ (self._inner @ block))
        kept = square > _DEPENDENT * max(square[-1], 0.0)
        length = np.sqrt(square[kept])
        return block @ (turn[:, kept] / length), length[:, None] * turn[:, kept].T

    def next_block(self, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the same, orthogonalised again: scaled-up small vectors are not orthogonal to rounding."""
        block, root = self.normalised(rest)
        block, again = self.normalised(self.beside(block)[1])
        return block, again @ root

    def extend(self, block: FloatArray) -> None:
        """Add orthonormal vectors (n, b)."""
        self.vectors = np.concatenate([self.vectors, block], axis=1)
        self._weighed = np.concatenate([self._weighed, np.asarray(self._inner @ block)], axis=1)


def block_lanczos(
    solve: Solve, mass: sparse.csc_array, n: int, inner: sparse.csc_array
) -> tuple[FloatArray, FloatArray]:
    """Return the largest and the least eigenvalues 1/omega^2 of K^-1 M, descending, and their vectors.

    Parameters
    ----------
    solve : x = K^-1 b for b (n_dofs, k)
    mass : (n_dofs, n_dofs), may be singular: the modes without inertia never enter
    n : number of the largest; fewer are returned where fewer have inertia
    inner : (n_dofs, n_dofs) inner product in which the vectors are orthonormal: the mass if it is semidefinite, else
        the stiffness

    Returns
    -------
    (k,) eigenvalues and (n_dofs, k) vectors, the last ones of the most negative eigenvalue where there is one

    Raises
    ------
    ModelError
        If they do not converge.
    """
    basis, projected = _Basis(inner), np.zeros((0, 0))
    start = np.random.default_rng(0).standard_normal((mass.shape[0], _BLOCK))
    block, _ = basis.next_block(solve(mass @ start))  # K^-1 M removes parts without inertia
    while basis.vectors.shape[1] < _MAX * max(n, _BLOCK):
        basis.extend(block)
        components, rest = basis.beside(solve(mass @ block))
        projected = _bordered(projected, components)
        every, turns = np.linalg.eigh(projected)
        value, turn = every[: -n - 1 : -1], turns[:, : -n - 1 : -1]
        size = block.shape[1]
        block, root = basis.next_block(rest)
        error = np.linalg.norm(root @ turn[-size:], axis=0)
        exhausted = np.linalg.norm(root) < _TOLERANCE * abs(value[-1])
        if (len(value) == n and (error < _TOLERANCE * value).all()) or exhausted:
            if every[0] < 0 and len(every) > len(value):
                value, turn = np.append(value, every[0]), np.column_stack([turn, turns[:, 0]])
            return value, basis.vectors @ turn
    raise ModelError(f"{n} modes do not converge: the matrices are too ill-conditioned")


def _bordered(projected: FloatArray, components: FloatArray) -> FloatArray:
    """Return a symmetric matrix with more columns (k, b), their last b rows on the diagonal."""
    old, size = len(projected), components.shape[1]
    new = np.zeros((old + size, old + size))
    new[:old, :old] = projected
    new[:, old:] = components
    new[old:, :old] = components[:old].T
    return (new + new.T) / 2


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
    """A mass matrix whose softest shape (n_dofs,) has a negative kinetic energy: too much mass was removed."""

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
    name : of the structure, for messages
    removed : whether masses were taken off, so that the mass matrix may be indefinite
    pardiso : as for `factorise`

    Raises
    ------
    MechanismError
        If it is a mechanism or free, so that its stiffness is singular.
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
    """Return a shape's strain energy relative to that of all DOFs moving alone [-]."""
    return float(shape @ (stiffness @ shape) / (stiffness.diagonal() @ shape**2))


def _all(stiffness: sparse.csc_array, mass: sparse.csc_array) -> tuple[FloatArray, FloatArray]:
    """Return 1/omega^2, descending, and vectors orthonormal in K of all modes, by M b = omega^-2 K b."""
    factorise(stiffness)  # raises the reason
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
