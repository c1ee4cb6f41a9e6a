"""Poles of matrix fractions, and the influence of each block of time on them, to first order.

References
----------
De Troyer, T., Guillaume, P., Pintelon, R., Vanlanduit, S. (2009). Fast calculation of confidence intervals on parameter
estimates of least-squares frequency-domain estimators. Mechanical Systems and Signal Processing 23(2), 261-273.
Verboven, P. (2002). Frequency-domain system identification for modal analysis. Vrije Universiteit Brussel, chapter 6:
shapes by least squares once the poles are known.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # its parts at their first use
from numpy import fft

from daq import FloatArray, IndexArray
from oma.methods.matrix_fraction import HalfSpectrum, MatrixFraction, ridged
from oma.types import ComplexArray

_AT_ONCE = 8  # poles whose derivatives are held simultaneously
_MIN_DAMPING = -2e-4  # of poles that take part: others grow, and explain noise


@dataclass(frozen=True, eq=False, kw_only=True)
class Windowed:
    """The correlation function that was transformed: from the first lag used on, under its exponential window."""

    values: FloatArray  #: (n_lags, n_channels, n_references)
    moves: FloatArray  #: (n_blocks, n_lags, n_channels, n_references): change by each block of time
    decay: float  #: decay of the window per lag [-]
    rate: float  #: [Hz]


@dataclass(frozen=True, eq=False, kw_only=True)
class FractionModel:
    """One order's poles and shapes."""

    fraction: MatrixFraction
    rate: float  #: [Hz]
    decay: float  #: decay of the exponential window per lag [-]
    taking_part: IndexArray  #: (n_parts,) roots that are modes, or could be
    shape: ComplexArray  #: (n_roots, n_channels), zero for roots that take no part
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


def fraction_model(fraction: MatrixFraction, spectrum: HalfSpectrum, seen: Windowed) -> FractionModel:
    """Return poles, and shapes by least squares over the lines: no other poles than those that could be modes.

    Modes beyond the lines are a constant and a slope between any two channels.
    """
    pole = continuous(fraction.root, seen.decay, seen.rate)
    part = np.flatnonzero((pole.imag >= 0) & (-pole.real > _MIN_DAMPING * np.abs(pole)))
    n_lags, n_channels, n_references = seen.values.shape
    decays = fraction.root[part] ** -np.arange(n_lags)[:, None]
    left, used, point = fraction.left_vector[part].T, spectrum.used, spectrum.point
    halves = [
        0.5 * fft.fft(decay, len(used), axis=0)[used][:, None] * participation
        for decay, participation in ((decays, left), (decays.conj(), left.conj()))
    ]
    beyond = [power[:, None, None] * np.eye(n_references) for power in (np.ones(len(point)), point)]
    design = np.concatenate((*halves, *beyond), axis=2).reshape(len(point) * n_references, -1)
    root_weight = np.repeat(np.sqrt(spectrum.weight[used]), n_references)
    inverse = np.linalg.pinv(design * root_weight[:, None])[: len(part)] * root_weight
    lines = np.zeros((len(part), len(used), n_references), dtype=np.complex128)
    lines[:, used] = inverse.reshape(len(part), len(point), n_references)
    kernel = np.asarray(fft.fft(lines, axis=1)[:, :n_lags])
    shape = np.zeros((len(fraction.root), n_channels), dtype=np.complex128)
    shape[part] = np.einsum("plr,lor->po", kernel, seen.values, optimize=True)
    return FractionModel(
        fraction=fraction, rate=seen.rate, decay=seen.decay, taking_part=part, shape=shape, kernel=kernel
    )


def pole_influences(model: FractionModel, spectrum: HalfSpectrum, seen: Windowed) -> ComplexArray:
    """Follow each block's influence on the correlation function to the poles that take part.

    Parameters
    ----------
    model : FractionModel
    spectrum : HalfSpectrum
    seen : Windowed

    Returns
    -------
    (n_blocks, n_parts) array
        Of the poles in continuous time [rad/s].
    """
    n_lags, part = len(seen.values), model.taking_part
    flat = seen.moves.reshape(len(seen.moves), -1)
    few = [part[k : k + _AT_ONCE] for k in range(0, len(part), _AT_ONCE)]
    moves = [flat @ _kernel(model.fraction, spectrum, n_lags, some).reshape(-1, len(some)) for some in few]
    whole = np.concatenate(moves, axis=1) if moves else np.zeros((len(flat), 0))
    return np.asarray(-whole / model.fraction.root[part] * model.rate)


def _kernel(fraction: MatrixFraction, spectrum: HalfSpectrum, n_lags: int, part: IndexArray) -> ComplexArray:
    """Return the derivative of some roots by the windowed correlation, (n_lags, n_channels, n_references, n_parts).

    A root moves by ``left M^-1 dM a`` with the coefficients `a` of A times its vector; ``M`` is quadratic in the lines,
    after elimination of B, and so its derivative is a sum of residuals times lines.
    """
    n = fraction.vector.shape[1]
    free = fraction.power * n
    powers = fraction.root[part] ** np.arange(fraction.power + 1)[:, None]
    right = np.einsum("jab,pb->jap", fraction.denominator.reshape(-1, n, n), fraction.vector[part])
    wanted = (powers[:-1, None] * fraction.left_vector[part].T).reshape(free, len(part))
    left = np.zeros_like(right)
    solved = scipy.linalg.solve(ridged(fraction.normal[:free, :free]), wanted, assume_a="pos")
    left[:-1] = solved.reshape(-1, n, len(part))
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
    """Evaluate polynomials (power + 1, n_references, n_parts) on the lines; the residual of B and the spectrum.

    Returns
    -------
    values : (n_lines, n_references, n_parts) array
    residual : (n_lines, n_channels, n_parts) array
    """
    powers = spectrum.point[:, None] ** np.arange(fraction.power + 1)
    values = np.tensordot(powers, coefficients, axes=1)
    projected = np.tensordot(fraction.projected, coefficients.reshape(-1, coefficients.shape[2]), axes=1)
    flat = projected.reshape(fraction.power + 1, -1)
    numerator = scipy.linalg.solve_triangular(fraction.factor, flat, trans="T", lower=True).reshape(projected.shape)
    return values, spectrum.values[spectrum.used] @ values - np.tensordot(powers, numerator, axes=1)
