"""Poly-reference least squares complex frequency from half spectra, with the influence of each block of time.

References
----------
Peeters, B., Van der Auweraer, H. (2005). PolyMAX: a revolution in operational modal analysis. Proceedings of IOMAC 1.
Guillaume, P., Verboven, P., Vanlanduit, S., Van der Auweraer, H., Peeters, B. (2003). A poly-reference implementation
of the least-squares complex frequency-domain estimator. Proceedings of IMAC XXI.
De Troyer, T., Guillaume, P., Pintelon, R., Vanlanduit, S. (2009). Fast calculation of confidence intervals on parameter
estimates of least-squares frequency-domain estimators. Mechanical Systems and Signal Processing 23(2), 261-273.
Verboven, P. (2002). Frequency-domain system identification for modal analysis. Vrije Universiteit Brussel, chapter 6:
shapes by least squares once poles and participation are known.
Stewart, G. W., Sun, J.-G. (1990). Matrix perturbation theory. Academic Press, chapter 5: vectors of a moved matrix.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar

import numpy as np
import scipy  # its parts at their first use
from numpy import fft

from daq import FloatArray
from oma.mac import mac_matrix, normalise
from oma.methods.base import CorrelationLevel, LevelModes, Method
from oma.methods.fraction_poles import FractionModel, Windowed, fraction_model, pole_influences
from oma.methods.matrix_fraction import HalfSpectrum, MatrixFraction, half_spectrum, matrix_fractions, ridged
from oma.preparation import Level
from oma.selection import PoleInfluence, candidates, normalised_move, pole_moves, stabilization
from oma.spectral import CorrelationAccumulator, CorrelationSums
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
    projected = scipy.linalg.solve_triangular(fraction.factor, flat, lower=True, check_finite=False)
    moved, still = projected.reshape(len(lag) * n_channels, -1), fraction.projected.reshape(len(lag) * n_channels, -1)
    whole = squares.transpose(0, 2, 1, 3).reshape(len(lag) * n, -1) @ fraction.denominator
    whole -= moved.T @ (still @ fraction.denominator) + still.T @ (moved @ fraction.denominator)
    free = fraction.power * n
    return np.asarray(-scipy.linalg.solve(ridged(fraction.normal[:free, :free]), whole[:free], assume_a="pos"))


def _seen_by_vectors(fraction: MatrixFraction, move: FloatArray) -> ComplexArray:
    """Return the companion matrix's move between all left and right vectors, (n_roots, n_roots)."""
    n = fraction.vector.shape[1]
    powers = fraction.root ** np.arange(fraction.power)[:, None]
    right = np.einsum("jab,jp,pb->ap", move.reshape(fraction.power, n, n), powers, fraction.vector, optimize=True)
    return np.asarray(-fraction.left_vector @ right)


_LINES = (0.058, 0.46)  # that are fitted, as a share of the rate: the band of any level and a margin
_SHORTEST = 24  # lags
_SAME, _ALIKE = 0.02, 0.9  # relative distance of poles and MAC of shapes of one mode in two orders
_LAGS_A_SAMPLE = 16  # samples a lag, where the record is short


