"""A resonance read off measured frequency responses: frequency, damping and residues, each with its deviation.

For rigs with a measured force. Near one resonance, accelerances are R B(f) + c0 + c1 f, with the resonance B = -w^2 /
(w_r^2 - w^2 + 2 i zeta w_r w) and a straight line for all other modes. All responses share the pole. Linear parameters
are solved for at every step (variable projection), so that only frequency and damping are searched.

Neighbouring lines err together (leakage, averaging), so the deviations are those of Newey and West, which count it,
with each line's error as a fit without that line would have it (HC3, MacKinnon & White 1985).
For many close modes at once see sdypy-EMA; here modes must be apart by a few bandwidths.

References
----------
Golub, G. & Pereyra, V. (1973). The differentiation of pseudo-inverses and nonlinear least squares problems whose
variables separate. SIAM Journal on Numerical Analysis 10(2), 413-432.
Newey, W. & West, K. (1987). A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
covariance matrix. Econometrica 55(3), 703-708.
MacKinnon, J. & White, H. (1985). Some heteroskedasticity-consistent covariance matrix estimators with improved finite
sample properties. Journal of Econometrics 29(3), 305-325.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray, IndexArray
from oma.errors import IdentificationError
from oma.types import ComplexArray

_REACH = 6.0  # zeta f on either side of a resonance that are fitted
_MIN_LINES = 12  # on either side
_DAMPING = 5e-3  # where the search begins
_MAX_DAMPING = 0.2  # beyond it no resonance is visible
_ROUNDS = 4  # rounds of fitting and selecting the lines
_LAGS = 2  # lines over which errors are taken to be alike


@dataclass(frozen=True, eq=False, kw_only=True)
class Resonance:
    """One mode in frequency responses (n_responses) of one force."""

    frequency: float  #: [Hz]
    frequency_std: float
    damping: float  #: ratio of critical [-]
    damping_std: float
    residue: ComplexArray  #: (n_responses,) product of the mass-normalised shape there and at the force [1/kg]
    residue_std: FloatArray  #: (n_responses,) of the real part
    misfit: float  #: rms of the residual relative to the largest response [-]


def fit_resonance(frequency: FloatArray, response: ComplexArray, band: tuple[float, float]) -> Resonance:
    """Fit the largest resonance in a band.

    Parameters
    ----------
    frequency : (n,) equally spaced lines [Hz]
    response : (n, n_responses) accelerances [m/s2/N]
    band : from, to [Hz]: where the largest response is looked for

    Raises
    ------
    ValueError
        If the shapes do not agree.
    IdentificationError
        If the band has too few lines, or no resonance.
    """
    if response.ndim != 2 or len(response) != len(frequency):
        raise ValueError(f"response: expected ({len(frequency)}, n_responses), found {response.shape}")
    inside = np.flatnonzero((frequency >= band[0]) & (frequency <= band[1]))
    if len(inside) < 2 * _MIN_LINES:
        raise IdentificationError(
            f"{band[0]:g} to {band[1]:g} Hz: expected {2 * _MIN_LINES} lines or more, found {len(inside)}"
        )
    peak = frequency[inside[np.argmax(np.linalg.norm(response[inside], axis=1))]]
    pole, spacing = np.array([peak, _DAMPING]), float(frequency[1] - frequency[0])
    near = _around(pole, frequency, spacing)
    for _ in range(_ROUNDS):
        found = scipy.optimize.least_squares(
            _rest, pole, args=(frequency[near], response[near]), x_scale=[spacing, _DAMPING]
        )
        pole = np.array([found.x[0], abs(found.x[1])])
        if not band[0] <= pole[0] <= band[1] or pole[1] > _MAX_DAMPING:
            raise IdentificationError(f"{band[0]:g} to {band[1]:g} Hz: no resonance there")
        before, near = near, _around(pole, frequency, spacing)
        if np.array_equal(before, near):
            break
    return _with_deviations(pole, frequency[before], response[before])


def _around(pole: FloatArray, frequency: FloatArray, spacing: float) -> IndexArray:
    """Return the lines that a resonance is fitted to."""
    reach = max(_REACH * pole[1] * pole[0], _MIN_LINES * spacing)
    return np.flatnonzero(np.abs(frequency - pole[0]) <= reach)


def _terms(pole: FloatArray, line: FloatArray) -> ComplexArray:
    """Return resonance and straight line (n, 3)."""
    r = line / pole[0]
    resonance = -(r**2) / (1 - r**2 + 2j * pole[1] * r)
    return np.stack([resonance, np.ones_like(line), line - pole[0]], axis=1).astype(np.complex128)


def _rest(pole: FloatArray, line: FloatArray, measured: ComplexArray) -> FloatArray:
    basis = np.linalg.qr(_terms(pole, line))[0]
    rest = measured - basis @ (basis.conj().T @ measured)
    return np.concatenate([rest.real.ravel(), rest.imag.ravel()])


def _with_deviations(pole: FloatArray, line: FloatArray, measured: ComplexArray) -> Resonance:
    n_responses = measured.shape[1]
    terms = _terms(pole, line)
    linear = np.asarray(np.linalg.lstsq(terms, measured, rcond=None)[0])
    step = 1e-6 * pole
    moved = [(_terms(pole + d, line) - _terms(pole - d, line)) @ linear / (2 * d.sum()) for d in np.diag(step)]
    of_linear = np.einsum("nt,or->notr", terms, np.eye(n_responses)).reshape(len(line), n_responses, -1)
    slope = np.concatenate([np.stack(moved, axis=2), of_linear, 1j * of_linear], axis=2)
    rest = terms @ linear - measured
    covariance = _covariance(slope, rest)
    std = np.sqrt(np.diag(covariance))
    return Resonance(
        frequency=float(pole[0]),
        frequency_std=float(std[0]),
        damping=float(pole[1]),
        damping_std=float(std[1]),
        residue=linear[0],
        residue_std=std[2 : 2 + n_responses],
        misfit=float(np.sqrt((np.abs(rest) ** 2).mean()) / np.abs(measured).max()),
    )


def _covariance(slope: ComplexArray, rest: ComplexArray) -> FloatArray:
    """Return the covariance of parameters from slopes (n, n_responses, p) and residuals (n, n_responses)."""
    real = np.concatenate([slope.real, slope.imag], axis=1)
    left = np.concatenate([rest.real, rest.imag], axis=1)
    normal = np.linalg.inv(np.einsum("nri,nrj->ij", real, real))
    leverage = np.einsum("nri,ij,nrj->nr", real, normal, real)
    score = real * (left / (1 - leverage))[:, :, None]  # residual of a fit without that line
    meat = np.einsum("nri,nrj->ij", score, score)
    for lag in range(1, _LAGS + 1):
        shifted = (1 - lag / (_LAGS + 1)) * np.einsum("nri,nrj->ij", score[lag:], score[:-lag])
        meat += shifted + shifted.T
    return np.asarray(normal @ meat @ normal)
