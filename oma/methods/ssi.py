"""Stochastic subspace identification from correlations, all orders from one decomposition.

`CovarianceSSI` decomposes the block Hankel matrix of correlations itself. `DataSSI` decomposes it between whitened past
and whitened future. Data-driven SSI obtains the same projection from the QR decomposition of data Hankel matrices.

References
----------
Peeters, B., De Roeck, G. (1999). Reference-based stochastic subspace identification for output-only modal analysis.
Mechanical Systems and Signal Processing 13(6), 855-878.
Van Overschee, P., De Moor, B. (1996). Subspace identification for linear systems. Kluwer, chapter 3.
Larimore, W. E. (1990). Canonical variate analysis in identification, filtering, and adaptive control. Proceedings of
the 29th IEEE Conference on Decision and Control, 596-604.
Döhler, M., Mevel, L. (2012). Fast multi-order computation of system matrices in subspace-based system identification.
Control Engineering Practice 20(9), 882-894.
Musco, C., Musco, C. (2015). Randomized block Krylov methods for stronger and faster approximate singular value
decomposition. Advances in Neural Information Processing Systems 28.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from daq import FloatArray
from oma.errors import TooFewChannels
from oma.methods.base import CorrelationLevel, LevelModes, Method
from oma.methods.realization import Subspace, realisations
from oma.methods.ssi_uncertainty import perturbation, pole_influences
from oma.preparation import Level
from oma.selection import candidates, physical, stabilization
from oma.spectral import CorrelationAccumulator, CorrelationSums, covariance, hankel

_FIRST_ORDER = 50  # largest model order, until it is known how many modes there are
_FEWEST_POLES_A_MODE = 4  # that the largest model must have for each of them; where it has not,
_POLES_A_MODE = 6  # larger ones follow, up to so many
_MIN_POLES_A_MODE = 3  # fewest poles per mode of a model from which modes are estimated
_FLOOR = 1e-5  # of the largest variance: see `_root`
_OVERSAMPLING = 10  # of the randomized block Krylov iteration


@dataclass(frozen=True, kw_only=True)
class CovarianceSSI(Method):
    """Covariance-driven SSI: reference-based, unweighted."""

    name: ClassVar[str] = "ssi-cov"

    references: tuple[str, ...] | None = None  #: channels that all are correlated with; None: all
    block_rows: int | None = None  #: lags in rows and in columns of the block Hankel matrix; None: `rows` chooses [-]
    min_order: int = 2  #: smallest model order [-]
    max_order: int | None = None  #: largest model order; None: 50, and more where there are many modes [-]
    order_step: int = 2  #: step of the model order [-]

    def __post_init__(self) -> None:
        """Refuse invalid options."""
        super().__post_init__()
        if self.references is not None and len(self.references) == 0:
            raise ValueError("references: expected at least one channel, found none")
        if self.block_rows is not None:
            self.check_least(block_rows=2)
        if not 2 <= self.min_order <= self.first_order or self.order_step < 1:
            raise ValueError(
                f"orders: expected 2 <= min <= max and a positive step, found {self.min_order}, {self.first_order}, "
                f"{self.order_step}"
            )

    def rows(self, n_channels: int) -> int:
        """Return the number of block rows for so many channels.

        Few rows were measured to be best: 8 to 16 with 12 channels have the smallest errors and the widest gap
        between modes and spurious ones; with 50 and more both are worse. With few channels the largest order sets the
        number.
        """
        return self.block_rows or max(12, -(-3 * self.first_order // (2 * n_channels)))

    def least_samples(self, n_channels: int) -> int:
        """Return the least number of samples at one rate: four times the span of the block Hankel matrix."""
        return 8 * self.rows(n_channels) + 4

    @property
    def first_order(self) -> int:
        """First largest model order, tried before the number of modes is known."""
        return _FIRST_ORDER if self.max_order is None else self.max_order

    def orders(self, largest: int) -> range:
        """Return the model orders up to the largest."""
        return range(self.min_order, largest + 1, self.order_step)

    def next_order(self, largest: int, n_modes: int, n_channels: int) -> int | None:
        """Return the next largest order if `n_modes` are too many for the previous one; None if it is enough.

        With 22 modes, order 50 had errors of 0.1 to 0.2 % in frequency, 2 to 11 standard deviations, and damping 1.2 to
        2 times too large.
        """
        most = 2 * self.rows(n_channels) * n_channels // 3  # that so many rows are chosen for
        wanted = min(_POLES_A_MODE * n_modes, most)
        few = self.max_order is None and largest < _FEWEST_POLES_A_MODE * n_modes
        return wanted if few and wanted > largest else None

    def start(self, channels: Sequence[str], level: Level) -> "SSILevel":
        """Return an empty identifier for one rate.

        Raises
        ------
        TooFewChannels
            If no reference is among the channels.
        """
        return SSILevel(self, channels, level)

    def columns(self, references: Sequence[int], n_channels: int) -> tuple[Sequence[int], Sequence[int]]:
        """Return the channels with which all are correlated, and the indices of the references among these."""
        del n_channels
        return references, range(len(references))

    def subspace(
        self, correlation: FloatArray, past: Sequence[int], rate: float, first_lag: int, rank: int
    ) -> Subspace:
        """Return the leading subspace of the block Hankel matrix.

        Parameters
        ----------
        correlation : (n_lags, n_channels, n_columns) array
        past : sequence of int
            Columns that are references.
        rate : float
            [Hz].
        first_lag : int
            First lag used: those below hold sensor noise [samples].
        rank : int
            The largest model order.

        Returns
        -------
        Subspace
        """
        n_channels = correlation.shape[1]
        whole = hankel(correlation[:, :, past], first_lag, self.rows(n_channels))
        left, values, right = leading_svd(whole, rank, powers=2, flat=False)
        return Subspace(left=left, values=values, right=right, n_channels=n_channels, rate=rate)


@dataclass(frozen=True, kw_only=True)
class DataSSI(CovarianceSSI):
    """Data-driven SSI with canonical variate weighting.

    A weak mode counts as much as a strong one, and neither the gain of a channel nor its noise matters. The weights'
    own uncertainty moves no mode to first order.
    """

    name: ClassVar[str] = "ssi-data"

    def columns(self, references: Sequence[int], n_channels: int) -> tuple[Sequence[int], Sequence[int]]:
        """Return all channels, with which the future is whitened, and the indices of the references among them."""
        return range(n_channels), references

    def subspace(
        self, correlation: FloatArray, past: Sequence[int], rate: float, first_lag: int, rank: int
    ) -> Subspace:
        """Return the leading subspace between whitened past and whitened future; see `CovarianceSSI.subspace`."""
        n_channels, rows = correlation.shape[1], self.rows(correlation.shape[1])
        future = _root(covariance(correlation, rows))
        before = _root(covariance(correlation[:, past][:, :, past].transpose(0, 2, 1), rows))
        whole = hankel(correlation[:, :, past], first_lag, rows)
        white = np.linalg.solve(before, np.linalg.solve(future, whole).T).T
        left, values, right = leading_svd(white, rank, powers=3, flat=True)
        return Subspace(
            left=future @ left,
            values=values,
            right=np.asarray(np.linalg.solve(before.T, right), np.float64),
            n_channels=n_channels,
            rate=rate,
        )


class SSILevel(CorrelationLevel):
    """Correlation sums at one rate, and the modes in them; built by `CovarianceSSI.start`."""

    def __init__(self, method: CovarianceSSI, channels: Sequence[str], level: Level) -> None:
        self._method, self._level, self._n_channels = method, level, len(channels)
        self._first_lag = level.noise_lags + 1
        columns, self._past = method.columns(_references(method.references, channels), self._n_channels)
        n_lags = self._first_lag + 2 * method.rows(self._n_channels)
        self._correlations = CorrelationAccumulator(self._n_channels, n_lags, columns)

    def identify(self) -> LevelModes | None:
        """Return the modes in the blocks held; None if gaps leave too little to be worth a look."""
        if self._correlations.n_complete < self._method.least_samples(self._n_channels):
            return None
        sums, method = self._correlations.sums, self._method
        largest: int | None = method.first_order
        while largest:
            found, n_modes = self._up_to(largest, sums)
            largest = method.next_order(largest, n_modes, self._n_channels)
        return found

    def _up_to(self, largest: int, sums: CorrelationSums) -> tuple[LevelModes, int]:
        """Return the modes that models up to the largest order show, and their number with those below the band."""
        method, band = self._method, self._level.band
        space = method.subspace(sums.mean, self._past, self._level.rate, self._first_lag, largest)
        models = realisations(space, method.orders(largest))
        poles = stabilization(models, band, method.selection)
        below = stabilization(models[-2:], (0.0, band[0]), method.selection)
        n_below = int(below.stable.sum()) // 2  # each mode is in both models
        moved = perturbation(space, sums, self._past, self._first_lag)
        stable = poles[poles.stable]
        columns = {model.order: stable.column[stable.order == model.order] for model in models}
        chosen = [(model, columns[model.order]) for model in models if len(columns[model.order])]
        influences = iter(pole_influences(moved, chosen))
        influence = {(model.order, column): next(influences) for model, some in chosen for column in some.tolist()}
        modes = candidates(
            poles,
            len(models),
            lambda order, column: influence[order, column],
            self._correlations.n_complete / self._level.rate,
            method.selection,
            poles_a_mode=_MIN_POLES_A_MODE,
            n_beside=n_below,
        )
        return LevelModes(poles=poles, modes=modes), n_below + len(physical(modes, method.selection))


def leading_svd(matrix: FloatArray, rank: int, powers: int, *, flat: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the leading singular triplets: by LAPACK if that is quick, else by randomized iteration.

    Parameters
    ----------
    matrix : (m, n) array
    rank : int
    powers : int
        How often a random block is multiplied by ``matrix @ matrix.T``.
    flat : bool
        The singular values hardly fall: all powers span the space searched (block Krylov), not the last one only.

    Returns
    -------
    left : (m, rank) array
    values : (rank,) array
        Falling.
    right : (n, rank) array
    """
    rank = min(rank, *matrix.shape)
    width = rank + _OVERSAMPLING
    if min(matrix.shape) <= (powers + 1) * width:
        left, values, right = np.linalg.svd(matrix, full_matrices=False)
        return left[:, :rank], values[:rank], right[:rank].T
    block = matrix @ np.random.default_rng(0).standard_normal((matrix.shape[1], width))
    blocks = [np.linalg.qr(block)[0]]
    for _ in range(powers):
        blocks.append(np.linalg.qr(matrix @ (matrix.T @ blocks[-1]))[0])
    basis = np.linalg.qr(np.concatenate(blocks, axis=1))[0] if flat else blocks[-1]
    small = basis.T @ matrix
    squares, left = np.linalg.eigh(small @ small.T)
    left = left[:, : -rank - 1 : -1]
    values = np.sqrt(np.maximum(squares[: -rank - 1 : -1], np.finfo(np.float64).tiny))
    return basis @ left, values, small.T @ (left / values)


def _root(matrix: FloatArray) -> FloatArray:
    """Return the lower Cholesky factor of a covariance.

    Every direction gets an additional 1e-5 of the largest variance. Behind an anti-alias filter the signals are nearly
    predictable, and whitening the rest there hid most modes (1e-9: 3 of 8 found; 1e-6 to 1e-4: 8 of 8). Sums over
    samples with gaps may have directions of negative variance, which count as zero.
    """
    floor = _FLOOR * np.linalg.norm(matrix) * np.eye(len(matrix))  # largest variance <= norm <= a few times that
    try:
        root = np.linalg.cholesky(matrix + floor)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(matrix)
        possible = (vectors * np.maximum(values, 0)) @ vectors.T
        root = np.linalg.cholesky(possible + floor)
    return np.asarray(root, np.float64)


def _references(names: Sequence[str] | None, channels: Sequence[str]) -> Sequence[int]:
    """Return the places of the references among the channels."""
    if names is None:
        return range(len(channels))
    found = [channels.index(name) for name in names if name in channels]
    if not found:
        raise TooFewChannels((), 1, dict.fromkeys(names, "a reference that is not there or carries no signal"))
    return found
