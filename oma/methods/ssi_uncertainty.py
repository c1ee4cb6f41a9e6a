"""Standard deviations of modes from the scatter of blocks of time.

Each block's share of the correlation sums moves the modes a little; the moves are followed to first order through
singular subspace, state matrix and eigenvectors (the infinitesimal jackknife), for all poles at once.

References
----------
Döhler, M., Mevel, L. (2013). Efficient multi-order uncertainty computation for stochastic subspace identification.
Mechanical Systems and Signal Processing 38(2), 346-366.
Reynders, E., Pintelon, R., De Roeck, G. (2008). Uncertainty bounds on modal parameters obtained from stochastic
subspace identification. Mechanical Systems and Signal Processing 22(4), 948-969.
Efron, B. (1982). The jackknife, the bootstrap and other resampling plans. SIAM, chapter 6.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from oma.methods.realization import Realisation, Subspace
from oma.selection import PoleInfluence, normalised_move, pole_moves
from oma.spectral import CorrelationSums
from oma.types import ComplexArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Perturbation:
    """First-order influence of each block of time on the shift-invariance equations, in the basis of the subspace."""

    both: FloatArray  #: (2 rank, rank, n_blocks): of up^T down, and of up^T up; the columns of each matrix first
    output: FloatArray  #: (rank, n_channels, n_blocks), its columns first, of the first block row


def perturbation(space: Subspace, sums: CorrelationSums, past: Sequence[int], first_lag: int) -> Perturbation:
    """Follow each block's influence on the correlations to the singular subspace.

    Parameters
    ----------
    space : Subspace
    sums : CorrelationSums
    past : sequence of int
        Columns of the sums that are references.
    first_lag : int
        As for `oma.CovarianceSSI.subspace`.

    Returns
    -------
    Perturbation
    """
    basis, rank = space.basis, space.basis.up.shape[1]
    left = _hankel_products(sums.influences()[:, first_lag:, :, past], basis.weight, space.n_channels)
    up, down = (part.reshape(len(basis.up), -1) for part in (left[: -space.n_channels], left[space.n_channels :]))
    gram = (basis.up.T @ up).reshape(rank, rank, -1)
    cross = (basis.down.T @ up).reshape(rank, rank, -1)
    cross += (basis.up.T @ down).reshape(rank, rank, -1).transpose(1, 0, 2)
    return Perturbation(
        both=np.concatenate((cross, gram + gram.transpose(1, 0, 2))),
        output=left[: space.n_channels].transpose(1, 0, 2),
    )


def _hankel_products(moves: FloatArray, weight: FloatArray, n_channels: int) -> FloatArray:
    """Return block Hankel matrices times weights, (block_rows * n_channels, rank, n_blocks).

    Parameters
    ----------
    moves : (n_blocks, n_lags, n_channels, n_references) array
        From the lag of the first block of the matrices on.
    weight : (block_rows * n_references, rank) array
    n_channels : int
    """
    n_blocks, n_lags, _, n_references = moves.shape
    rows, rank = len(weight) // n_references, weight.shape[1]
    lagged = moves.transpose(1, 3, 2, 0).reshape(n_lags * n_references, n_channels * n_blocks)
    result = np.empty((rows, n_channels, rank, n_blocks))
    for row in range(rows):
        stretch = lagged[row * n_references : row * n_references + len(weight)]
        result[row] = (weight.T @ stretch).reshape(rank, n_channels, n_blocks).transpose(1, 0, 2)
    return result.reshape(rows * n_channels, rank, n_blocks)


def pole_influences(moved: Perturbation, chosen: Sequence[tuple[Realisation, IndexArray]]) -> list[PoleInfluence]:
    """Follow each block's influence to poles of models, all of them together.

    Parameters
    ----------
    moved : Perturbation
    chosen : sequence of (Realisation, IndexArray)
        Models, and which of their eigenvalues.

    Returns
    -------
    list of PoleInfluence
        One after the other.
    """
    n_poles = sum(len(columns) for _, columns in chosen)
    if not n_poles:
        return []
    rank, n_channels, _ = moved.output.shape
    vector = np.zeros((n_poles, rank), np.complex128)
    readout = np.zeros((n_poles, 1 + n_channels, rank), np.complex128)  # of the move of the pole, and of its shape
    end = 0
    for model, columns in chosen:
        n, begin, end = model.order, end, end + len(columns)
        gap = model.eigenvalue[columns, None] - model.eigenvalue
        gap[np.arange(len(columns)), columns] = np.inf
        vector[begin:end, :n] = model.vector[:, columns].T
        readout[begin:end, 0, :n] = model.dual[columns]
        parts = model.shape.T / gap[:, None]
        readout[begin:end, 1:, :n] = (parts.reshape(-1, n) @ model.dual).reshape(parts.shape)
    eigenvalue, continuous, shape = (
        np.concatenate([getattr(model, name)[columns] for model, columns in chosen])
        for name in ("eigenvalue", "continuous", "shape")
    )
    residual = _products(np.concatenate((vector, -eigenvalue[:, None] * vector), axis=1), moved.both)
    found = readout @ residual  # (n_poles, 1 + n_channels, n_blocks)
    moves = found[:, 1:] + _products(vector, moved.output)
    rate = np.array([model.rate for model, columns in chosen for _ in columns])
    frequency, damping = pole_moves(continuous, (found[:, 0] / eigenvalue[:, None]).T * rate)
    return [
        PoleInfluence(frequency=f, damping=d, shape=m)
        for f, d, m in zip(frequency.T, damping.T, normalised_move(shape, moves.transpose(0, 2, 1)), strict=True)
    ]


def _products(vectors: ComplexArray, matrices: FloatArray) -> ComplexArray:
    """Return complex vectors (k, n) times real matrices (n, m, n_blocks), without making the matrices complex."""
    parts = np.concatenate((vectors.real, vectors.imag)) @ matrices.reshape(len(matrices), -1)
    result = np.empty((len(vectors), *matrices.shape[1:]), np.complex128)
    result.real, result.imag = parts.reshape(2, *result.shape)
    return result
