"""Resonances in a spectral matrix, found without a threshold that anyone would have to choose.

Every peak of a singular value is a candidate with its singular vector. It is a resonance if a bell explains the
spectrum that the vector filters out better than chance ever would, and if both halves of the record show the same
vector (the modal coherence of independent data). Then the poles near each other are refined together.

References
----------
Brincker, R., Andersen, P., Jacobsen, N.-J. (2007). Automated frequency domain decomposition for operational modal
analysis. Proceedings of IMAC-XXV: modal coherence and modal domain.
Zhang, L., Wang, T., Tamura, Y. (2010). A frequency-spatial domain decomposition (FSDD) method for operational modal
analysis. Mechanical Systems and Signal Processing 24(5), 1227-1239: the enhanced spectrum.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy  # its parts at their first use
from numpy.lib.stride_tricks import sliding_window_view

from daq import FloatArray
from oma.mac import mac, mpc, normalise
from oma.selection import Selection
from oma.spectral.bell_fit import BellFit, fit_bell
from oma.spectral.decomposition import MIN_LINES, Decomposition
from oma.types import ComplexArray

_WIDTHS_TRIED = 3
_BESIDE = 2  # lines on each side that a peak exceeds
_STANDS_OUT = 2.0  # standard deviations of a line that a peak exceeds its surroundings by: lower ones are not tried
_CHANCE = 1e-3  # of a false resonance among all lines of a spectrum of noise
_OVERLAP_GAIN = 0.95  # of the information in a record that half overlapping Hann windows leave (Welch 1967)
_SWEEPS = 2
_COMPARED = 2  # vectors of each half of the record: those of two close modes turn into each other
_MIN_COHERENCE = 0.5  # MAC of the vectors of two halves of the record: between that of noise (about 1/n) and 1
_FILTERED = 0.95  # MAC up to which the shape of another mode is filtered out: more costs more noise than it removes


@dataclass(frozen=True, eq=False, kw_only=True)
class SpectralResonance:
    """Resonance, and the lines in which it was found."""

    pole: complex  #: [rad/s]
    shape: ComplexArray  #: (n_channels,) of unit norm
    filter: ComplexArray  #: (n_channels,): passes `shape` and stops the shapes of close modes
    lines: slice  #: lines of its bell
    influence: (
        FloatArray  #: (2, n_lines) of the pole's imaginary and real part with these lines of the filtered spectrum
    )
    level: int  #: singular value that showed it, from 1
    coherence: float  #: MAC of the vectors of two halves of the record [-]
    gain: float  #: logarithm of the likelihood over that of no resonance

    @property
    def frequency(self) -> float:
        """Natural frequency [Hz]."""
        return abs(self.pole) / (2 * np.pi)

    @property
    def damping(self) -> float:
        """Ratio of critical [-]."""
        return -self.pole.real / abs(self.pole)


def resonances(
    parts: Decomposition, band: tuple[float, float], duration: float, limits: Selection
) -> list[SpectralResonance]:
    """Return the resonances in a band, by frequency.

    Parameters
    ----------
    parts : Decomposition
    band : (float, float)
        [Hz].
    duration : float
        Of the samples that entered [s].
    limits : Selection

    Returns
    -------
    list of SpectralResonance
    """
    found: list[SpectralResonance] = []
    for line, level in _peaks(parts.values, _least_peak(parts, duration)):
        candidate = _candidate(parts, line, level, duration)
        if candidate and _plausible(candidate, limits) and not _known(candidate, found, limits):
            found.append(candidate)
    for one in list(found):
        hidden = _hidden(parts, one, duration)
        if hidden and _plausible(hidden, limits) and not _known(hidden, found, limits):
            found.append(hidden)
    for _ in range(_SWEEPS):
        found = _refined(parts, found, duration, limits)
    inside = [one for one in found if band[0] < one.frequency < band[1]]
    return sorted(inside, key=lambda one: one.frequency)


def _peaks(values: FloatArray, least: float) -> list[tuple[int, int]]:
    """Return line and level of the peaks that are `least` times as high as their surroundings, the highest first."""
    padded = np.pad(values, ((_BESIDE, _BESIDE), (0, 0)))
    beside = np.stack([np.roll(padded, k, axis=0) for k in range(-_BESIDE, _BESIDE + 1) if k])[:, _BESIDE:-_BESIDE]
    lines, level = np.nonzero(np.all(values > beside, axis=0))
    inside = (lines >= _BESIDE) & (lines < len(values) - _BESIDE)
    lines, level = lines[inside], level[inside]
    height = values[lines, level] / _surroundings(values)[lines, level]
    order = np.argsort(-height, kind="stable")
    order = order[height[order] > least]
    return list(zip(lines[order].tolist(), level[order].tolist(), strict=True))


def _candidate(parts: Decomposition, line: int, level: int, duration: float) -> SpectralResonance | None:
    """Return a peak as a resonance, if a bell explains it."""
    vector = parts.vectors[line, level]
    pole = complex(-0.5 * parts.width, (line + parts.sums.first) * parts.width)
    coherence = _coherence(parts, line, vector)
    if coherence < _MIN_COHERENCE:
        return None
    return _fitted(parts, pole, vector, vector, [], level + 1, coherence, duration)


def _hidden(parts: Decomposition, one: SpectralResonance, duration: float) -> SpectralResonance | None:
    """Return the residual near a resonance without its shape: a close mode without a peak of its own."""
    lines = parts.around(complex(-0.0, one.pole.imag))
    left = np.eye(len(one.shape)) - np.outer(one.shape, one.shape.conj())
    rest = left @ parts.matrix[lines] @ left
    values, vectors = np.linalg.eigh(rest)
    peak = int(np.argmax(values[:, -1]))
    if len(one.shape) < 3 or values[peak, -1] < _least_peak(parts, duration) * np.median(values[:, -1]):
        return None
    vector, line = vectors[peak, :, -1], peak + lines.start
    coherence = _coherence(parts, line, vector)
    if coherence < _MIN_COHERENCE:
        return None
    pole = complex(one.pole.real, (line + parts.sums.first) * parts.width)
    return _fitted(parts, pole, vector, vector, [], 2, coherence, duration)


def _coherence(parts: Decomposition, line: int, vector: ComplexArray) -> float:
    """Return the share of a vector that the first vectors of even and of odd blocks around a line both span."""
    near = slice(max(line - 1, 0), line + 2)
    moves = [move.sum(axis=0) for move in parts.sums.influences(near)]
    change = np.sum(moves[::2], axis=0)
    whole = parts.matrix[near].sum(axis=0)
    halves = [np.linalg.eigh(whole + sign * change)[1][:, -_COMPARED:] for sign in (1, -1)]
    return min(float(np.sum(np.abs(vector.conj() @ half) ** 2)) for half in halves)


def _fitted(
    parts: Decomposition, pole: complex, shape: ComplexArray, stopped: ComplexArray, others: list[complex],
    level: int, coherence: float, duration: float,
) -> SpectralResonance | None:  # fmt: skip
    """Return the resonance of a filtered spectrum near a pole, if it is significant."""
    seen = _bell(parts, pole, stopped, others)
    if seen is None:
        return None
    fit, lines = seen
    gain = fit.gain * _n_periodograms(parts, duration)
    if gain < float(scipy.special.chdtri(4, _CHANCE / len(parts.matrix))) / 2:
        return None
    return SpectralResonance(
        pole=fit.pole,
        shape=shape,
        filter=stopped,
        lines=lines,
        influence=fit.influence,
        level=level,
        coherence=coherence,
        gain=gain,
    )


def _bell(
    parts: Decomposition, pole: complex, stopped: ComplexArray, others: list[complex]
) -> tuple[BellFit, slice] | None:
    """Fit the bell of a filtered spectrum on the lines that it covers, found iteratively."""
    result, lines = None, parts.around(pole)
    for _ in range(_WIDTHS_TRIED):
        fit = fit_bell(parts.filtered(stopped, lines), pole, parts.windowed(lines), _near(parts, others, lines))
        if fit is None or -fit.pole.real > abs(fit.pole) / 2:
            return None
        result, pole, fitted = (fit, lines), fit.pole, lines
        lines = parts.around(pole)
        if lines == fitted:
            break
    return result


def _n_periodograms(parts: Decomposition, duration: float) -> float:
    """Return how many independent periodograms a line is the mean of."""
    return _OVERLAP_GAIN * duration * parts.sums.rate / parts.sums.n_fft


def _least_peak(parts: Decomposition, duration: float) -> float:
    """Return how high a peak over its surroundings is worth a try."""
    return float(1 + _STANDS_OUT / np.sqrt(_n_periodograms(parts, duration)))


def _surroundings(values: FloatArray) -> FloatArray:
    """Return the medians of the lines around each line."""
    reach = 2 * MIN_LINES
    padded = np.pad(values, ((reach, reach), (0, 0)), mode="reflect")
    return np.asarray(np.median(sliding_window_view(padded, 2 * reach + 1, axis=0), axis=-1))


def _near(parts: Decomposition, others: list[complex], lines: slice) -> list[complex]:
    """Return the poles whose bells extend into some lines."""
    first, last = parts.sums.frequency[[lines.start, lines.stop - 1]] * 2 * np.pi
    margin = 0.25 * (last - first)
    return [pole for pole in others if first - margin < pole.imag < last + margin]


def _plausible(one: SpectralResonance, limits: Selection) -> bool:
    """Return whether damping and shape are plausible for a mode."""
    return one.damping < limits.max_damping and bool(mpc(one.shape) >= limits.min_mpc)


def _known(one: SpectralResonance, found: Sequence[SpectralResonance], limits: Selection) -> bool:
    """Return whether shapes found near a resonance span its own: no more modes than dimensions."""
    near = [other.shape for other in found if _overlap(one, other) or _twin(one, other, limits)]
    if not near:
        return False
    basis = np.linalg.qr(np.array(near).T)[0]
    return float(np.sum(np.abs(basis.conj().T @ one.shape) ** 2)) > 1 - limits.max_mac_loss


def _overlap(a: SpectralResonance, b: SpectralResonance) -> bool:
    """Return whether the bells of two resonances cover each other's peaks."""
    return abs(a.pole.imag - b.pole.imag) < 2 * abs(a.pole.real + b.pole.real)


