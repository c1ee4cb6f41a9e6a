"""Poles and shapes of matrix fractions, and what each block of time moves them by, to first order.

References
----------
De Troyer, T., Guillaume, P., Pintelon, R., Vanlanduit, S. (2009). Fast calculation of confidence intervals on parameter
estimates of least-squares frequency-domain estimators. Mechanical Systems and Signal Processing 23(2), 261-273.
Verboven, P. (2002). Frequency-domain system identification for modal analysis. Vrije Universiteit Brussel, chapter 6:
shapes by least squares once the poles are known.
"""

from dataclasses import dataclass

import numpy as np
from scipy import fft, linalg

from daq import FloatArray, IndexArray
from oma.estimate import ComplexArray
from oma.matrix_fraction import HalfSpectrum, MatrixFraction, ridged
from oma.uncertainty import PoleInfluence, normalised_move, pole_moves

_BAND = (0.04, 0.48)  # of poles that take part in the correlations, as a share of the rate
_DAMPING = (-1e-3, 0.2)


@dataclass(frozen=True, eq=False, kw_only=True)
class Windowed:
    """The correlation function that was transformed: from the first lag used on, under its exponential window."""

    values: FloatArray  #: (n_lags, n_channels, n_references)
    moves: FloatArray  #: (n_blocks, n_lags, n_channels, n_references): what each block of time moves it by
    decay: float  #: of the window, a lag [-]
    rate: float  #: [Hz]


@dataclass(frozen=True, eq=False, kw_only=True)
class FractionModel:
    """One order's poles and shapes."""

    fraction: MatrixFraction
    rate: float  #: [Hz]
    decay: float  #: of the exponential window, a lag [-]
    taking_part: IndexArray  #: (n_parts,) roots that are modes, or could be
    shape: ComplexArray  #: (n_roots, n_channels), zero for roots that take no part
    design: ComplexArray  #: (n_lags, n_references, n_parts): what each part adds to the correlation at a unit shape
    kernel: ComplexArray  #: (n_parts, n_lags, n_references): a shape is the correlation function times this

    @property
    def order(self) -> int:
        """Number of poles."""
        return len(self.fraction.root)

    @property
    def continuous(self) -> ComplexArray:
        """Poles in continuous time, without the window [rad/s]."""
        return continuous(self.fraction.root, self.decay, self.rate)


def continuous(root: ComplexArray, decay: float, rate: float) -> ComplexArray:
    """Return the poles [rad/s] of roots of the polynomials."""
    return np.asarray((decay - np.log(root)) * rate)


def fraction_model(fraction: MatrixFraction, seen: Windowed) -> FractionModel:
    """Return poles, and shapes by least squares over the lags: no other poles than those that could be modes."""
    pole = continuous(fraction.root, seen.decay, seen.rate)
    frequency, damping = pole.imag / (2 * np.pi * seen.rate), -pole.real / np.abs(pole)
    inside = (frequency > _BAND[0]) & (frequency < _BAND[1]) & (damping > _DAMPING[0]) & (damping < _DAMPING[1])
    part = np.flatnonzero(inside)
    lag = np.arange(len(seen.values))
    design = fraction.root[part] ** -lag[:, None, None] * fraction.left_vector[part].T
    flat = design.reshape(len(lag) * design.shape[1], len(part))
    inverse = np.linalg.pinv(np.hstack((flat.real, -flat.imag)))
    kernel = inverse[: len(part)] + 1j * inverse[len(part) :]
    shape = np.zeros((len(fraction.root), seen.values.shape[1]), dtype=np.complex128)
    shape[part] = kernel @ seen.values.transpose(0, 2, 1).reshape(flat.shape[0], -1)
    return FractionModel(
        fraction=fraction,
        rate=seen.rate,
        decay=seen.decay,
        taking_part=part,
        shape=shape,
        design=design,
        kernel=kernel.reshape(len(part), *design.shape[:2]),
    )


