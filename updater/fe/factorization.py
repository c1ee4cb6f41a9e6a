"""Factors of a sparse symmetric positive definite matrix: PyPardiso's if it is installed, else SuperLU's.

Both keep to the symmetry: SuperLU orders A + A^T by minimum degree and takes its pivots from the diagonal, PARDISO
makes a Cholesky factor of an ordering by nested dissection, which fills less the larger a lattice is.
"""

import weakref
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from daq import FloatArray
from updater.errors import MechanismError, ModelError

Solve = Callable[[FloatArray], FloatArray]
_SINGULAR = "the stiffness is singular: a support or a member is missing"
_INDEFINITE = "the stiffness is indefinite: a member is compressed beyond buckling, or it is no structure's"
_ROUNDING = 1e-6  # of a DOF's own stiffness: a negative pivot that is less is zero
LARGE = 20_000  # DOFs from which PARDISO gains more than its start costs


def factorise(matrix: sparse.csc_array, *, pardiso: bool | None = None) -> Solve:
    """Return a function that solves A x = b for b (n,) or (n, k).

    Parameters
    ----------
    matrix : (n, n), symmetric, positive definite
    pardiso : whether to use PyPardiso (`pip install 'modalwatch[cholesky]'`); None: for large matrices, if it is there

    Raises
    ------
    MechanismError
        If the matrix is singular.
    ModelError
        If it is indefinite.
    """
    if pardiso is None:
        pardiso = matrix.shape[0] >= LARGE and find_spec("pypardiso") is not None
    return _pardiso(matrix) if pardiso else _superlu(matrix)


def _superlu(matrix: sparse.csc_array) -> Solve:
    try:
        factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise MechanismError(_SINGULAR) from error
    # pivots from the diagonal have the signs of the eigenvalues (Sylvester), to rounding those of a mechanism
    own = np.abs(matrix.diagonal()[np.argsort(factor.perm_c)])
    pivot = factor.U.diagonal() / np.maximum(own, np.finfo(float).tiny)
    if (pivot <= 0).any():
        raise ModelError(_INDEFINITE) if pivot.min() < -_ROUNDING else MechanismError(_SINGULAR)
    return factor.solve


def _pardiso(matrix: sparse.csc_array) -> Solve:
    from pypardiso import PyPardisoSolver  # an extra
    from pypardiso.pardiso_wrapper import PyPardisoError

    upper = sparse.csr_matrix(sparse.triu(matrix))
    upper.sort_indices()
    solver = PyPardisoSolver(mtype=2)  # real, symmetric, positive definite
    try:
        solver.factorize(upper)
    except (PyPardisoError, ValueError) as error:
        raise MechanismError("the stiffness is singular or indefinite: a support or a member is missing") from error

    def solve(right: FloatArray) -> FloatArray:
        return np.asarray(solver.solve(upper, right), float)

    weakref.finalize(solve, solver.free_memory, everything=True)  # memory of MKL, unknown to Python
    return solve