@dataclass(frozen=True, kw_only=True)
class PLSCF(Method):
    """Options of the poly-reference least squares complex frequency estimator."""

    name: ClassVar[str] = "plscf"
    n_lags: int = 100  #: lags of the half spectrum [-]
    window: float = 0.01  #: value of the exponential window at the last lag; damping is corrected for it [-]
    n_references: int = 8  #: combinations of channels, those with most of the signals, that all are correlated with [-]
    max_order: int = 100  #: largest number of poles, conjugates and all [-]
    n_orders: int = 12  #: numbers of poles that are tried [-]

    def __post_init__(self) -> None:
        """Refuse invalid options."""
        super().__post_init__()
        self.check_least(n_lags=_SHORTEST, n_references=1, n_orders=4)
        if not 0 < self.window < 1:
            raise ValueError(f"window: expected a share between 0 and 1, found {self.window}")

    def powers(self, n_references: int) -> list[int]:
        """Return the powers of the polynomials, of rising order."""
        largest = max(self.max_order // n_references, self.n_orders)
        every = np.linspace(max(largest / 4, 2), largest, self.n_orders)
        return sorted({int(power) for power in every})

    def least_samples(self, n_channels: int) -> int:
        """Return the least number of samples at one rate from which modes can be identified."""
        del n_channels
        return 8 * _SHORTEST

    def start(self, channels: Sequence[str], level: Level) -> "PLSCFLevel":
        """Return an empty identifier for one rate."""
        return PLSCFLevel(self, len(channels), level)


class PLSCFLevel(CorrelationLevel):
    """Correlation sums at one rate, and the modes in them; built by `PLSCF.start`."""

    def __init__(self, method: PLSCF, n_channels: int, level: Level) -> None:
        self._method, self._level, self._n_channels = method, level, n_channels
        self._first_lag = level.noise_lags + 1
        self._correlations = CorrelationAccumulator(n_channels, self._first_lag + method.n_lags)

    def identify(self) -> LevelModes | None:
        """Return the modes in the blocks held; None if gaps leave too little to be worth a look."""
        method, n_complete = self._method, self._correlations.n_complete
        if n_complete < method.least_samples(self._n_channels):
            return None
        n_lags = max(_SHORTEST, min(method.n_lags, n_complete // _LAGS_A_SAMPLE))
        seen, scale = self._windowed(self._correlations.sums, n_lags)
        spectrum = half_spectrum(seen.values, _LINES)
        fractions = matrix_fractions(spectrum, method.powers(seen.values.shape[2]))
        models = [fraction_model(fraction, spectrum, seen) for fraction in fractions]
        scaled = [replace(model, shape=model.shape * scale) for model in models]
        poles = stabilization(scaled, self._level.band, method.selection)
        influence = _Influences(models, spectrum, seen, scale)
        modes = candidates(poles, len(models), influence, n_complete / self._level.rate, method.selection)
        return LevelModes(poles=poles, modes=modes)

    def _windowed(self, sums: CorrelationSums, n_lags: int) -> tuple[Windowed, FloatArray]:
        """Return the correlation of scaled channels with a few combinations of them, and the scale of the channels.

        The combinations are those that hold most of the correlation.
        """
        whole = sums.mean
        scale = np.sqrt(np.diag(whole[0]))
        used = slice(self._first_lag, self._first_lag + n_lags)
        decay = -np.log(self._method.window) / n_lags
        window = np.exp(-decay * np.arange(n_lags))[:, None, None] / np.outer(scale, scale)
        mean = window * whole[used]
        vectors = np.linalg.eigh(np.einsum("lij,lik->jk", mean, mean))[1]
        chosen = vectors[:, -min(self._method.n_references, self._n_channels) :]
        moves = np.stack([(window * block[used]) @ chosen for block in sums.influences()])
        return Windowed(values=mean @ chosen, moves=moves, decay=decay, rate=self._level.rate), scale


class _Influences:
    """Influence of each block of time on any pole; shapes of all orders move as those of a middle one that has them."""

    def __init__(
        self, models: Sequence[FractionModel], spectrum: HalfSpectrum, seen: Windowed, scale: FloatArray
    ) -> None:
        self._models = {model.order: model for model in models}
        self._middle = models[len(models) // 2]
        self._scale = scale
        self._poles = cache(lambda order: pole_influences(self._models[order], spectrum, seen))
        self._shapes = cache(lambda order: shape_moves(self._models[order], spectrum, seen))

    def __call__(self, order: int, column: int) -> PoleInfluence:
        """Return the influences on a column of the model of an order."""
        model = self._models[order]
        k = int(np.searchsorted(model.taking_part, column))
        frequency, damping = pole_moves(model.continuous[column], self._poles(order)[:, k])
        shape = self._shape(model, column)
        return PoleInfluence(frequency=frequency, damping=damping, shape=shape)

    def _shape(self, model: FractionModel, column: int) -> ComplexArray:
        """Return moves of the normalised shape."""
        middle, shape = self._middle, normalise(self._scale * model.shape[column])
        found = normalise(self._scale * middle.shape[middle.taking_part])
        near = np.abs(middle.continuous[middle.taking_part] / model.continuous[column] - 1) < _SAME
        same = np.flatnonzero(near & (mac_matrix(found, shape[None])[:, 0] > _ALIKE))
        if not len(same):
            middle, same = model, np.flatnonzero(model.taking_part == column)
        k = int(same[0])
        raw = self._scale * middle.shape[middle.taking_part[k]]
        moves = normalised_move(raw, self._scale * self._shapes(middle.order)[:, k])
        return moves * np.sign(np.real(normalise(raw) @ shape.conj()))
