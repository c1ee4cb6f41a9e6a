"""Nonlinear part of the signals of a window, as of a place that opens and closes.

References
----------
Price, R. (1958). A useful theorem for nonlinear devices having Gaussian inputs. IRE Trans. Information Theory 4(2),
69-72 (the mean flexibility is P c).
"""

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray, IndexArray, Recording
from oma import ComplexArray
from oma.preparation import PASS
from oma.spectral import spectral_matrix
from updater.causes import LocalStiffness, Springs
from updater.errors import ModalDataError
from updater.inference import Comparison, Effect, no_effect, reanalyse
from updater.modal_data import ModalMean
from updater.quantities import Law, NonlinearGain, Quantity
from updater.validation.response.modal_system import ModalSystem, band_about, damping_of_all
from updater.validation.virtual_sensors import gapless_part

_FINER = 4  # samples of the moment per sample: the nonlinear rotation has harmonics
_EDGE = 0.1  # of a record that is faded in and out, each
BLOCKS = 16  # of a record, whose scatter gives the standard deviation
_PARTS = 8  # of a block, each weighted by the power of its signals
_SEGMENTS, _LOOKS = 24, 3  # of half a record for its spectral matrix, at least: in all, and per channel
_FEWEST_CHANNELS = 3
_AT_ONCE = 2000  # lines whose matrices are in memory
_KEPT = 16_000_000  # elements of the matrices of the first whitening, 128 MB; more are made anew each time
ONE_AXIS = 0.1  #: flexibility about an axis, over that about the most affected one, from which it is tested
PROBABLE = 10.0  #: of log density: a less probable place is left out
_LEAST = 1e-9  # of the power at a line, added to every channel
_NOISE = 0.25  # quantile of the eigenvalues of the spectral matrix that is taken for noise
_RANGE = 1.2  # of frequency, each way, within which forces are white
#: standard deviation of r over that of s, relative to that by the model; its logarithm is uncertain by 0.4: variances
#: by 0.65 for forces at a few points, which are not alike on all modes, 0.4 for damping and 0.3 for shapes
UNKNOWN = np.exp(0.4 * np.linspace(-2.0, 2.0, 7))
UNKNOWN_LOG_DENSITY = -0.5 * np.linspace(-2.0, 2.0, 7) ** 2
_SYMMETRIC = 1.0  # threshold over the standard deviation of the moment, at which a symmetric law is tested
_LEAST_UNKNOWN = 0.05  # standard deviation of r over that of s, at least

Loss = LocalStiffness | Springs  #: causes that may open and close


class ShareFit(NamedTuple):
    """Share of the mean flexibility that is absent while a place is closed, at a threshold."""

    explained: float  #: log likelihood of the share less that of none, for noise of power 1
    width: float  #: standard deviation of the share by the signals alone, for noise of power 1
    share: float
    variance: float  #: of the share, with that of the size without a loss
    open_time: float  #: share of the time
    part: float  #: part of the flexibility while open that the mean contains; for Gaussian moments, `open_time`


@dataclass(frozen=True, eq=False)
class Action:
    """Action at a place, such as a bending moment, scaled so that its square is its part of the added flexibility."""

    axis: int  #: about local y or z, or in twist, of a member; about or along an axis of a connection
    value: FloatArray  #: (n_modes,) of the reference's modes over omega^2
    relief: float  #: flexibility before self-stress has shifted the load, over that after [-]


def actions_of(comparison: Comparison, effects: Sequence[Effect], least: float = 0.0) -> list[Action]:
    """Return the actions whose squares make up added flexibilities, one of each axis at most.

    Parameters
    ----------
    effects : of a loss about each axis alone
    least : flexibility that an action has at least, over that of the largest [-]
    """
    paired, n = comparison.paired, len(comparison.frequency)
    omega = 2 * np.pi * comparison.frequency[paired]
    found, size = list[Action](), list[float]()
    for axis, effect in enumerate(effects):
        added = effect.flexibility[0]
        values, vectors = np.linalg.eigh(omega[:, None] * added[np.ix_(paired, paired)] * omega)
        value, across = float(values[-1]), omega * vectors[:, -1]
        if value > 0:
            alone = float(across @ effect.compliance[0, :n, :n][np.ix_(paired, paired)] @ across)
            found.append(Action(axis, added[:, paired] @ across / np.sqrt(value), alone / value))
            size.append(value)
    return [action for action, value in zip(found, size, strict=True) if value > least * max(size)]