def _twin(a: SpectralResonance, b: SpectralResonance, limits: Selection) -> bool:
    """Return whether two resonances are one by frequency and shape."""
    near = abs(a.pole.imag - b.pole.imag) < limits.max_shift * a.pole.imag
    return near and 1 - mac(a.shape, b.shape) < limits.max_mac_loss


def _refined(
    parts: Decomposition, found: list[SpectralResonance], duration: float, limits: Selection
) -> list[SpectralResonance]:
    """Return the resonances with shapes from all their lines, close ones separated, fitted again."""
    shaped = [replace(one, shape=_shape(parts, one, found)) for one in found]
    result: list[SpectralResonance] = []
    for one in sorted(shaped, key=lambda r: -r.gain):
        others = [other for other in shaped if other is not one]
        again = _fitted(
            parts, one.pole, one.shape, _stop(one, others), [other.pole for other in others], one.level, one.coherence,
            duration,
        )  # fmt: skip
        if again and _plausible(again, limits) and not _known(again, result, limits):
            result.append(again)
    return result


def _shape(parts: Decomposition, one: SpectralResonance, found: Sequence[SpectralResonance]) -> ComplexArray:
    """Return the shape that all lines of a bell agree on."""
    product = np.einsum("l,lij->ij", residue_weight(parts, one, found), parts.matrix[one.lines])
    return normalise(np.linalg.eigh(product)[1][:, -1])


