"""Lowest modes by block Lanczos on K^-1 M, all vectors kept and orthogonalised against each other.

Right-hand sides are solved for four at a time, half the cost of one by one with a large factor, and modes of equal
frequency, which a symmetric structure has, come together instead of by rounding.

References
----------
Grimes, R. G., Lewis, J. G. & Simon, H. D. (1994). A shifted block Lanczos algorithm for solving sparse symmetric
generalized eigenproblems. SIAM J. Matrix Anal. Appl. 15(1), 228-272.
"""

import numpy as np
from scipy import sparse

from daq import FloatArray
from updater.errors import ModelError
from updater.fe.solver import Solve

_BLOCK = 4
_TOLERANCE = 1e-9  # of a Ritz vector's residual over its value: the value errs by the square of that
_MOST = 20  # vectors to one mode, before giving up
_DEPENDENT = 1e-14  # of the largest squared length in a block: what is less is rounding


class _Basis:
    """Vectors that are orthonormal in M."""

    def __init__(self, mass: sparse.csc_array) -> None:
        self._mass = mass
        self.vectors = np.zeros((mass.shape[0], 0), order="F")
        self._weighed = self.vectors

    def beside(self, block: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the components (k, b) of vectors (n, b) in the basis, and what is left of the vectors."""
        components = self._weighed.T @ block
        block = block - self.vectors @ components
        again = self._weighed.T @ block  # once is not enough for rounding, twice is
        return components + again, block - self.vectors @ again

    def normalised(self, block: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return vectors orthonormal in M that span a block (n, b), and the root (b', b): block = vectors @ root."""
        square, turn = np.linalg.eigh(block.T @ (self._mass @ block))
        kept = square > _DEPENDENT * max(square[-1], 0.0)
        length = np.sqrt(square[kept])
        return block @ (turn[:, kept] / length), length[:, None] * turn[:, kept].T

    def next_block(self, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the same, beside the basis again: small vectors made long are not orthogonal to it to rounding."""
        block, root = self.normalised(rest)
        block, again = self.normalised(self.beside(block)[1])
        return block, again @ root

    def extend(self, block: FloatArray) -> FloatArray:
        """Add vectors (n, b) and return them weighed with M."""
        weighed = np.asarray(self._mass @ block)
        self.vectors = np.concatenate([self.vectors, block], axis=1)
        self._weighed = np.concatenate([self._weighed, weighed], axis=1)
        return weighed


def block_lanczos(solve: Solve, mass: sparse.csc_array, n: int) -> tuple[FloatArray, FloatArray]:
    """Return omega^2, ascending, and mass-normalised shapes (n_dofs, n) of the lowest modes.

    Parameters
    ----------
    solve : x = K^-1 b for b (n_dofs, k)
    mass : (n_dofs, n_dofs), may be semidefinite: the modes without inertia never enter
    n : number of modes; fewer are returned where fewer have inertia

    Raises
    ------
    ModelError
        If they do not converge.
    """
    basis, projected = _Basis(mass), np.zeros((0, 0))
    start = np.random.default_rng(0).standard_normal((mass.shape[0], _BLOCK))
    block, _ = basis.next_block(solve(mass @ start))  # K^-1 M leaves nothing of what has no inertia
    while basis.vectors.shape[1] < _MOST * max(n, _BLOCK):
        components, rest = basis.beside(solve(basis.extend(block)))
        projected = _bordered(projected, components)
        value, turn = np.linalg.eigh(projected)
        value, turn = value[: -n - 1 : -1], turn[:, : -n - 1 : -1]
        size = block.shape[1]
        block, root = basis.next_block(rest)
        error = np.linalg.norm(root @ turn[-size:], axis=0)
        if (len(value) == n and (error < _TOLERANCE * value).all()) or np.linalg.norm(root) < _TOLERANCE * value[-1]:
            return 1 / value, basis.vectors @ turn
    raise ModelError(f"{n} modes do not converge: the matrices are too ill-conditioned")


def _bordered(projected: FloatArray, components: FloatArray) -> FloatArray:
    """Return a symmetric matrix with more columns (k, b), their last b rows on the diagonal."""
    old, size = len(projected), components.shape[1]
    new = np.zeros((old + size, old + size))
    new[:old, :old] = projected
    new[:, old:] = components
    new[old:, :old] = components[:old].T
    return (new + new.T) / 2
