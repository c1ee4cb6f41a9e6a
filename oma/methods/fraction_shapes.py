"""Shapes of matrix fractions, and the influence of each block of time on them, to first order.

References
----------
Verboven, P. (2002). Frequency-domain system identification for modal analysis. Vrije Universiteit Brussel, chapter 6:
shapes by least squares once poles and participation are known.
Stewart, G. W., Sun, J.-G. (1990). Matrix perturbation theory. Academic Press, chapter 5: vectors of a moved matrix.
"""

import numpy as np
from scipy import fft, linalg

from daq import FloatArray
from oma.methods.fraction_poles import FractionModel, Windowed
from oma.methods.matrix_fraction import HalfSpectrum, MatrixFraction, ridged
from oma.types import ComplexArray


def shape_moves(model: FractionModel, spectrum: HalfSpectrum, seen: Windowed) -> ComplexArray:
    """Propagate each block to the shapes, not normalised, of the poles that are used.

    A shape is a least squares solution. It depends on the correlation function and on the explaining functions: the
    poles, and the participation of the references, which are left vectors of the companion matrix. The vectors of close
    modes rotate into each other, and so do their shapes.

    Parameters
    ----------
    model : FractionModel
    spectrum : HalfSpectrum
    seen : Windowed

    Returns
    -------
    (n_blocks, n_parts, n_channels) array
    """
    part, fraction = model.taking_part, model.fraction
    root = fraction.root[part]
    moved = np.stack([_seen_by_vectors(fraction, _denominator_move(fraction, spectrum, m)) for m in seen.moves])
    gap = root[:, None] - fraction.root
    gap[np.arange(len(part)), part] = np.inf
    participation = (moved[:, part] / gap) @ fraction.left_vector
    relative = -moved[:, part, part] / root
    lag = np.arange(len(seen.values))
    powers = root ** -lag[:, None]
    explained = [_explained(model, powers * lag[:, None], relative[:, :, None] * fraction.left_vector[part])]
    explained.append(_explained(model, powers, participation))
    return np.asarray(np.einsum("blor,plr->bpo", seen.moves, model.kernel, optimize=True) - sum(explained))


def _explained(model: FractionModel, powers: ComplexArray, participation: ComplexArray) -> ComplexArray:
    """Return the apparent changes of shapes by changes of the explaining functions, (n_blocks, n_parts, n_channels).

    A function is a column of `powers` (n_lags, n_parts) times a row of the participation (n_blocks, n_parts,
    n_references).
    """
    shape = model.shape[model.taking_part]
    share = np.einsum("plr,lq->pqr", model.kernel, powers, optimize=True)
    mirrored = np.einsum("plr,lq->pqr", model.kernel, powers.conj(), optimize=True)
    direct = np.einsum("pqr,bqr->bpq", share, participation, optimize=True) @ shape
    image = np.einsum("pqr,bqr->bpq", mirrored, participation.conj(), optimize=True) @ shape.conj()
    return np.asarray(0.5 * (direct + image))


def _denominator_move(fraction: MatrixFraction, spectrum: HalfSpectrum, move: FloatArray) -> FloatArray:
    """Return the change of A's free coefficients by one of the correlation (n_lags, n_channels, n_references)."""
    n_fft, n_channels, n = spectrum.values.shape
    weighted = spectrum.weight[:, None, None] * fft.fft(move, n_fft, axis=0)
    lag = np.arange(fraction.power + 1)
    difference = (lag[:, None] - lag) % n_fft
    products = n_fft * fft.ifft(weighted, axis=0).real[difference]
    cross = np.matmul(spectrum.values.conj().transpose(0, 2, 1), weighted)
    squares = n_fft * fft.ifft(cross + cross.conj().transpose(0, 2, 1), axis=0).real[difference]
    flat = products.transpose(0, 2, 1, 3).reshape(len(lag), -1)
    projected = linalg.solve_triangular(fraction.factor, flat, lower=True, check_finite=False)
    moved, still = projected.reshape(len(lag) * n_channels, -1), fraction.projected.reshape(len(lag) * n_channels, -1)
    whole = squares.transpose(0, 2, 1, 3).reshape(len(lag) * n, -1) @ fraction.denominator
    whole -= moved.T @ (still @ fraction.denominator) + still.T @ (moved @ fraction.denominator)
    free = fraction.power * n
    return np.asarray(-linalg.solve(ridged(fraction.normal[:free, :free]), whole[:free], assume_a="pos"))


def _seen_by_vectors(fraction: MatrixFraction, move: FloatArray) -> ComplexArray:
    """Return the companion matrix's move between all left and right vectors, (n_roots, n_roots)."""
    n = fraction.vector.shape[1]
    powers = fraction.root ** np.arange(fraction.power)[:, None]
    right = np.einsum("jab,jp,pb->ap", move.reshape(fraction.power, n, n), powers, fraction.vector, optimize=True)
    return np.asarray(-fraction.left_vector @ right)
