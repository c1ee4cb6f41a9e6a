"""Fit of resonances to the lines about them, with deviations.

Modes that are near each other are fitted together, as sums of resonances and a straight line for all other modes (as
`fit_resonance`, for several modes and inputs). Deviations are those of Newey and West over lines, with the residual
that a fit without the line would have, and all responses of a line together: the noise of the force is in all of them.
Lines and responses are in units of their noise, if coherences state it.

References
----------
Golub, G. & Pereyra, V. (1973). The differentiation of pseudo-inverses and nonlinear least squares problems whose
variables separate. SIAM Journal on Numerical Analysis 10(2), 413-432.
Newey, W. & West, K. (1987). A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
covariance matrix. Econometrica 55(3), 703-708.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from daq import FloatArray, IndexArray
from oma.responses.lines import Lines
from oma.responses.stable_poles import SELECTION, StablePole
from oma.types import ComplexArray

_REACH, _REACH_LINES = 6.0, 12  # zeta f, and lines, on either side of a resonance that are fitted
_MAX_TOGETHER = 6  # modes in one fit
_ROUNDS = 3  # of fitting and choosing the lines
_MORE_PASSES = 1  # over all modes, the others subtracted
_LAGS = 2  # lines over which errors are alike
_LEAST_DAMPING = 2e-7  # of a mode: smaller is none
_LEAST_SHARE = 0.1  # of the noise variance in residuals: smaller ones are rounding
_SIGNIFICANT = 5.0  # residue over its standard deviation, rms over all responses


@dataclass(frozen=True, eq=False, kw_only=True)
class FittedMode:
    """One mode with its deviations."""

    frequency: float  #: [Hz]
    frequency_std: float  #: [Hz]
    damping: float  #: [-]
    damping_std: float  #: [-]
    residue: ComplexArray  #: (n_channels, n_inputs) product of mass-normalised components [1/kg]
    residue_std: FloatArray  #: (n_channels, n_inputs) of the real part, poles held [1/kg]
    residue_moves: ComplexArray
    """(n_moves, n_channels, n_inputs) independent moves of the residue by errors of the poles, one sigma each [1/kg]"""
    support: float  #: [-]

    @property
    def pole(self) -> FloatArray:
        """Frequency and damping, (1, 2)."""
        return np.array([[self.frequency, self.damping]])


def fitted_modes(poles: Sequence[StablePole], lines: Lines) -> list[FittedMode]:
    """Return the modes of all poles that are significant, fitted together with those near them.

    Modes of the previous pass that are farther away are subtracted, so that the straight line has only what no mode
    explains.
    """
    modes = list(_one_pass(poles, (), lines))
    for _ in range(_MORE_PASSES):
        again = [StablePole(frequency=m.frequency, damping=m.damping, support=m.support) for m in modes]
        modes = list(_one_pass(again, modes, lines))
    return modes


def _one_pass(poles: Sequence[StablePole], known: Sequence[FittedMode], lines: Lines) -> Iterator[FittedMode]:
    """Yield the significant modes of all poles; those known that are in no fit are subtracted from it."""
    for near in _clusters(sorted(poles, key=lambda pole: pole.frequency), lines.spacing):
        inside = {pole.frequency for pole in near}
        rest = lines.without(
            [_resonances(m.pole, lines)[:, :, None] * m.residue for m in known if m.frequency not in inside]
        )
        kept, modes = list(near), list[FittedMode | None]()
        while kept and (not modes or None in modes):  # again without those that are no modes
            kept = [pole for pole, mode in zip(kept, modes or kept, strict=True) if mode is not None]
            modes = list(_fitted_together(kept, rest)) if kept else []
        yield from (mode for mode in modes if mode is not None)


def _fitted_together(near: Sequence[StablePole], lines: Lines) -> Iterator[FittedMode | None]:
    """Yield the mode of each pole, None for one that is none."""
    start = np.array([[pole.frequency, pole.damping] for pole in near])
    pole, used = start, _around(start, lines)
    for _ in range(_ROUNDS):
        pole = _fit(pole, lines[used])
        before, used = used, _around(pole, lines)
        if np.array_equal(before, used) or not len(used):
            break
    yield from _with_deviations(near, start, pole, lines[before])


def _clusters(poles: Sequence[StablePole], spacing: float) -> Iterator[list[StablePole]]:
    """Yield groups of poles whose lines overlap, each of `_MAX_TOGETHER` at most."""
    cluster: list[StablePole] = []
    for pole in poles:
        reach = _reach(cluster[-1], spacing) + _reach(pole, spacing) if cluster else 0.0
        if cluster and (pole.frequency - cluster[-1].frequency > reach or len(cluster) == _MAX_TOGETHER):
            yield cluster
            cluster = []
        cluster.append(pole)
    if cluster:
        yield cluster


def _reach(pole: StablePole, spacing: float) -> float:
    return max(_REACH * pole.damping * pole.frequency, _REACH_LINES * spacing)


def _around(pole: FloatArray, lines: Lines) -> IndexArray:
    """Return the lines that modes (n_modes, 2) are fitted to."""
    reach = np.maximum(_REACH * pole[:, 1] * pole[:, 0], _REACH_LINES * lines.spacing)
    return np.flatnonzero((np.abs(lines.frequency[:, None] - pole[:, 0]) <= reach).any(axis=1))


def _terms(pole: FloatArray, lines: Lines) -> ComplexArray:
    """Return resonances and a straight line (n_lines, n_modes + 2), in units of the noise of lines."""
    line = lines.frequency
    rest = np.stack([np.ones_like(line), (line - line.mean()) / max(np.ptp(line), 1e-300)], axis=1)
    terms = np.concatenate([_resonances(pole, lines), rest], axis=1).astype(np.complex128)
    return np.asarray(terms / lines.line_noise[:, None])


def _resonances(pole: FloatArray, lines: Lines) -> ComplexArray:
    """Return resonances (n_lines, n_modes) of poles (n_modes, 2)."""
    ratio = lines.laplace[:, None] / (2 * np.pi * pole[:, 0])
    return np.asarray(ratio**2 / (1 + ratio**2 + 2 * pole[:, 1] * ratio))


def _fit(pole: FloatArray, lines: Lines) -> FloatArray:
    """Return poles (n_modes, 2) by variable projection."""
    measured = lines.white

    def rest(flat: FloatArray) -> FloatArray:
        basis = np.linalg.qr(_terms(flat.reshape(-1, 2), lines))[0]
        left = measured - basis @ (basis.conj().T @ measured)
        return np.concatenate([left.real.ravel(), left.imag.ravel()])

    lower = np.column_stack([0.9 * pole[:, 0], np.full(len(pole), _LEAST_DAMPING / 2)]).ravel()
    upper = np.column_stack([1.1 * pole[:, 0], np.full(len(pole), 0.3)]).ravel()
    scale = np.column_stack([np.full(len(pole), lines.spacing), pole[:, 1]]).ravel()
    found = least_squares(rest, np.clip(pole.ravel(), lower, upper), bounds=(lower, upper), x_scale=scale)
    return np.asarray(found.x.reshape(-1, 2))


def _with_deviations(
    near: Sequence[StablePole], start: FloatArray, pole: FloatArray, lines: Lines
) -> Iterator[FittedMode | None]:
    """Yield fitted modes, None in place of one that is not significant or not near where it began."""
    measured, noise = lines.white, lines.response_noise
    terms = _terms(pole, lines)
    basis, triangle = np.linalg.qr(terms)
    linear = np.asarray(np.linalg.solve(triangle, basis.conj().T @ measured), np.complex128)
    left, free = measured - terms @ linear, np.maximum(_residual_share(basis, lines), _LEAST_SHARE)
    if lines.decay:  # no line is independent of the others: the fit without it says nothing of its error
        left, free = left / np.sqrt(free)[:, None], np.ones_like(free)
    slopes = _slopes(pole, lines, linear)
    lags = 0 if lines.decay else _LAGS  # the correlation of the window is known
    across = slopes - basis @ (basis.conj().T @ slopes)
    covariance = _pole_covariance(across, left, free, lags) * _inflation(across, lines)
    std = np.sqrt(np.diag(covariance)).reshape(-1, 2)
    inverse = np.linalg.solve(triangle, basis.conj().T)
    gain = _gain(inverse.conj().T, lines)
    residue_std = np.sqrt(gain[:, None] * _variance(inverse, left / free[:, None], lags) / 2)
    moves = np.einsum("im,itr->mtr", _root(covariance), -inverse @ slopes)
    for k, (origin, (frequency, damping)) in enumerate(zip(near, pole.tolist(), strict=True)):
        residue, deviation = linear[k].reshape(noise.shape), residue_std[k].reshape(noise.shape)
        strength = np.sqrt(np.sum(np.abs(residue) ** 2) / max(2 * float(np.sum(deviation**2)), 1e-300))
        inside = (
            lines.frequency[0] <= frequency <= lines.frequency[-1]
            and abs(frequency / start[k, 0] - 1) < SELECTION.max_shift
        )
        if not inside or not _LEAST_DAMPING < damping <= SELECTION.max_damping or strength < _SIGNIFICANT:
            yield None
            continue
        yield FittedMode(
            frequency=frequency,
            frequency_std=float(std[k, 0]),
            damping=damping,
            damping_std=float(std[k, 1]),
            residue=residue * noise,
            residue_std=deviation * noise,
            residue_moves=moves[:, k].reshape(-1, *noise.shape) * noise,
            support=origin.support,
        )


def _slopes(pole: FloatArray, lines: Lines, linear: ComplexArray) -> ComplexArray:
    """Return the derivatives of the fitted responses by the poles, residues held, (2 n_modes, n_lines, n_responses)."""
    slopes = []
    for k in range(pole.size):
        step = np.zeros(pole.size)
        step[k] = 1e-6 * pole.ravel()[k]
        moved = [_terms(pole + sign * step.reshape(-1, 2), lines) for sign in (1, -1)]
        slopes.append((moved[0] - moved[1]) @ linear / (2 * step[k]))
    return np.array(slopes)


def _residual_share(basis: ComplexArray, lines: Lines) -> FloatArray:
    """Return the share of the noise variance that the residuals of a linear fit keep, (n_lines,)."""
    alike = lines.correlated(basis)
    both = basis @ (basis.conj().T @ alike) - 2 * alike
    return np.asarray(1 + np.sum(both * basis.conj(), axis=1).real)


def _gain(influence: ComplexArray, lines: Lines) -> FloatArray:
    """Return the variance of sums (n_lines, n) with correlated noise over that with independent noise, (n,)."""
    size = np.sum(np.abs(influence) ** 2, axis=0)
    return np.asarray(np.sum(influence.conj() * lines.correlated(influence), axis=0).real / size)


def _inflation(slopes: ComplexArray, lines: Lines) -> FloatArray:
    """Return the factor of the covariance of poles by the correlation of lines, (2 n_modes, 2 n_modes)."""
    of_lines = slopes.transpose(1, 0, 2)  # (n_lines, 2 n_modes, n_responses)
    alike = lines.correlated(of_lines.reshape(len(of_lines), -1)).reshape(of_lines.shape)
    variance = np.sum(of_lines.conj() * alike, axis=(0, 2)).real
    gain = np.sqrt(variance / np.sum(np.abs(slopes) ** 2, axis=(1, 2)))
    return np.asarray(np.outer(gain, gain))


def _pole_covariance(slopes: ComplexArray, left: ComplexArray, free: FloatArray, lags: int) -> FloatArray:
    """Return the covariance of poles (2 n_modes, 2 n_modes), residues and straight lines fitted with them.

    The score of a line is the one that a fit without this line would give it.
    """
    own = np.einsum("inr,jnr->nij", slopes.conj(), slopes).real
    gram = own.sum(axis=0)
    score = np.einsum("inr,nr->ni", slopes.conj(), left).real
    without = np.linalg.pinv(free[:, None, None] * gram - own)
    normal = np.linalg.pinv(gram)
    return np.asarray(normal @ _newey_west(np.einsum("ij,njk,nk->ni", gram, without, score), lags) @ normal)


def _root(covariance: FloatArray) -> FloatArray:
    """Return a matrix whose product with its transpose is the covariance."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _newey_west(score: FloatArray, lags: int) -> FloatArray:
    """Return the covariance of the sum of scores (n_lines, n_parameters) of neighbouring lines."""
    meat = score.T @ score
    for lag in range(1, lags + 1):
        shifted = (1 - lag / (lags + 1)) * score[lag:].T @ score[:-lag]
        meat += shifted + shifted.T
    return np.asarray(meat)


def _variance(inverse: ComplexArray, left: ComplexArray, lags: int) -> FloatArray:
    """Return the variances (n_terms, n_responses) of complex coefficients, poles held, from residuals of lines."""
    score = inverse[:, :, None] * left
    meat = np.sum(np.abs(score) ** 2, axis=1)
    for lag in range(1, lags + 1):
        meat += 2 * (1 - lag / (lags + 1)) * np.sum((score[:, lag:] * score[:, :-lag].conj()).real, axis=1)
    return np.asarray(np.maximum(meat, 0.0))
