"""State-space models of all orders from one leading subspace, by shift invariance.

References
----------
Döhler, M., Mevel, L. (2012). Fast multi-order computation of system matrices in subspace-based system identification.
Control Engineering Practice 20(9), 882-894.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from daq import FloatArray
from oma.types import ComplexArray

_LEAST_VALUE = 1e-12  # of the largest singular value: smaller ones are rounding errors


@dataclass(frozen=True, eq=False, kw_only=True)
class Subspace:
    """Leading subspace of the block Hankel matrix of correlations."""

    left: FloatArray  #: (block_rows * n_channels, rank) observability matrix of the largest order
    values: FloatArray  #: (rank,) canonical correlations of past and future, falling [-]
    right: FloatArray  #: (block_rows * n_channels, rank): the Hankel matrix times `right` is `left` times `values`
    n_channels: int
    rate: float  #: [Hz]

    @cached_property
    def basis(self) -> "Basis":
        """The subspace in coordinates in which all orders are parts of one model."""
        usable = max(int(np.count_nonzero(self.values > _LEAST_VALUE * self.values[0])), 1)
        left, weight = self.left[:, :usable], self.right[:, :usable] / self.values[:usable]
        up, factor = np.linalg.qr(left[: -self.n_channels])
        left, weight = (np.linalg.solve(factor.T, matrix.T).T for matrix in (left, weight))
        return Basis(up=up, down=left[self.n_channels :], output=left[: self.n_channels], weight=weight)


@dataclass(frozen=True, eq=False, kw_only=True)
class Basis:
    """Observability matrix whose columns are orthonormal but for the last block row.

    It is the matrix of a subspace times an upper triangular one. The leading columns thus span the leading subspace,
    and the state matrix of each order is the leading block of the largest one.
    """

    up: FloatArray  #: (n_rows - n_channels, rank) all but the last block row, orthonormal columns
    down: FloatArray  #: (n_rows - n_channels, rank) all but the first block row
    output: FloatArray  #: (n_channels, rank) the first block row
    weight: FloatArray  #: (n_columns, rank): the Hankel matrix times it is the observability matrix


@dataclass(frozen=True, eq=False, kw_only=True)
class Realisation:
    """State-space model of one order, in modal coordinates."""

    order: int
    rate: float  #: [Hz]
    eigenvalue: ComplexArray  #: (order,) of the discrete state matrix
    vector: ComplexArray  #: (order, order) right eigenvectors, columns
    shape: ComplexArray  #: (order, n_channels) observed eigenvectors

    @cached_property
    def dual(self) -> ComplexArray:
        """Left eigenvectors, rows, (order, order)."""
        return np.linalg.inv(self.vector).astype(np.complex128)

    @cached_property
    def continuous(self) -> ComplexArray:
        """Eigenvalues in continuous time [rad/s]."""
        result: ComplexArray = (np.log(self.eigenvalue) * self.rate).astype(np.complex128)
        return result


def realisations(space: Subspace, orders: range) -> list[Realisation]:
    """Return the models of all orders by shift invariance of the observability matrix.

    Parameters
    ----------
    space : Subspace
    orders : range

    Returns
    -------
    list of Realisation
        Those orders that the rank of the subspace allows.
    """
    state = space.basis.up.T @ space.basis.down
    return [_realisation(space, state[:n, :n]) for n in orders if n <= len(state)]


def _realisation(space: Subspace, state: FloatArray) -> Realisation:
    """Return the model of a state matrix (order, order)."""
    eigenvalue, vector = (part.astype(np.complex128) for part in np.linalg.eig(state))
    return Realisation(
        order=len(state),
        rate=space.rate,
        eigenvalue=eigenvalue,
        vector=vector,
        shape=(space.basis.output[:, : len(state)] @ vector).T,
    )
