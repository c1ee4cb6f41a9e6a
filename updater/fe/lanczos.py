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
    """Vectors that are orthonormal in an inner product."""

    def __init__(self, inner: sparse.csc_array) -> None:
        self._inner = inner
        self.vectors = np.zeros((inner.shape[0], 0), order="F")
        self._weighed = self.vectors

    def beside(self, block: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the components (k, b) of vectors (n, b) in the basis, and what is left of the vectors."""
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
        """Return the same, beside the basis again: small vectors made long are not orthogonal to it to rounding."""
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
    block, _ = basis.next_block(solve(mass @ start))  # K^-1 M leaves nothing of what has no inertia
    while basis.vectors.shape[1] < _MOST * max(n, _BLOCK):
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
