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


@dataclass(frozen=True, eq=False, kw_only=True)
class Subspace:
    """Leading subspace of the block Hankel matrix of correlations, and the parts required by shift invariance."""

    left: FloatArray  #: (block_rows * n_channels, rank) observability matrix of the largest order
    values: FloatArray  #: (rank,) canonical correlations of past and future, falling [-]
    right: FloatArray  #: (block_rows * n_channels, rank): the Hankel matrix times `right` is `left` times `values`
    n_channels: int
    rate: float  #: [Hz]

    @property
    def up(self) -> FloatArray:
        """All but the last block row of `left`."""
        return self.left[: -self.n_channels]

    @property
    def down(self) -> FloatArray:
        """All but the first block row of `left`."""
        return self.left[self.n_channels :]

    @property
    def output(self) -> FloatArray:
        """The first block row of `left`, (n_channels, rank)."""
        return self.left[: self.n_channels]


@dataclass(frozen=True, eq=False, kw_only=True)
class Realisation:
    """State-space model of one order, in modal coordinates."""

    order: int
    rate: float  #: [Hz]
    eigenvalue: ComplexArray  #: (order,) of the discrete state matrix
    vector: ComplexArray  #: (order, order) right eigenvectors, columns
    gram: FloatArray  #: (order, order) up^T up
    shape: ComplexArray  #: (order, n_channels) observed eigenvectors

    @cached_property
    def dual(self) -> ComplexArray:
        """Left eigenvectors, rows, times the inverse of `gram`, (order, order)."""
        return np.linalg.inv(self.gram @ self.vector).astype(np.complex128)

    @property
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
    gram, cross = space.up.T @ space.up, space.up.T @ space.down
    usable = [n for n in orders if n <= len(space.values) and space.values[n - 1] > 1e-12 * space.values[0]]
    return [_realisation(space, gram[:n, :n], cross[:n, :n]) for n in usable]


def _realisation(space: Subspace, gram: FloatArray, cross: FloatArray) -> Realisation:
    """Solve the shift invariance of one order by least squares."""
    eigenvalue, vector = (part.astype(np.complex128) for part in np.linalg.eig(np.linalg.solve(gram, cross)))
    return Realisation(
        order=len(gram),
        rate=space.rate,
        eigenvalue=eigenvalue,
        vector=vector,
        gram=gram,
        shape=(space.output[:, : len(gram)] @ vector).T,
    )
