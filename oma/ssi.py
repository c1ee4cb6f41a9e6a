"""Covariance-driven stochastic subspace identification, all orders from one decomposition.

References
----------
Peeters, B., De Roeck, G. (1999). Reference-based stochastic subspace identification for output-only modal analysis.
Mechanical Systems and Signal Processing 13(6), 855-878.
Döhler, M., Mevel, L. (2012). Fast multi-order computation of system matrices in subspace-based system identification.
Control Engineering Practice 20(9), 882-894.
Larimore, W. E. (1990). Canonical variate analysis in identification, filtering, and adaptive control. Proceedings of
the 29th IEEE Conference on Decision and Control, 596-604.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import linalg

from daq import FloatArray
from oma.correlation import CorrelationSums
from oma.estimate import ComplexArray
from oma.selection import Selection


@dataclass(frozen=True, kw_only=True)
class CovarianceSSI:
    """Options of covariance-driven SSI."""

    block_rows: int | None = None  #: lags in rows and in columns of the block Hankel matrix; None: `rows` chooses [-]
    min_order: int = 2  #: smallest model order [-]
    max_order: int = 50  #: largest model order [-]
    order_step: int = 2  #: from one order to the next [-]
    n_blocks: int = 30  #: blocks of time, whose scatter gives the uncertainty [-]
    decimation: int = 5  #: ratio of one rate to the next lower one [-]
    min_cycles: float = 100.0  #: periods in the window below which no mode is sought, unless a band is given [-]
    selection: Selection = field(default_factory=Selection)  #: what passes for a mode

    def __post_init__(self) -> None:
        """Refuse what cannot work."""
        if self.block_rows is not None and self.block_rows < 2:
            raise ValueError(f"block_rows: expected at least 2, found {self.block_rows}")
        if not 2 <= self.min_order <= self.max_order or self.order_step < 1:
            raise ValueError(
                f"orders: expected 2 <= min <= max and a positive step, found {self.min_order}, {self.max_order}, "
                f"{self.order_step}"
            )
        if self.n_blocks < 4:
            raise ValueError(f"n_blocks: expected at least 4, found {self.n_blocks}")
        if self.decimation < 2:
            raise ValueError(f"decimation: expected at least 2, found {self.decimation}")

    def rows(self, n_channels: int) -> int:
        """Return the number of block rows for so many channels.

        Few rows were measured to be best: 8 to 16 with 12 channels reach the smallest errors and the widest gap
        between modes and false ones, 50 and more lose both. With few channels the largest order sets the number.
        """
        return self.block_rows or max(12, -(-3 * self.max_order // (2 * n_channels)))

    def lags(self, n_channels: int, first_lag: int) -> int:
        """Return how many lags the block Hankel matrix needs, from zero on."""
        return first_lag + 2 * self.rows(n_channels)

    @property
    def orders(self) -> range:
        """All model orders."""
        return range(self.min_order, self.max_order + 1, self.order_step)


@dataclass(frozen=True, eq=False, kw_only=True)
class Subspace:
    """Leading subspace of the block Hankel matrix of correlations, and what shift invariance needs of it."""

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
    left_vector: ComplexArray  #: (order, order) left eigenvectors, rows; inverse of `vector`
    gram_inverse: FloatArray  #: (order, order) inverse of up^T up
    shape: ComplexArray  #: (order, n_channels) observed eigenvectors

    @property
    def continuous(self) -> ComplexArray:
        """Eigenvalues in continuous time [rad/s]."""
        result: ComplexArray = (np.log(self.eigenvalue) * self.rate).astype(np.complex128)
        return result


def hankel(correlation: FloatArray, first_lag: int, block_rows: int) -> FloatArray:
    """Arrange a correlation function as a block Hankel matrix: block (i, j) is the lag ``first_lag + i + j``.

    Parameters
    ----------
    correlation : (n_lags, n_channels, n_channels) array
    first_lag : int
        [samples].
    block_rows : int

    Returns
    -------
    (block_rows * n_channels, block_rows * n_channels) array
    """
    used = correlation[first_lag : first_lag + 2 * block_rows - 1]
    windows = sliding_window_view(used, block_rows, axis=0)
    size = block_rows * correlation.shape[1]
    return windows.transpose(0, 1, 3, 2).reshape(size, size)


def covariance(correlation: FloatArray, block_rows: int) -> FloatArray:
    """Return the covariance of `block_rows` successive samples: block (i, j) is the lag ``i - j``.

    Parameters
    ----------
    correlation : (n_lags, n_channels, n_channels) array
    block_rows : int

    Returns
    -------
    (block_rows * n_channels, block_rows * n_channels) array
    """
    both = np.concatenate((correlation[block_rows - 1 : 0 : -1].transpose(0, 2, 1), correlation[:block_rows]))
    lag = np.arange(block_rows)
    size = block_rows * correlation.shape[1]
    result: FloatArray = both[lag[:, None] - lag + block_rows - 1].transpose(0, 2, 1, 3).reshape(size, size)
    return result


def subspace(sums: CorrelationSums, rate: float, first_lag: int, options: CovarianceSSI) -> Subspace:
    """Return the leading subspace of the block Hankel matrix between whitened past and whitened future.

    Canonical variate weighting: a weak mode counts as much as a strong one, and neither the gain of a channel nor its
    noise matters. The weights' own uncertainty moves no mode to first order.

    Parameters
    ----------
    sums : CorrelationSums
    rate : float
        [Hz].
    first_lag : int
        First lag used: those below hold sensor noise [samples].
    options : CovarianceSSI

    Returns
    -------
    Subspace
    """
    correlation = sums.mean
    n_channels = correlation.shape[1]
    rows = options.rows(n_channels)
    future, future_root = _inverse_root(covariance(correlation, rows))
    past, _ = _inverse_root(covariance(correlation.transpose(0, 2, 1), rows))
    left, values, right = linalg.svd(future @ hankel(correlation, first_lag, rows) @ past, check_finite=False)
    rank = min(options.max_order, len(values))
    return Subspace(
        left=future_root @ left[:, :rank],
        values=values[:rank],
        right=past @ right[:rank].T,
        n_channels=n_channels,
        rate=rate,
    )


def _inverse_root(matrix: FloatArray, floor: float = 1e-5) -> tuple[FloatArray, FloatArray]:
    """Return the inverse square root of a covariance, and its root.

    Directions with less than `floor` of the largest variance count as having that much: behind an anti-alias filter
    the signals are nearly predictable, and whitening what is left there was measured to hide most modes (1e-9: 3 of
    8 found; 1e-6 to 1e-4: 8 of 8).
    """
    values, vectors = linalg.eigh(matrix, check_finite=False)
    root = np.sqrt(np.maximum(values, floor * values[-1]))
    return (vectors / root) @ vectors.T, (vectors * root) @ vectors.T


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
    gram_inverse = np.linalg.inv(gram).astype(np.float64)
    eigenvalue, vector = (part.astype(np.complex128) for part in np.linalg.eig(gram_inverse @ cross))
    return Realisation(
        order=len(gram),
        rate=space.rate,
        eigenvalue=eigenvalue,
        vector=vector,
        left_vector=np.linalg.inv(vector),
        gram_inverse=gram_inverse,
        shape=(space.output[:, : len(gram)] @ vector).T,
    )