def pole_influences(
    model: FractionModel, spectrum: HalfSpectrum, seen: Windowed, scale: FloatArray
) -> dict[int, PoleInfluence]:
    """Follow each block's influence on the correlation function to the poles and shapes that take part.

    Parameters
    ----------
    model : FractionModel
    spectrum : HalfSpectrum
    seen : Windowed
    scale : (n_channels,) array
        What the model's shapes are to be multiplied with.

    Returns
    -------
    dict
        Column of the root to its influence.
    """
    part = model.taking_part
    kernel = _kernel(model, spectrum, len(seen.values))
    moves = seen.moves.reshape(len(seen.moves), -1) @ kernel.reshape(-1, len(part))
    relative = -moves / model.fraction.root[part]
    shapes = _shape_moves(model, relative, seen)
    result = {}
    for k, column in enumerate(part.tolist()):
        frequency, damping = pole_moves(model.continuous[column], relative[:, k] * model.rate)
        moved = normalised_move(scale * model.shape[column], scale * shapes[:, k])
        result[column] = PoleInfluence(frequency=frequency, damping=damping, shape=moved)
    return result


def _kernel(model: FractionModel, spectrum: HalfSpectrum, n_lags: int) -> ComplexArray:
    """Return the derivative of roots by the windowed correlation, (n_lags, n_channels, n_references, n_parts).

    A root moves by ``left M^-1 dM a`` with the coefficients `a` of A times its vector; ``M`` is quadratic in the lines,
    after elimination of B, and so its derivative is a sum of residuals times lines.
    """
    fraction, part = model.fraction, model.taking_part
    n = fraction.vector.shape[1]
    free = fraction.power * n
    powers = fraction.root[part] ** np.arange(fraction.power + 1)[:, None]
    right = np.einsum("jab,pb->jap", fraction.denominator.reshape(-1, n, n), fraction.vector[part])
    wanted = (powers[:-1, None] * fraction.left_vector[part].T).reshape(free, len(part))
    left = np.zeros_like(right)
    left[:-1] = linalg.solve(ridged(fraction.normal[:free, :free]), wanted, assume_a="pos").reshape(-1, n, len(part))
    (right_hat, right_rest), (left_hat, left_rest) = (_residual(fraction, spectrum, c) for c in (right, left))
    weight = spectrum.weight[spectrum.used][:, None, None, None]
    lines = np.zeros((*spectrum.values.shape, len(part)), dtype=np.complex128)
    lines[spectrum.used] = weight * (
        left_rest[::-1, :, None] * right_hat[:, None] + right_rest[::-1, :, None] * left_hat[:, None]
    )
    return np.asarray(fft.fft(lines, axis=0)[:n_lags])


def _residual(
    fraction: MatrixFraction, spectrum: HalfSpectrum, coefficients: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Evaluate polynomials (power + 1, n_references, n_parts) on the lines; what B leaves of the spectrum times them.

    Returns
    -------
    values : (n_lines, n_references, n_parts) array
    residual : (n_lines, n_channels, n_parts) array
    """
    powers = spectrum.point[:, None] ** np.arange(fraction.power + 1)
    values = np.tensordot(powers, coefficients, axes=1)
    projected = np.tensordot(fraction.projected, coefficients.reshape(-1, coefficients.shape[2]), axes=1)
    flat = projected.reshape(fraction.power + 1, -1)
    numerator = linalg.solve_triangular(fraction.factor, flat, trans="T", lower=True).reshape(projected.shape)
    return values, spectrum.values[spectrum.used] @ values - np.tensordot(powers, numerator, axes=1)


def _shape_moves(model: FractionModel, relative: ComplexArray, seen: Windowed) -> ComplexArray:
    """Return moves of raw shapes, (n_blocks, n_parts, n_channels): of the correlation, and of the poles in it.

    `relative` (n_blocks, n_parts) is what the poles' factors from lag to lag move by, as a share. The participation of
    the references counts as known: of modes closer than their bells are wide this leaves out up to half of the scatter.
    """
    direct = np.einsum("blor,plr->bpo", seen.moves, model.kernel, optimize=True)
    steeper = np.arange(len(seen.values))[:, None, None] * model.design
    mixing = np.einsum("plr,lrq->pq", model.kernel, steeper, optimize=True)
    mirrored = np.einsum("plr,lrq->pq", model.kernel, steeper.conj(), optimize=True)
    pushed = relative[:, :, None] * model.shape[model.taking_part]
    return np.asarray(direct - 0.5 * (mixing @ pushed + mirrored @ pushed.conj()))
