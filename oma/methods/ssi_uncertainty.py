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

from daq import FloatArray
from oma.methods.realization import Realisation, Subspace
from oma.selection import PoleInfluence, normalised_move, pole_moves
from oma.spectral import CorrelationSums, hankel
from oma.types import ComplexArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Perturbation:
    """First-order influence of each block of time on the shift-invariance equations."""

    cross: FloatArray  #: (n_blocks, rank, rank) of up^T down
    gram: FloatArray  #: (n_blocks, rank, rank) of up^T up
    output: FloatArray  #: (n_blocks, n_channels, rank) of the first block row


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
    right = space.right / space.values
    rows = len(space.left) // space.n_channels
    left = np.stack([hankel(block[:, :, past], first_lag, rows) @ right for block in sums.influences()])
    up, down = left[:, : -space.n_channels], left[:, space.n_channels :]
    gram = space.up.T @ up
    return Perturbation(
        cross=up.transpose(0, 2, 1) @ space.down + space.up.T @ down,
        gram=gram + gram.transpose(0, 2, 1),
        output=left[:, : space.n_channels],
    )


def pole_influences(moved: Perturbation, model: Realisation, columns: Sequence[int]) -> list[PoleInfluence]:
    """Follow each block's influence to poles of one order, all of them together.

    Parameters
    ----------
    moved : Perturbation
    model : Realisation
    columns : sequence of int
        Which of the model's eigenvalues.

    Returns
    -------
    list of PoleInfluence
    """
    n, used = model.order, np.array(columns, np.intp)
    eigenvalue, vector = model.eigenvalue[used], model.vector[:, used]
    residual = _products(moved.cross[:, :n, :n], vector) - eigenvalue * _products(moved.gram[:, :n, :n], vector)
    modal = model.dual @ residual  # (n_blocks, n, n_columns)
    gap = eigenvalue - model.eigenvalue[:, None]
    gap[used, np.arange(len(used))] = np.inf
    shape = _products(moved.output[:, :, :n], vector) + model.shape.T @ (modal / gap)
    own = modal[:, used, np.arange(len(used))]
    frequency, damping = pole_moves(model.continuous[used], own / eigenvalue * model.rate)
    moves = normalised_move(model.shape[used], shape.transpose(2, 0, 1))
    return [
        PoleInfluence(frequency=f, damping=d, shape=m) for f, d, m in zip(frequency.T, damping.T, moves, strict=True)
    ]


def _products(matrices: FloatArray, vectors: ComplexArray) -> ComplexArray:
    """Return real matrices (n_blocks, m, n) times complex vectors (n, k), without making the matrices complex."""
    k = vectors.shape[1]
    both = matrices @ np.concatenate((vectors.real, vectors.imag), axis=1)
    return np.asarray(both[..., :k] + 1j * both[..., k:])