@dataclass(frozen=True, eq=False)
class ModalState:
    """Modes of the structure in one state, with frequencies and damping as measured."""

    system: ModalSystem
    vector: FloatArray  #: (n_modes, n_modes) in the reference's modes
    band: tuple[float, float]  #: about the measured modes [Hz]

    @classmethod
    def of(cls, comparison: Comparison, effect: Effect, damping: FloatArray, log_ratio: FloatArray) -> "ModalState":
        """Return the state with an effect.

        Parameters
        ----------
        damping : (n,) of the compared modes, NaN where it is not known [-]
        log_ratio : (n,) of their frequencies to the reference's
        """
        changed = reanalyse(comparison, effect)
        pick = changed.pick[0]
        measured = comparison.frequency[comparison.paired] * np.exp(log_ratio)
        frequency = changed.value[0] ** -0.5 / (2 * np.pi)
        frequency[pick] = measured
        system = ModalSystem(frequency=frequency, damping=damping_of_all(damping, pick, len(frequency)))
        return cls(system, changed.vector[0], band_about(measured))

    def of_displacements(self, action: FloatArray) -> FloatArray:
        """Return an action (n_modes,) of the reference's modes over omega^2 for unit displacements of these modes."""
        return np.asarray(self.system.omega**2 * (action @ self.vector))


