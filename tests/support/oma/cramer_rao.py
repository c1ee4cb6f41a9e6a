"""The smallest errors that any method can have on a simulated window: the Cramér-Rao bound of Whittle's likelihood.

Fourier coefficients of a long window are independent, complex Gaussian, with the spectral matrix S(f) as covariance. Of
parameters a and b, the information is the sum of tr(S^-1 dS/da S^-1 dS/db) over the lines. Everything is taken as
unknown: frequencies, damping, shapes, the spectral matrix of the modal forces, and the noise.

References
----------
Whittle, P. (1953). The analysis of multiple stationary time series. Journal of the Royal Statistical Society B 15(1),
125-139.
"""

from dataclasses import dataclass

import numpy as np
from scipy import signal

from daq import FloatArray
from oma import ComplexArray
from tests.support.oma.structures import Structure

_BATCH = 200  # lines at a time
_NODES = 50  # of the quadrature, on each side of a resonance


@dataclass(frozen=True, eq=False, kw_only=True)
class Bound:
    """Smallest standard deviations of an unbiased estimate."""

    frequency: FloatArray  # (n_modes,) Hz
    damping: FloatArray  # (n_modes,)


def whittle_bound(
    structure: Structure, duration: float, rate: float, noise_variance: float, forced: list[int] | slice = slice(None)
) -> Bound:
    """Return the bound for windows of `simulate` (tests.support.oma.structures).

    `noise_variance` is that of each channel's noise.
    """
    nodes = _nodes(structure, rate)
    lines, weight = 2 * np.pi * nodes / rate, duration * np.gradient(nodes)
    force = structure.shapes[:, forced] @ structure.shapes[:, forced].T
    n_batches = -(-len(lines) // _BATCH)
    parts = zip(np.array_split(lines, n_batches), np.array_split(weight, n_batches), strict=True)
    information = np.sum([_information(structure, rate, *part, force, noise_variance) for part in parts], axis=0)
    size = np.sqrt(np.diag(information))
    deviation = np.sqrt(np.diag(np.linalg.inv(information / np.outer(size, size)))) / size
    m = len(structure.frequency)
    return Bound(frequency=deviation[:m], damping=deviation[m : 2 * m])


def _nodes(structure: Structure, rate: float) -> FloatArray:
    """Return frequencies [Hz] to integrate over: dense about resonances, ever less so away from them."""
    half_width = (structure.damping * structure.frequency)[:, None]
    away = half_width * np.sinh(np.linspace(0, 1, _NODES) * np.arcsinh(rate / half_width))
    around = structure.frequency[:, None] + np.concatenate((-away[:, ::-1], away), axis=1)
    return np.unique(around[(around > 0) & (around < rate / 2)])


def response_to(frequency: float, damping: float, rate: float, lines: FloatArray) -> ComplexArray:
    """Return the accelerance of one mode under forces held between samples, at angles a sample."""
    omega = 2 * np.pi * frequency
    system = (np.array([1.0, 0.0, 0.0]), np.array([1.0, 2 * damping * omega, omega**2]))
    numerator, denominator, _ = signal.cont2discrete(system, 1 / rate, method="zoh")
    return np.asarray(signal.freqz(numerator.ravel(), denominator, lines)[1], dtype=np.complex128)


def _information(
    structure: Structure,
    rate: float,
    lines: FloatArray,
    weight: FloatArray,
    force: FloatArray,
    noise_variance: float,
) -> FloatArray:
    """Return the information of some lines about frequencies, damping, and all else (n, n)."""
    shapes, (m, n) = structure.shapes, structure.shapes.shape
    modes = list(zip(structure.frequency, structure.damping, strict=True))
    h = np.stack([response_to(f, z, rate, lines) for f, z in modes], axis=1)
    step = 1e-5
    by_f = [_slope(f * (1 - step), z, f * (1 + step), z, rate, lines) / (2 * step * f) for f, z in modes]
    by_z = [_slope(f, z * (1 - step), f, z * (1 + step), rate, lines) / (2 * step * z) for f, z in modes]
    waves = h[:, :, None] * shapes  # (lines, modes, channels)
    rows = np.einsum("ij,ljc->lic", force, waves.conj())
    spectrum = np.einsum("lic,lid->lcd", waves, rows) + noise_variance * np.eye(n)
    halves = [np.einsum("l,c,ld->lcd", d[i], shapes[i], rows[:, i]) for d in (by_f, by_z) for i in range(m)]
    for i in range(m):
        free = [c for c in range(n) if c != np.argmax(np.abs(shapes[i]))]  # the largest sets the scale
        halves += [np.einsum("l,c,ld->lcd", h[:, i], np.eye(n)[c], rows[:, i]) for c in free]
    for i in range(m):
        for j in range(i, m):
            pair = np.einsum("lc,ld->lcd", waves[:, i], waves[:, j].conj())
            halves += [pair] if i == j else [pair, 1j * pair]
    moves = np.stack(
        [half + half.conj().transpose(0, 2, 1) for half in halves] + [np.broadcast_to(np.eye(n), (len(lines), n, n))]
    )
    root = np.linalg.inv(np.linalg.cholesky(spectrum))
    white = np.matmul(np.matmul(root, moves), root.conj().transpose(0, 2, 1))
    white = (white * np.sqrt(weight)[:, None, None]).reshape(len(moves), -1)
    return np.asarray((white.real @ white.real.T) + (white.imag @ white.imag.T))


def _slope(f_low: float, z_low: float, f_high: float, z_high: float, rate: float, lines: FloatArray) -> ComplexArray:
    """Return the difference of two responses."""
    return response_to(f_high, z_high, rate, lines) - response_to(f_low, z_low, rate, lines)
