"""Modes of measured frequency responses: rational fractions of rising order, then a fit of their poles with deviations.

Poles that repeat from order to order of the poly-reference fractions are the start. Modes that are near each other are
fitted together to the lines about them, as sums of resonances and a straight line for all other modes (as
`fit_resonance`, for several modes and inputs). Deviations are those of Newey and West over lines, with the residual
that a fit without the line would have, and all responses of a line together: the noise of the force is in all of them.

References
----------
Guillaume, P., Verboven, P., Vanlanduit, S., Van der Auweraer, H., Peeters, B. (2003). A poly-reference implementation
of the least-squares complex frequency-domain estimator. Proceedings of IMAC XXI.
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
from oma.errors import IdentificationError, InputError, TooFewModes
from oma.mac import normalise
from oma.methods.matrix_fraction import HalfSpectrum, MatrixFraction, matrix_fractions
from oma.selection import Selection, Stabilization, groups, stabilization
from oma.types import ComplexArray, ModalEstimate

_MIN_LINES = 60  # in the band
_LINES_A_POWER = 4
_N_ORDERS, _MAX_ORDER = 12, 80
_MIN_SHARE = 0.5  # of the orders that show a mode
_REACH, _REACH_LINES = 6.0, 12  # zeta f, and lines, on either side of a resonance that are fitted
_MAX_TOGETHER = 6  # modes in one fit
_ROUNDS = 3
_LAGS = 2  # lines over which errors are alike
_SIGNIFICANT = 5.0  # residue over its standard deviation, rms over all responses
_SELECTION = Selection(min_damping=1e-5)


def identify_responses(
    frequency: FloatArray,
    response: ComplexArray,
    channels: Sequence[str],
    band: tuple[float, float] | None = None,
) -> ModalEstimate:
    """Identify modes from the responses of a structure to measured forces.

    Parameters
    ----------
    frequency : (n_lines,) evenly spaced lines [Hz]
    response : (n_lines, n_channels, n_inputs) accelerances [m/s2/N]
    channels : names
    band : frequencies in which modes are sought [Hz]. Default: that of the lines

    Returns
    -------
    ModalEstimate
        Its `support` is the share of orders that show the mode.

    Raises
    ------
    InputError
        If shapes do not agree, or the lines are not even.
    TooFewModes, IdentificationError
        If the band has too few lines, or nothing is a mode.
    """
    if response.ndim != 3 or response.shape[:2] != (len(frequency), len(channels)):
        raise InputError(f"response: expected ({len(frequency)}, {len(channels)}, n_inputs), found {response.shape}")
    spacing = float(np.median(np.diff(frequency))) if len(frequency) > 1 else 0.0
    if spacing <= 0 or np.abs(np.diff(frequency) / spacing - 1).max() > 1e-2:
        raise InputError("frequency: expected evenly spaced, rising lines")
    low, high = band or (max(float(frequency[0]), spacing), float(frequency[-1]))
    inside = (frequency >= low) & (frequency <= high) & (frequency > 0.5 * spacing)
    if np.count_nonzero(inside) < _MIN_LINES:
        raise IdentificationError(f"{low:g} to {high:g} Hz: expected {_MIN_LINES} lines or more")
    line, measured = frequency[inside], response[inside]
    poles = _stable_poles(line, measured, spacing, (low, high))
    found = list(_fitted_modes(poles, line, measured, spacing))
    if not found:
        raise TooFewModes(len(poles))
    found.sort(key=lambda mode: mode.frequency)
    shape = np.array([mode.shape for mode in found])
    return ModalEstimate(
        channels=tuple(channels),
        frequency=np.array([mode.frequency for mode in found]),
        frequency_std=np.array([mode.frequency_std for mode in found]),
        damping=np.array([mode.damping for mode in found]),
        damping_std=np.array([mode.damping_std for mode in found]),
        shape=normalise(shape),
        shape_std=np.array([mode.shape_std for mode in found]),
        support=np.array([mode.support for mode in found]),
        law_ratio=np.ones(len(found)),
        start=0,
        end=0,
    )


@dataclass(frozen=True, kw_only=True)
class _Pole:
    """A pole that repeats from order to order."""

    frequency: float
    damping: float
    support: float


@dataclass(frozen=True, eq=False, kw_only=True)
class _FittedMode:
    """One mode with its deviations."""

    frequency: float
    frequency_std: float
    damping: float
    damping_std: float
    shape: ComplexArray  # (n_channels,) of unit norm
    shape_std: FloatArray
    support: float


@dataclass(frozen=True, eq=False, kw_only=True)
class _Order:
    """Poles and shapes of one order."""

    order: int
    continuous: ComplexArray
    shape: ComplexArray


def _stable_poles(line: FloatArray, measured: ComplexArray, spacing: float, band: tuple[float, float]) -> list[_Pole]:
    """Return the poles that most orders of the fractions show."""
    n_fft = 2 * (int(np.ceil(line[-1] / spacing)) + 1)
    place = np.rint(line / spacing).astype(np.intp)
    values = np.zeros((n_fft, *measured.shape[1:]), np.complex128)
    values[place], values[-place] = measured, measured.conj()
    size = np.sum(np.abs(values) ** 2, axis=(1, 2))
    weight = np.where(size > 0, 1 / np.maximum(size, 1e-12 * size.max()), 0.0)
    n_inputs = measured.shape[2]
    largest = max(2, min(_MAX_ORDER // n_inputs, len(line) // (_LINES_A_POWER * n_inputs)))
    powers = sorted({int(p) for p in np.linspace(max(2, largest / 3), largest, _N_ORDERS)})
    fractions = matrix_fractions(HalfSpectrum(values=values, weight=weight), powers)
    orders = [_order(fraction, line, measured, n_fft * spacing) for fraction in fractions]
    found = stabilization(orders, band, _SELECTION)
    stable = found[found.stable & (found.damping > 0)]
    return list(_grouped(stable, len(orders)))


def _order(fraction: MatrixFraction, line: FloatArray, measured: ComplexArray, rate: float) -> _Order:
    """Return the poles of a fraction in the band, with shapes by least squares over the lines."""
    pole = -np.log(fraction.root) * rate
    kept = (pole.imag > 0) & (pole.real < 0) & (pole.imag < 2 * np.pi * line[-1] * 1.1)
    pole, left = pole[kept], fraction.left_vector[kept]
    n_inputs, s = measured.shape[2], 2j * np.pi * line
    halves = [
        participation / (s[:, None, None] - p[:, None])
        for p, participation in ((pole, left), (pole.conj(), left.conj()))
    ]
    size = (2 * np.pi * line / line[-1])[:, None, None]
    beyond = [power * np.eye(n_inputs) for power in (np.ones_like(size), size**2)]
    design = np.concatenate([*(half.transpose(0, 2, 1) for half in halves), *beyond], axis=2)
    design = design.reshape(len(line) * n_inputs, -1)
    weight = 1 / np.sqrt(np.sum(np.abs(measured) ** 2, axis=(1, 2)))
    rows = np.repeat(weight, n_inputs)[:, None]
    wanted = measured.transpose(0, 2, 1).reshape(len(line) * n_inputs, -1)
    shape = np.linalg.lstsq(design * rows, wanted * rows, rcond=None)[0][: len(pole)]
    return _Order(order=len(fraction.root), continuous=pole, shape=shape)


def _grouped(poles: Stabilization, n_orders: int) -> Iterator[_Pole]:
    """Yield the middle of each group of poles that enough orders show."""
    for group in groups(poles.frequency, poles.shape, poles.order, _SELECTION.cut):
        support = len(np.unique(poles.order[group])) / n_orders
        if support >= _MIN_SHARE:
            yield _Pole(
                frequency=float(np.median(poles.frequency[group])),
                damping=float(np.median(poles.damping[group])),
                support=min(support, 1.0),
            )


def _fitted_modes(
    poles: Sequence[_Pole], line: FloatArray, measured: ComplexArray, spacing: float
) -> Iterator[_FittedMode]:
    """Yield the modes of all poles, fitted together with those near them."""
    flat = measured.reshape(len(line), -1)
    for near in _clusters(sorted(poles, key=lambda pole: pole.frequency), spacing):
        kept, modes = list(near), list[_FittedMode | None]()
        while kept and (not modes or None in modes):  # again without those that are no modes
            kept = [pole for pole, mode in zip(kept, modes or kept, strict=True) if mode is not None]
            modes = list(_fitted_together(kept, line, flat, measured.shape[1:], spacing)) if kept else []
        yield from (mode for mode in modes if mode is not None)


def _fitted_together(
    near: Sequence[_Pole], line: FloatArray, flat: ComplexArray, shape: tuple[int, ...], spacing: float
) -> Iterator[_FittedMode | None]:
    """Yield the mode of each pole, None for one that is none."""
    start = np.array([[pole.frequency, pole.damping] for pole in near])
    pole, used = start, _around(start, line, spacing)
    for _ in range(_ROUNDS):
        pole = _fit(pole, line[used], flat[used], spacing)
        before, used = used, _around(pole, line, spacing)
        if np.array_equal(before, used) or not len(used):
            break
    yield from _with_deviations(near, start, pole, line[before], flat[before], shape)


def _clusters(poles: Sequence[_Pole], spacing: float) -> Iterator[list[_Pole]]:
    """Yield groups of poles whose lines overlap, each of `_MAX_TOGETHER` at most."""
    cluster: list[_Pole] = []
    for pole in poles:
        reach = _reach(cluster[-1], spacing) + _reach(pole, spacing) if cluster else 0.0
        if cluster and (pole.frequency - cluster[-1].frequency > reach or len(cluster) == _MAX_TOGETHER):
            yield cluster
            cluster = []
        cluster.append(pole)
    if cluster:
        yield cluster


def _reach(pole: _Pole, spacing: float) -> float:
    return max(_REACH * pole.damping * pole.frequency, _REACH_LINES * spacing)


def _around(pole: FloatArray, line: FloatArray, spacing: float) -> IndexArray:
    """Return the lines that modes (n_modes, 2) are fitted to."""
    reach = np.maximum(_REACH * pole[:, 1] * pole[:, 0], _REACH_LINES * spacing)
    return np.flatnonzero((np.abs(line[:, None] - pole[:, 0]) <= reach).any(axis=1))


def _terms(pole: FloatArray, line: FloatArray) -> ComplexArray:
    """Return resonances and a straight line (n_lines, n_modes + 2)."""
    ratio = line[:, None] / pole[:, 0]
    resonance = -(ratio**2) / (1 - ratio**2 + 2j * pole[:, 1] * ratio)
    middle = line.mean()
    rest = np.stack([np.ones_like(line), (line - middle) / max(np.ptp(line), 1e-300)], axis=1)
    return np.concatenate([resonance, rest], axis=1).astype(np.complex128)


def _fit(pole: FloatArray, line: FloatArray, measured: ComplexArray, spacing: float) -> FloatArray:
    """Return poles (n_modes, 2) by variable projection."""

    def rest(flat: FloatArray) -> FloatArray:
        basis = np.linalg.qr(_terms(flat.reshape(-1, 2), line))[0]
        left = measured - basis @ (basis.conj().T @ measured)
        return np.concatenate([left.real.ravel(), left.imag.ravel()])

    lower = np.column_stack([0.9 * pole[:, 0], np.full(len(pole), 1e-7)]).ravel()
    upper = np.column_stack([1.1 * pole[:, 0], np.full(len(pole), 0.3)]).ravel()
    scale = np.column_stack([np.full(len(pole), spacing), pole[:, 1]]).ravel()
    found = least_squares(rest, np.clip(pole.ravel(), lower, upper), bounds=(lower, upper), x_scale=scale)
    return np.asarray(found.x.reshape(-1, 2))


def _with_deviations(
    near: Sequence[_Pole],
    start: FloatArray,
    pole: FloatArray,
    line: FloatArray,
    measured: ComplexArray,
    shape: tuple[int, ...],
) -> Iterator[_FittedMode | None]:
    """Yield fitted modes, None in place of one that is not significant or not near where it began."""
    terms = _terms(pole, line)
    basis, triangle = np.linalg.qr(terms)
    linear = np.asarray(np.linalg.solve(triangle, basis.conj().T @ measured), np.complex128)
    left, free = measured - terms @ linear, 1 - np.minimum(np.sum(np.abs(basis) ** 2, axis=1), 0.9)
    std = np.sqrt(np.diag(_pole_covariance(pole, line, basis, linear, left, free))).reshape(-1, 2)
    inverse = np.linalg.solve(triangle, basis.conj().T)
    residue_std = np.sqrt(_variance(inverse, left / free[:, None]) / 2)
    for k, (origin, (frequency, damping)) in enumerate(zip(near, pole.tolist(), strict=True)):
        residue, deviation = linear[k].reshape(shape), residue_std[k].reshape(shape)
        strength = np.sqrt(np.sum(np.abs(residue) ** 2) / max(2 * float(np.sum(deviation**2)), 1e-300))
        inside = line[0] <= frequency <= line[-1] and abs(frequency / start[k, 0] - 1) < _SELECTION.max_shift
        if not inside or damping <= 2e-7 or damping > _SELECTION.max_damping or strength < _SIGNIFICANT:
            yield None
            continue
        left_vectors, sizes, right = np.linalg.svd(residue, full_matrices=False)
        yield _FittedMode(
            frequency=frequency,
            frequency_std=float(std[k, 0]),
            damping=damping,
            damping_std=float(std[k, 1]),
            shape=left_vectors[:, 0],
            shape_std=np.sqrt(deviation**2 @ np.abs(right[0]) ** 2) / sizes[0],
            support=origin.support,
        )


def _pole_covariance(
    pole: FloatArray,
    line: FloatArray,
    basis: ComplexArray,
    linear: ComplexArray,
    left: ComplexArray,
    free: FloatArray,
) -> FloatArray:
    """Return the covariance of poles (2 n_modes, 2 n_modes), residues and straight lines fitted with them.

    The score of a line is the one that a fit without this line would give it.
    """
    slopes = []
    for k in range(pole.size):
        step = np.zeros(pole.size)
        step[k] = 1e-6 * pole.ravel()[k]
        moved = [_terms(pole + sign * step.reshape(-1, 2), line) for sign in (1, -1)]
        slope = (moved[0] - moved[1]) @ linear / (2 * step[k])
        slopes.append(slope - basis @ (basis.conj().T @ slope))
    stacked = np.array(slopes)
    own = np.einsum("inr,jnr->nij", stacked.conj(), stacked).real
    gram = own.sum(axis=0)
    score = np.einsum("inr,nr->ni", stacked.conj(), left).real
    without = np.linalg.pinv(free[:, None, None] * gram - own)
    normal = np.linalg.pinv(gram)
    return np.asarray(normal @ _newey_west(np.einsum("ij,njk,nk->ni", gram, without, score)) @ normal)


def _newey_west(score: FloatArray) -> FloatArray:
    """Return the covariance of the sum of scores (n_lines, n_parameters) of neighbouring lines."""
    meat = score.T @ score
    for lag in range(1, _LAGS + 1):
        shifted = (1 - lag / (_LAGS + 1)) * score[lag:].T @ score[:-lag]
        meat += shifted + shifted.T
    return np.asarray(meat)


def _variance(inverse: ComplexArray, left: ComplexArray) -> FloatArray:
    """Return the variances (n_terms, n_responses) of complex coefficients, poles held, from residuals of lines."""
    score = inverse[:, :, None] * left
    meat = np.sum(np.abs(score) ** 2, axis=1)
    for lag in range(1, _LAGS + 1):
        meat += 2 * (1 - lag / (_LAGS + 1)) * np.sum((score[:, lag:] * score[:, :-lag].conj()).real, axis=1)
    return np.asarray(np.maximum(meat, 0.0))