class SignalWindow:
    """Signals of a window, whitened.

    They are whitened by the model of their modes first: the segments of a spectral matrix are shorter than the free
    vibration of a mode. What remains of a force is then not correlated with earlier motion, nor with the rotation that
    depends on it, however strongly the rotation acts on the motion.

    A spectral matrix that is estimated from the signals that it whitens takes part of them for noise. Therefore, each
    half of the window is whitened by the spectral matrix of the other half.
    """

    def __init__(self, state: ModalState, at_channels: FloatArray, data: FloatArray, rate: float) -> None:
        self.rate, self.n = rate, len(data)
        self._at_channels = at_channels
        self._limits = state.band[0], min(state.band[1], PASS * rate)
        lines: FloatArray = np.fft.rfftfreq(self.n, 1 / rate).astype(np.float64)
        self._band = np.flatnonzero((self._limits[0] <= lines) & (lines <= self._limits[1]))
        self._lines = lines[self._band]
        segment, self._measured = self._segment(self.n), self._spectrum(data)
        eigenvalues = np.linalg.eigvalsh(spectral_matrix(data, rate, segment))
        noise = np.maximum(np.quantile(eigenvalues, _NOISE, axis=1), _LEAST * eigenvalues.sum(1))
        self._noise = 0.5 * self.n * rate * noise[self._nearest(segment)]  #: (n_lines,) power in each channel
        self._first = state, self._force(state)  #: model by which spectra are whitened first
        self._kept = list(self._new_roots()) if len(self._lines) * data.shape[1] ** 2 <= _KEPT else None
        self._data = self.signal(self._prewhitened(self._measured))
        halves = np.array_split(np.arange(self.n), 2)
        self._fades = [self._faded(half) for half in halves]
        self._inverses = [self._inverse_spectrum(self._data[half]) for half in halves[::-1]]
        #: (n_lines, n_channels) product with faded and whitened predictions of signals
        self._target = np.zeros((len(self._lines), data.shape[1]), complex)
        for half, fade in enumerate(self._fades):
            whitened = self._whitened(half, self._spectrum(fade[:, None] * self._data))
            self._target += self._spectrum(fade[:, None] * self.signal(whitened))
        #: (n_parts,) mean power of the whitened signals in each part: forces may not be stationary
        self._power = self._parts_of(np.concatenate([self._white_power(k, half) for k, half in enumerate(halves)]))

    @classmethod
    def of(cls, state: ModalState, comparison: Comparison, recording: Recording) -> "SignalWindow | None":
        """Return a window; None if it is too short, has too few of the channels, or one of them is constant."""
        names = {c.name for c in recording.channels}
        known = [k for k, channel in enumerate(comparison.channels) if channel in names]
        if len(known) < _FEWEST_CHANNELS:
            return None
        try:
            _, data = gapless_part(recording, tuple(comparison.channels[k] for k in known))
        except ModalDataError:
            return None
        if len(data) < BLOCKS * _SEGMENTS * len(known) or state.band[0] > PASS * recording.rate:
            return None
        if (np.ptp(data, axis=0) == 0).any():
            return None
        return cls(state, comparison.at_channels[known], data - data.mean(0), recording.rate)

    def modal_motion(self, state: ModalState) -> tuple[ComplexArray, FloatArray]:
        """Return the motion (n_lines, n_modes) in the reference's modes, times omega^2 of the modes of the state.

        The second value is the power (n_lines,) of the force on each mode. Modes outside the band are left out of the
        motion. Forces are white on all modes alike, and noise is alike in all sensors, both
        within a range of frequencies.
        """
        system, shape, force = state.system, self._at_channels @ state.vector, self._force(state)
        inside = (self._limits[0] < system.frequency) & (system.frequency < self._limits[1])
        found = []
        for part, covariance in zip(self._parts(), self._covariances(state, force), strict=True):
            accelerance = system.accelerance(self._lines[part])
            weighted = np.linalg.solve(covariance, self._measured[part, :, None])[:, :, 0]
            forces = force[part, None] * accelerance.conj() * (weighted @ shape)
            displacement = -forces * accelerance / (2 * np.pi * self._lines[part, None]) ** 2
            found.append((displacement * system.omega**2)[:, inside] @ state.vector[:, inside].T)
        return np.concatenate(found), force

    def _force(self, state: ModalState) -> FloatArray:
        """Return the power (n_lines,) of the force on each mode."""
        shape = self._at_channels @ state.vector
        gain = (np.abs(state.system.accelerance(self._lines)) ** 2) @ (shape**2).sum(0)
        power = np.maximum((np.abs(self._measured) ** 2).sum(1) - len(shape) * self._noise, 0.0)
        return np.asarray(self._near(power) / self._near(gain))

    def _covariances(self, state: ModalState, force: FloatArray) -> Iterator[ComplexArray]:
        """Yield those of the signals by the model (n_lines, n_channels, n_channels), of one part of lines at a time."""
        shape = self._at_channels @ state.vector
        for part in self._parts():
            response = state.system.accelerance(self._lines[part])[:, None, :] * shape
            covariance = force[part, None, None] * response @ response.conj().swapaxes(1, 2)
            yield covariance + self._noise[part, None, None] * np.eye(len(shape))

    def unknown_part(self, state: ModalState, action: FloatArray, force: FloatArray, known: ComplexArray) -> float:
        """Return the standard deviation of the part of an action that is not known, over that of the known part.

        The known part is that of the modes in the band, the other one that of all others.

        Parameters
        ----------
        state : modes
        action : (n_modes,) for unit displacements of these modes
        force : (n_lines,) power of the force on each mode; of modes outside the band that of its nearest line
        known : (n_lines,) spectrum of the known part
        """
        system = state.system
        inside = (self._limits[0] < system.frequency) & (system.frequency < self._limits[1])
        compliance = np.abs(system.accelerance(self._lines)) ** 2 / (2 * np.pi * self._lines[:, None]) ** 4
        whole = float(force @ compliance[:, inside] @ action[inside] ** 2)
        nearest = np.clip(np.searchsorted(self._lines, system.frequency), 0, len(self._lines) - 1)
        variance = force[nearest] * action**2 / (system.omega**3 * system.damping)  # of modes under white forces
        outside = whole * float(variance[~inside].sum() / variance[inside].sum())
        return float(np.sqrt(max(outside / (np.abs(known) ** 2).sum(), _LEAST_UNKNOWN**2)))

    def fine(self, spectrum: ComplexArray) -> FloatArray:
        """Return a signal (n_fine,), with `_FINER` samples per sample."""
        whole = np.zeros(_FINER * self.n // 2 + 1, complex)
        whole[self._band] = _FINER * spectrum
        return np.asarray(scipy.fft.irfft(whole, _FINER * self.n))

    def rotation(self, fine: FloatArray) -> ComplexArray:
        """Return the spectrum (n_lines,) of a rotation (n_fine,)."""
        return np.asarray(scipy.fft.rfft(fine)[self._band] / _FINER)

    def response(self, state: ModalState, action: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Return what a rotation is multiplied by to be fitted to the signals.

        Parameters
        ----------
        state : modes that a rotation moves
        action : (n_modes,) for unit displacements of these modes

        Returns
        -------
        (n_lines,) product of its signals with the measured ones, conjugated; (2, n_lines) root of that with themselves,
        by halves
        """
        shape = self._at_channels @ state.vector
        signals = self._prewhitened((state.system.accelerance(self._lines) * action) @ shape.T)
        own = [(signals.conj() * self._whitened(half, signals)).sum(1).real for half in range(len(self._fades))]
        return (signals.conj() * self._target).sum(1), np.sqrt(np.maximum(own, 0.0))

    def products(self, spectrum: ComplexArray, signal: FloatArray) -> FloatArray:
        """Return the sums (n_blocks,) over blocks of time of a signal of a spectrum times another one (n_samples,)."""
        return self._sums(self.signal(spectrum) * signal)

    def squares(self, spectra: ComplexArray) -> FloatArray:
        """Return the sums (n_blocks,) over blocks of time of squares of faded signals, each half's own (2, n_lines)."""
        halves = zip(self._fades, spectra, strict=True)
        return self._sums(np.sum([(fade * self.signal(spectrum)) ** 2 for fade, spectrum in halves], axis=0))

    def _sums(self, signal: FloatArray) -> FloatArray:
        """Return sums (n_blocks,) of a signal that is weighted by the inverse power of its part."""
        return np.asarray((self._parts_of(signal) / self._power).reshape(BLOCKS, _PARTS).sum(1))

    @staticmethod
    def _parts_of(signal: FloatArray) -> FloatArray:
        """Return the sum (n_parts,) of each part of a signal."""
        first = np.linspace(0, len(signal), BLOCKS * _PARTS, endpoint=False).astype(int)
        return np.asarray(np.add.reduceat(signal, first))

    def _faded(self, half: IndexArray) -> FloatArray:
        """Return a window (n_samples,) of some samples that is faded in and out."""
        found = np.zeros(self.n)
        found[half] = scipy.signal.windows.tukey(len(half), 2 * _EDGE)
        return found

    def _segment(self, n_samples: int) -> int:
        """Return the length of the segments of a spectral matrix of some samples."""
        return 1 << int(np.log2(n_samples / max(_SEGMENTS, _LOOKS * len(self._at_channels))))

    def _parts(self) -> list[IndexArray]:
        """Return the lines in parts whose matrices are in memory at once."""
        return np.array_split(np.arange(len(self._lines)), 1 + len(self._lines) // _AT_ONCE)

    def _new_roots(self) -> Iterator[ComplexArray]:
        """Yield the matrices (n_lines, n_channels, n_channels) of the first whitening, one part of lines at a time."""
        for covariance in self._covariances(*self._first):
            yield np.linalg.inv(np.linalg.cholesky(covariance)).astype(np.complex64)

    def _prewhitened(self, spectrum: ComplexArray) -> ComplexArray:
        """Return a spectrum (n_lines, n_channels) that is whitened by the model."""
        roots = self._new_roots() if self._kept is None else self._kept
        white = [(root @ spectrum[part, :, None])[:, :, 0] for part, root in zip(self._parts(), roots, strict=True)]
        return np.concatenate(white)

    def _whitened(self, half: int, spectrum: ComplexArray) -> ComplexArray:
        """Return the product (n_lines, n_channels) of a spectrum with the inverse spectral matrix of the other half."""
        inverse, nearest = self._inverses[half]
        return np.concatenate([(inverse[nearest[part]] @ spectrum[part, :, None])[:, :, 0] for part in self._parts()])

    def _white_power(self, half: int, samples: IndexArray) -> FloatArray:
        """Return the power (n_samples,) of the whitened signals at some samples."""
        inverse, nearest = self._inverses[half]
        root, spectrum = np.linalg.cholesky(inverse).conj().swapaxes(1, 2), self._spectrum(self._data)
        white = [(root[nearest[part]] @ spectrum[part, :, None])[:, :, 0] for part in self._parts()]
        return np.asarray((self.signal(np.concatenate(white))[samples] ** 2).sum(1))

    def _inverse_spectrum(self, data: FloatArray) -> tuple[ComplexArray, IndexArray]:
        """Return the inverse of the spectral matrix of some samples at its own lines, and the nearest to each line."""
        segment = self._segment(len(data))
        matrices = spectral_matrix(data, self.rate, segment)
        value, vector = np.linalg.eigh(matrices)  # negative by rounding, where channels depend on each other
        value = np.maximum(value, 0.0) + _LEAST * value.sum(1, keepdims=True)
        inverse = (vector / value[:, None, :]) @ vector.conj().swapaxes(1, 2)
        return np.asarray(inverse), self._nearest(segment)

    def _nearest(self, segment: int) -> IndexArray:
        """Return the nearest line (n_lines,) of the spectral matrix of segments."""
        nearest = np.rint(self._lines * segment / self.rate).astype(int)
        return np.asarray(np.minimum(nearest, segment // 2), np.intp)

    def _near(self, power: FloatArray) -> FloatArray:
        """Return sums (n_lines,) over the lines near each."""
        total = np.concatenate([[0.0], np.cumsum(power)])
        first, last = (np.searchsorted(self._lines, self._lines * limit) for limit in (1 / _RANGE, _RANGE))
        return np.asarray(total[last] - total[first])

    def _spectrum(self, data: FloatArray) -> ComplexArray:
        return np.asarray(scipy.fft.rfft(data, axis=0)[self._band])

    def signal(self, spectrum: ComplexArray) -> FloatArray:
        """Return the signal (n_samples, ...) of a spectrum (n_lines, ...), zero outside of the band."""
        whole = np.zeros((self.n // 2 + 1, *spectrum.shape[1:]), complex)
        whole[self._band] = spectrum
        return np.asarray(scipy.fft.irfft(whole, self.n, axis=0))


class LossTests:
    """Tests of places at which a loss of stiffness may open and close.

    Parameters
    ----------
    cause : loss of stiffness
    damping : (n,) of the compared modes, NaN where it is not known [-]
    window : signals with the loss
    before : signals without it, and the state of the structure
    """

    def __init__(
        self, cause: Loss, damping: FloatArray, window: SignalWindow, before: tuple[SignalWindow, ModalState] | None
    ) -> None:
        self.window, self._cause, self._damping = window, cause, damping
        self._motion: tuple[ComplexArray, FloatArray] | None = None
        self._before = None if before is None else (*before, before[0].modal_motion(before[1]))

    @classmethod
    def of(cls, cause: Loss, event: ModalMean, now: Recording, before: Recording | None) -> "LossTests | None":
        """Return the tests; None if a window is too short, has too few channels, or one of them is constant.

        Parameters
        ----------
        event : (n_tracks,) modes of the window
        now, before : signals of a window with the loss, and of one without it
        """
        data, tracks = cause.comparison, cause.comparison.tracks
        damping = np.where(tracks < 0, np.nan, event.damping[tracks])  # not of modes without a track
        states = [
            ModalState.of(data, no_effect(1, data), damping, ratio) for ratio in (data.log_ratio, 0 * data.log_ratio)
        ]
        window = SignalWindow.of(states[0], data, now)
        earlier = None if before is None else SignalWindow.of(states[1], data, before)
        if window is None or (before is not None and earlier is None):
            return None
        return cls(cause, damping, window, None if earlier is None else (earlier, states[1]))

    def at(
        self,
        theta: FloatArray,
        row: int,
        prior: float = 0.0,
        *,
        share: FloatArray | None = None,
        at_best: bool = False,
    ) -> "list[ActionTest]":
        """Return a test of the action about each axis of an alternative; none if it is no loss.

        Parameters
        ----------
        theta : (n_parameters,)
        row : alternative of the cause
        prior, at_best : as for `ActionTest`
        share : (3,) of the loss about each axis for which actions are tested; None for those of the alternative
        """
        comparison, rows = self._cause.comparison, np.array([row])
        effect = self._cause.effect(theta[None], rows)
        own = self._cause.axis_shares(theta[None], rows)[0]
        tested, least = (own, ONE_AXIS) if share is None else (share, 0.0)
        state = ModalState.of(comparison, effect, self._damping, comparison.log_ratio)
        if self._motion is None:
            self._motion = self.window.modal_motion(state)
        return [
            ActionTest(self.window, state, self._motion, action, prior, at_best=at_best)
            for action in actions_of(comparison, self._cause.about_axes(theta, row, tested), least)
        ]

    def before(self, test: "ActionTest") -> "ActionTest | None":
        """Return the test of the same action in the window without the loss; None without such a window."""
        if self._before is None:
            return None
        return test.in_window(*self._before)


class ActionTest:
    """Nonlinear part of the rotation by one action at a place.

    Parameters
    ----------
    window : signals
    state : modes that a rotation moves
    modal_motion : (n_lines, n_modes) and (n_lines,) of the window
    action : at the place
    prior : log density of the place
    at_best : whether it is the most probable place by the modes
    """

    def __init__(
        self,
        window: SignalWindow,
        state: ModalState,
        modal_motion: tuple[ComplexArray, FloatArray],
        action: Action,
        prior: float = 0.0,
        *,
        at_best: bool = False,
    ) -> None:
        self.action, self.state, self.at_best, self._window, self.prior = action, state, at_best, window, prior
        motion, force = modal_motion
        known, of_modes = motion @ action.value, state.of_displacements(action.value)
        self._moment, self._unknown = window.fine(known), window.unknown_part(state, of_modes, force, known)
        product, self._own = window.response(state, of_modes)
        self._product = window.signal(product)
        self.moment_std = float(self._moment.std())  #: of the known part
        self.symmetric = False  #: whether it opens, or closes, on both sides of zero alike
        self._estimate()

    def of_both_sides(self) -> "ActionTest":
        """Return the test of a place that is softer, or stiffer, beyond a moment on both sides of zero."""
        found = copy.copy(self)
        found.symmetric = True
        found._estimate()
        return found

    def in_window(
        self, window: SignalWindow, state: ModalState, modal_motion: tuple[ComplexArray, FloatArray]
    ) -> "ActionTest":
        """Return the test of the same action and law in another window; parameters as for the class."""
        found = ActionTest(window, state, modal_motion, self.action)
        return found.of_both_sides() if self.symmetric else found

    @property
    def usual_threshold(self) -> float:
        """Threshold at which the law is tested, over the standard deviation of the moment."""
        return _SYMMETRIC if self.symmetric else 0.0

    def _estimate(self) -> None:
        """Estimate the size at the usual threshold."""
        along, weight, _ = self._fit(self.usual_threshold, self._unknown)
        self._size = float(along.sum() / weight.sum())
        scatter = float(((along - self._size * weight) ** 2).sum()) * BLOCKS / (BLOCKS - 1)
        self.spread = scatter / float(weight.sum())  #: variance of the product over the expected one
        self._variance = scatter / float(weight.sum()) ** 2
        self.explained = 0.5 * float(along.sum()) * self._size  #: log likelihood ratio to none, for noise of power 1

    def log_density(self, noise: float) -> float:
        """Return that of the place, and of a nonlinear part at the usual threshold, for a power of the noise."""
        return self.prior + self.explained / noise

    def against(self, usual: "ActionTest | None") -> tuple[float, float, float]:
        """Return the size without a loss, its variance, and the p value of as large a difference from it."""
        bias, variance = (usual._size, usual._variance) if usual else (0.0, 0.0)
        return bias, variance, float(2 * scipy.stats.t.sf(self._score(usual), BLOCKS - 1))

    def log_likelihood(self, usual: "ActionTest | None") -> float:
        """Return the log likelihood ratio of opening and closing with the best amplitude to none.

        The scale of the noise is not known: it is that of the blocks, so that the ratio is a function of Student's t.
        Half the logarithm of their number is subtracted for the amplitude (Schwarz).
        """
        return 0.5 * BLOCKS * float(np.log1p(self._score(usual) ** 2 / (BLOCKS - 1))) - 0.5 * float(np.log(BLOCKS))

    def _score(self, usual: "ActionTest | None") -> float:
        """Return Student's t of the difference from the size without a loss."""
        bias, variance = (usual._size, usual._variance) if usual else (0.0, 0.0)
        return abs(self._size - bias) / float(np.sqrt(self._variance + variance))

    def side(self, bias: float) -> float:
        """Return 1 if it opens under a positive moment, -1 under a negative one; by the size without a loss.

        On both sides, 1 if it opens beyond the threshold, -1 within.
        """
        return 1.0 if self._size >= bias else -1.0

    def law(self, bias: float) -> Law:
        """Return the moments under which it is open, by the size without a loss."""
        if not self.symmetric:
            return "one_side"
        return "beyond" if self.side(bias) > 0 else "within"

    def whole(self, unknown: int) -> float:
        """Return the standard deviation of the whole moment over that of the known part; as for `fitted`."""
        return float(np.hypot(1.0, self._unknown * UNKNOWN[unknown]))

    def predicted_by(self, size: float, threshold: float, unknown: int) -> NonlinearGain:
        """Return how well a size from other signals predicts the nonlinear part of these.

        With y predicted and d measured, both whitened, the square of the residual is 2 d y - y^2 less than without the
        prediction. Deviations are those of the jackknife over blocks.

        Parameters
        ----------
        size : with its sign
        threshold, unknown : as for `fitted`
        """
        along, weight, _ = self._fit(threshold, self._unknown * float(UNKNOWN[unknown]), float(np.sign(size)))
        kept = ~np.eye(BLOCKS, dtype=bool)
        left_out = np.array([self._gain(size, along[k], weight[k]) for k in kept]) * BLOCKS / (BLOCKS - 1)
        std = float(np.sqrt((BLOCKS - 1) * left_out.var()))
        return NonlinearGain(log_likelihood=Quantity(value=self._gain(size, along, weight), std=std, unit="-"))

    def _gain(self, size: float, along: FloatArray, weight: FloatArray) -> float:
        """Return the gain of log likelihood in blocks."""
        return float(2 * size * along.sum() - size**2 * weight.sum()) / (2 * self.spread)

    def fitted(self, bias: float, of_bias: float, threshold: float, unknown: int) -> ShareFit:
        """Return the share of the mean flexibility that is absent while it is closed, and its likelihood.

        Parameters
        ----------
        bias, of_bias : size without a loss, and its variance
        threshold : as for `_fit`
        unknown : number of the standard deviation of the unknown part, relative to that by the model
        """
        side = self.side(bias)
        std = self._unknown * float(UNKNOWN[unknown])
        blocks, weights, (part, open_time) = self._fit(threshold, std, side)
        along, weight = float(blocks.sum()), float(weights.sum())
        if self.symmetric and side < 0:
            part, open_time = 1 - part, 1 - open_time
        scale = part * self.action.relief
        share, variance = side * scale * (along / weight - bias), scale**2 * (self.spread / weight + of_bias)
        return ShareFit(0.5 * along**2 / weight, scale / float(np.sqrt(weight)), share, variance, open_time, part)

    def open_time_slope(self, open_time: float, side: float) -> float:
        """Return how fast the share of the time in which it is open changes with the threshold [-]."""
        if not self.symmetric:
            return float(scipy.stats.norm.pdf(scipy.stats.norm.isf(open_time)))
        beyond = open_time if side > 0 else 1 - open_time
        return float(2 * scipy.stats.norm.pdf(scipy.stats.norm.isf(beyond / 2)))

    def _fit(
        self, threshold: float, unknown: float, side: float = 1.0
    ) -> tuple[FloatArray, FloatArray, tuple[float, float]]:
        """Return the products (n_blocks,) of the expected signals with the measured ones, and with themselves.

        The last values are the part of the rotation beyond the threshold that follows the moment, which the modes show,
        and the share of the time beyond it.

        Parameters
        ----------
        threshold : moment at which it opens, or closes, over the standard deviation of the whole moment [-]
        unknown : standard deviation of the unknown part of the moment, over that of the known part [-]
        side : 1 if it opens under a positive moment, -1 under a negative one; without an effect on both sides
        """
        moment = self._moment if self.symmetric else side * self._moment
        std = float(moment.std())
        opens, unknown_std = threshold * std * np.hypot(1.0, unknown), unknown * std
        rotation, beyond = _expected_excess(moment - opens, unknown_std)
        if self.symmetric:
            below, other = _expected_excess(-moment - opens, unknown_std)
            rotation, beyond = rotation - below, beyond + other
        # the part in proportion to the moment belongs to the mean flexibility
        part = float((rotation @ moment) / (moment @ moment))
        lines = self._window.rotation(rotation - part * moment)
        products = self._window.products(lines, self._product), self._window.squares(lines * self._own)
        return *products, (part, beyond)


_REACH = 8.0  # standard deviations, beyond which the tails are rounding
_STEPS = 1 << 13  # of the tables on each side of zero: linear between them, the mean errs by 5e-8 standard deviations
_SCORE = np.linspace(-_REACH, _REACH, 2 * _STEPS + 1)
_POSITIVE = scipy.special.ndtr(_SCORE)
_EXCESS = _SCORE * _POSITIVE + np.exp(-0.5 * _SCORE**2) / np.sqrt(2 * np.pi)
_POSITIVE_TABLE, _EXCESS_TABLE = ((table, np.diff(table, append=table[-1])) for table in (_POSITIVE, _EXCESS))


def _expected_excess(above: FloatArray, std: float) -> tuple[FloatArray, float]:
    """Return the mean of max(above + r, 0) for a Gaussian r of a standard deviation, and how often it is positive.

    By tables: it is called a thousand times for records of 100,000 samples, and takes a third of the time.
    """
    if not std:
        return np.maximum(above, 0.0), float((above > 0).mean())
    place = above * (_STEPS / (_REACH * std))
    place += _STEPS
    np.clip(place, 0.0, 2.0 * _STEPS, out=place)
    row = place.astype(np.intp)
    place -= row
    positive, excess = (_interpolated(table, row, place) for table in (_POSITIVE_TABLE, _EXCESS_TABLE))
    excess *= std
    return np.maximum(excess, above, out=excess), float(positive.mean())


def _interpolated(table: tuple[FloatArray, FloatArray], row: IndexArray, place: FloatArray) -> FloatArray:
    """Return values of a table and of its rise (n_rows,), at places (n,) in [0, 1] behind rows."""
    value, rise = table
    found = rise.take(row)
    found *= place
    found += value.take(row)
    return found
