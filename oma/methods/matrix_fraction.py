"""Right matrix fractions of half spectra: all orders from one set of normal equations.

The half spectrum of correlations, ``S(x) = sum over lags of R(lag) x^lag`` with ``x = exp(-2 pi i f / rate)``, of a
structure under white forces is ``B(x) A(x)^-1`` with polynomials of small order; the roots of ``det A`` are the poles.
Least squares over the lines of a band eliminates ``B``, output by output, and leaves equations for ``A`` whose blocks
depend on differences of powers only: transforms of the weighted lines fill them, and each order is a leading part.

References
----------
Guillaume, P., Verboven, P., Vanlanduit, S., Van der Auweraer, H., Peeters, B. (2003). A poly-reference implementation
of the least-squares complex frequency-domain estimator. Proceedings of IMAC XXI.
Cauberghe, B., Guillaume, P., Verboven, P., Vanlanduit, S., Parloo, E. (2005). The influence of the parameter constraint
on the stability of the poles and the discrimination capabilities of the stabilisation diagrams. MSSP 19(5), 989-1014.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its parts at their first use
from numpy import fft

from daq import FloatArray
from oma.preparation import BoolArray
from oma.spectral import fast_length
from oma.types import ComplexArray

_RIDGE = 1e-10  # of the mean diagonal: lines of a part of the circle leave powers nearly dependent


@dataclass(frozen=True, eq=False, kw_only=True)
class HalfSpectrum:
    """Half spectrum on the whole circle, and how much each of its lines weighs."""

    values: ComplexArray  #: (n_fft, n_channels, n_references)
    weight: FloatArray  #: (n_fft,): the inverse of the squared size, 0 outside the band

    @property
    def used(self) -> BoolArray:
        """The lines with a weight, (n_fft,); with every line its mirror image."""
        return self.weight > 0

    @property
    def point(self) -> ComplexArray:
        """Points of the used lines on the unit circle, (n_used,)."""
        n_fft = len(self.values)
        return np.asarray(np.exp(-2j * np.pi * np.flatnonzero(self.used) / n_fft))


@dataclass(frozen=True, eq=False, kw_only=True)
class MatrixFraction:
    """One order's polynomials and poles, the poles as roots in `x`."""

    power: int  #: power of the polynomials
    root: ComplexArray  #: (n_roots,)
    vector: ComplexArray  #: (n_roots, n_references): A(root) vector is zero
    denominator: FloatArray  #: ((power + 1) n_references, n_references): coefficients of A, the highest is the identity
    left_vector: ComplexArray  #: (n_roots, n_references): left_vector A(root) is zero, scaled by the root's derivative
    factor: FloatArray  #: (power + 1, power + 1) lower Cholesky factor of the powers' Gram matrix
    projected: FloatArray  #: (power + 1, n_channels, (power + 1) n_references): the lines' products with the powers
    normal: FloatArray  #: ((power + 1) n_references, (power + 1) n_references) equations for the coefficients of A


def half_spectrum(correlation: FloatArray, band: tuple[float, float]) -> HalfSpectrum:
    """Transform a windowed correlation function, each line weighing as its own scatter permits.

    Parameters
    ----------
    correlation : (n_lags, n_channels, n_references) array
        From the first lag used on.
    band : (float, float)
        Lines with a weight, as a share of the rate [-].
    """
    n_fft = fast_length(2 * len(correlation))
    values = np.asarray(fft.fft(correlation, n_fft, axis=0))
    frequency = np.abs(fft.fftfreq(n_fft))
    used = (frequency > band[0]) & (frequency < band[1])
    size = np.sum(np.abs(values) ** 2, axis=(1, 2))
    weight = np.where(used, 1 / np.maximum(size, 1e-12 * size.max()), 0.0)
    return HalfSpectrum(values=values, weight=weight)


def matrix_fractions(spectrum: HalfSpectrum, powers: Sequence[int]) -> list[MatrixFraction]:
    """Return the matrix fractions of rising orders.

    Parameters
    ----------
    spectrum : HalfSpectrum
    powers : sequence of int
        Rising.

    Returns
    -------
    list of MatrixFraction
    """
    n_references = spectrum.values.shape[2]
    factor, projected, normal = _normal_equations(spectrum, powers[-1])
    result, done = [], 0
    for power in powers:
        eliminated = projected[done : power + 1].reshape(-1, projected.shape[2])
        normal = normal - eliminated.T @ eliminated
        done, size = power + 1, (power + 1) * n_references
        parts = factor[:done, :done], projected[:done, :, :size], normal[:size, :size]
        result.append(_matrix_fraction(power, *parts))
    return result


def _normal_equations(spectrum: HalfSpectrum, power: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the powers' Cholesky factor, the lines' products with them, and the equations before elimination."""
    weight, values = spectrum.weight, spectrum.values
    n_fft, n_channels, n_references = values.shape
    weighted = weight[:, None, None] * values
    lag = np.arange(power + 1)
    difference = (lag[:, None] - lag) % n_fft
    gram = n_fft * fft.ifft(weight).real[difference]
    products = n_fft * fft.ifft(weighted, axis=0).real[difference]
    squares = n_fft * fft.ifft(np.matmul(values.conj().transpose(0, 2, 1), weighted), axis=0).real[difference]
    factor = scipy.linalg.cholesky(ridged(gram), lower=True, check_finite=False)
    flat = products.transpose(0, 2, 1, 3).reshape(power + 1, -1)
    projected = scipy.linalg.solve_triangular(factor, flat, lower=True, check_finite=False)
    size = (power + 1) * n_references
    return (
        np.asarray(factor),
        np.asarray(projected.reshape(power + 1, n_channels, size)),
        squares.transpose(0, 2, 1, 3).reshape(size, size),
    )


def ridged(matrix: FloatArray) -> FloatArray:
    """Return a matrix of normal equations that can be factorised."""
    return np.asarray(matrix + _RIDGE * np.trace(matrix) / len(matrix) * np.eye(len(matrix)))


def _matrix_fraction(power: int, factor: FloatArray, projected: FloatArray, normal: FloatArray) -> MatrixFraction:
    """Solve one order: the highest coefficient is the identity, which puts poles of noise outside the stable ones."""
    n = len(normal) // (power + 1)
    free = power * n
    lower = -scipy.linalg.solve(ridged(normal[:free, :free]), normal[:free, free:], assume_a="pos", check_finite=False)
    companion = np.eye(free, k=n)
    companion[-n:] = -lower.reshape(power, n, n).transpose(1, 0, 2).reshape(n, free)
    root, right = (part.astype(np.complex128) for part in np.linalg.eig(companion))
    left = np.linalg.inv(right)
    return MatrixFraction(
        power=power,
        root=root,
        vector=right[:n].T,
        denominator=np.vstack((lower, np.eye(n))),
        left_vector=left[:, -n:],
        factor=factor,
        projected=projected,
        normal=normal,
    )