def _stop(one: SpectralResonance, others: list[SpectralResonance]) -> ComplexArray:
    """Return a vector that passes the shape of a resonance and blocks those whose bells overlap with its own."""
    close = [
        other.shape
        for other in others
        if abs(other.pole.imag - one.pole.imag) < MIN_LINES * abs(one.pole.real + other.pole.real)
        and mac(one.shape, other.shape) < _FILTERED
    ]
    if not close:
        return one.shape
    dual: ComplexArray = np.linalg.pinv(np.array([one.shape, *close]).T)[0].conj()
    return dual


def residue_weight(parts: Decomposition, one: SpectralResonance, found: Sequence[SpectralResonance]) -> FloatArray:
    """Return the weights of the lines for which the sum of spectral matrices contains one shape alone, (n_lines,).

    The spectral matrix is the sum of bells, each times the outer product of a shape, and a background. Least squares
    over the lines, weighted by their scatter, separates the products of close modes, whose shapes need not be
    orthogonal.
    """
    windowed = parts.windowed(one.lines)
    poles = [one.pole, *_near(parts, [other.pole for other in found if other is not one], one.lines)]
    bells = np.array([windowed.bell(pole)[[0, 3]] for pole in poles]).reshape(-1, one.lines.stop - one.lines.start)
    basis = np.column_stack((*bells, np.ones(bells.shape[1]), np.linspace(-1, 1, bells.shape[1])))
    scale = np.linalg.norm(basis, axis=0)
    weight = 1 / np.maximum(parts.values[one.lines, 0], 1e-300)
    operator = (scipy.linalg.pinv(basis / scale * weight[:, None])[0] * weight) / scale[0]
    return np.asarray(operator)
