"""Dependence of a mode's frequency and damping on its amplitude, within one record of ambient vibration.

Shapes of the other modes are removed by a spatial filter. In a band about the mode, the remaining signal is a complex
envelope z, of amplitude a, its modulus. If damping and frequency depend on the amplitude,

    dz/dt = (lambda + mu g(a)) z + force,    g = a / rms - mean,    mu = rms d lambda / da.

The envelope is an autoregression. Its prediction error is independent of the past, and so of g, if the structure is
linear and the force is random. Therefore mu is a regression coefficient: of the envelope on its past, and on the
response to g z that the same autoregression filters. Within a sample, g z has the value that is expected from its
start. The real part of mu is minus the slope of the decay rate, the imaginary part the slope of the angular frequency.
Squares are divided by the local power of the error, because forces are stronger at some times than at others. Times at
which noise is a tenth of the power are left out: a prediction from the past depends on the ratio of noise, and would
depend on the amplitude.

A frequency that varies by more than the bandwidth is not a small perturbation. The envelope is turned back by the
phase that the slope explains, and fitted again.

References
----------
Ljung, L. (1999). System identification. 2nd ed., section 7.3 (linear regression of prediction errors).
Nayfeh, A. H., Mook, D. T. (1979). Nonlinear oscillations. Section 3.3 (frequency and decay as functions of amplitude).
Wu, C. F. J. (1986). Jackknife, bootstrap and other resampling methods in regression. Annals of Statistics 14(4),
1261-1295 (variance with errors of different variance).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray, IndexArray, Recording
from oma.preparation import BoolArray, gapless_stretches
from oma.types import ComplexArray, ModalEstimate

_REACH = 12.0  # of the band on each side, in half widths of the resonance: little is left outside
_ORDER = 8  # of the autoregression: resonance, noise and flanks of other modes
_FEWEST = 25 * _ORDER  # samples of an envelope, at a rate of the band's width
_EDGE = 3  # samples at each end that the band's filter spoils
_BLOCKS = 48  # of a record, left out one by one
_LOCAL = 20  # samples over which the power of the error is averaged
_CLEAR = 10.0  # times the noise: least power of a time that is used
_LEAST_SHARE = 0.3  # of the record that must be clear
_GAUSSIAN = 3.5  # kurtosis of the error over its local power: 2 for random forces, 2 to 3.5 in gusts, more for blows
_QUIETEST = 0.2  # of the segments, from which the noise is estimated
_SEGMENT = 20.0  # length of a segment in decay times
_PASSES, _TURNS, _NOISE_STEPS = 3, 4, 30  # of weighting, of turning back, of the fit of the noise
_TERMS, _NODES = 5, 60  # of the expansion of the amplitude, and of its quadrature
_LARGEST = 6.0  # power over its mean up to which the expansion converges: 0.2 % of the time is above
_PAST = 10.0  # decay times over which the mean power is taken
_SETTLED = 0.1  # standard deviations: a smaller step ends the fit
_INDEPENDENT = 0.05  # singular value, relative, below which shapes of neighbours are not separated
_LONGEST = 1 << 20  # samples that are analysed, the last ones


class Slope(NamedTuple):
    """Change per root mean square of the amplitude."""

    value: float
    std: float  #: its standard deviation

    @property
    def p_value(self) -> float:
        """Probability of as large a slope if the structure is linear [-]."""
        return float(2 * scipy.stats.t.sf(abs(self.value / self.std), _BLOCKS - 1))

    def scaled(self, factor: float) -> "Slope":
        """Return the slope per an amplitude that is larger by a factor."""
        return Slope(self.value * factor, self.std * factor)


@dataclass(frozen=True, kw_only=True)
class AmplitudeDependence:
    """Slopes of a mode's frequency and damping over its amplitude."""

    amplitude: float  #: root mean square of the amplitude, at the channel with the largest motion [m/s2]
    channel: str  #: that channel
    frequency: Slope  #: relative change of the frequency per `amplitude` [-]
    damping: Slope  #: change of the damping ratio per `amplitude` [-]
    mean: float  #: amplitude at which frequency and damping are the identified ones [m/s2]
    low: float  #: amplitude that is exceeded in 90 % of the time [m/s2]
    high: float  #: amplitude that is exceeded in 10 % of the time [m/s2]

    @classmethod
    def pooled(cls, windows: "Sequence[AmplitudeDependence]") -> "AmplitudeDependence":
        """Return the mean over windows of slopes per m/s2, weighted by their variances; at least one window."""
        amplitude = float(np.sqrt(np.mean([window.amplitude**2 for window in windows])))
        factors = [amplitude / window.amplitude for window in windows]
        return cls(
            amplitude=amplitude,
            channel=windows[0].channel,
            frequency=_weighted([w.frequency.scaled(f) for w, f in zip(windows, factors, strict=True)]),
            damping=_weighted([w.damping.scaled(f) for w, f in zip(windows, factors, strict=True)]),
            mean=float(np.mean([window.mean for window in windows])),
            low=float(np.mean([window.low for window in windows])),
            high=float(np.mean([window.high for window in windows])),
        )

    def change(self, amplitude: float) -> float:
        """Return the factor of the slopes at an amplitude [m/s2], from the identified values [-]."""
        return (amplitude - self.mean) / self.amplitude


def dependence_on_amplitude(recording: Recording, estimate: ModalEstimate) -> tuple[AmplitudeDependence | None, ...]:
    """Return the dependence of each mode on its amplitude.

    Parameters
    ----------
    recording : Recording
        The last 2^20 samples of its longest stretch without a gap are used.
    estimate : ModalEstimate
        Modes of the recording; (n_modes,) results.

    Returns
    -------
    tuple of AmplitudeDependence or None
        None for a mode whose record is too short or lacks a channel of its shape, whose signal is not clear of noise
        in 30 % of the time, or which is excited by blows.
    """
    names = [channel.name for channel in recording.channels]
    if not set(estimate.channels) <= set(names):
        return (None,) * estimate.n_modes
    data = _gapless(recording.data[:, [names.index(name) for name in estimate.channels]])
    if len(data) < _FEWEST or not np.ptp(data, axis=0).any():
        return (None,) * estimate.n_modes
    spectrum = scipy.fft.rfft(data - data.mean(0), axis=0)
    return tuple(_of_mode(spectrum, recording.rate, len(data), estimate, k) for k in range(estimate.n_modes))


def _weighted(slopes: Sequence[Slope]) -> Slope:
    """Return the mean, weighted by the variances."""
    weight = np.array([slope.std for slope in slopes]) ** -2.0
    value = weight @ [slope.value for slope in slopes] / weight.sum()
    return Slope(float(value), float(weight.sum() ** -0.5))


def _gapless(data: FloatArray) -> FloatArray:
    """Return the longest stretch of data (n_samples, n_channels) without a gap in any channel, cut."""
    start, stop = max(gapless_stretches(data), key=lambda part: part[1] - part[0], default=(0, 0))
    return data[max(start, stop - _LONGEST) : stop]


def _of_mode(
    spectrum: ComplexArray, rate: float, n_samples: int, estimate: ModalEstimate, mode: int
) -> AmplitudeDependence | None:
    """Return the dependence of one mode."""
    frequency, decay = estimate.frequency, estimate.frequency * estimate.damping
    if not decay[mode] > 0:
        return None
    reach = int(_REACH * decay[mode] * n_samples / rate)
    centre = round(frequency[mode] * n_samples / rate)
    if 2 * reach + 1 < _FEWEST + 2 * _EDGE or centre - reach < 1 or centre + reach >= n_samples // 2:
        return None
    near = np.flatnonzero(np.abs(frequency - frequency[mode]) < _REACH * (decay + decay[mode]))
    weights = np.linalg.pinv(estimate.shape[near].real.T, rcond=_INDEPENDENT)[near.tolist().index(mode)]
    largest = int(np.argmax(np.abs(estimate.shape[mode])))
    lines = 2 * spectrum[centre - reach : centre + reach + 1] @ (weights * np.abs(estimate.shape[mode, largest]))
    envelope = scipy.fft.ifft(scipy.fft.ifftshift(lines))[_EDGE:-_EDGE] * len(lines) / n_samples
    band_rate = len(lines) * rate / n_samples
    pole = 2 * np.pi * complex(-decay[mode], frequency[mode] - centre * rate / n_samples)
    fitted = _slope(envelope, band_rate, pole)
    if fitted is None:
        return None
    slope, std = fitted
    amplitude = np.abs(envelope)
    rms = float(np.sqrt(np.mean(amplitude**2)))
    low, high = np.quantile(amplitude, [0.1, 0.9])
    omega = 2 * np.pi * frequency[mode]
    return AmplitudeDependence(
        amplitude=rms,
        channel=estimate.channels[largest],
        frequency=Slope(slope.imag / omega, std.imag / omega),
        damping=Slope(-slope.real / omega, std.real / omega),
        mean=_mean_amplitude(envelope),
        low=float(low),
        high=float(high),
    )


def _mean_amplitude(envelope: ComplexArray) -> float:
    """Return the mean of the amplitude, weighted by its square as the identified frequency is."""
    amplitude = np.abs(envelope)
    return float((amplitude**3).sum() / (amplitude**2).sum())


def _slope(envelope: ComplexArray, rate: float, pole: complex) -> tuple[complex, complex] | None:
    """Return mu and the standard deviations of its parts; None if they cannot be estimated."""
    power = np.abs(envelope) ** 2
    noise = _noise(envelope, rate, pole)
    past = np.array([power[_ORDER - 1 - k : len(power) - 1 - k] for k in range(_ORDER)]).mean(0)
    clear = past > _CLEAR * noise
    if clear.mean() < _LEAST_SHARE or np.count_nonzero(clear) < _FEWEST:
        return None
    expected = _expected(power, -pole.real / rate, _mean_amplitude(envelope)) / rate
    turned = 0.0
    for _ in range(_TURNS):
        fitted = _fit(envelope, np.exp(pole / rate), expected, clear)
        if fitted is None:
            return None
        slope, std = fitted
        turned += slope.imag
        if abs(slope.imag) < _SETTLED * std.imag:
            break
        envelope = envelope * np.exp(-1j * slope.imag * np.r_[0.0, np.cumsum(expected[:-1])])
    return complex(slope.real, turned), std


def _expected(power: FloatArray, decay: float, mean: float) -> FloatArray:
    """Return the mean of g over the next sample that is expected (n_samples,).

    The functions L_k(a^2) z of a complex Ornstein-Uhlenbeck process, with associated Laguerre polynomials of order 1,
    decay with 2 k + 1 times its rate. The process has the mean power of the past.

    Parameters
    ----------
    power : (n_samples,) a^2
    decay : of the amplitude, in a sample
    mean : amplitude at which g is 0
    """
    forget = np.exp(-decay / _PAST)
    level, _ = scipy.signal.lfilter([1 - forget], [1, -forget], power, zi=[forget * power.mean()])
    nodes, weights = scipy.special.roots_genlaguerre(_NODES, 1)
    relative = np.minimum(power / level, _LARGEST)
    found = np.zeros(len(power))
    for k in range(_TERMS + 1):
        share = weights @ (np.sqrt(nodes) * scipy.special.eval_genlaguerre(k, 1, nodes)) / (k + 1)
        kept = -np.expm1(-2 * k * decay) / (2 * k * decay) if k else 1.0
        found += share * kept * scipy.special.eval_genlaguerre(k, 1, relative)
    return np.asarray((np.sqrt(level) * found - mean) / np.sqrt(power.mean()))


def _fit(
    envelope: ComplexArray, step: complex, expected: FloatArray, clear: BoolArray
) -> tuple[complex, complex] | None:
    """Return mu and the standard deviations of its parts; None if the forces are blows."""
    n = len(envelope)
    past = np.array([envelope[_ORDER - 1 - k : n - 1 - k] for k in range(_ORDER)]).T
    now, weight = envelope[_ORDER:], clear.astype(float)
    for _ in range(_PASSES):
        regression = _solved(past, now, weight)
        error = now - past @ regression
        power = np.abs(error) ** 2
        local = scipy.ndimage.uniform_filter1d(power, _LOCAL)
        weight = clear / np.maximum(local, 1e-3 * power.mean())
    normal = power[clear] * weight[clear]
    if np.mean(normal**2) > _GAUSSIAN * np.mean(normal) ** 2:
        return None
    response = scipy.signal.lfilter([0, step], [1, -step], expected * envelope)
    regressors = np.column_stack([scipy.signal.lfilter(np.r_[1, -regression], [1], response)[_ORDER:], past])
    slope = complex(_solved(regressors, now, weight)[0])
    return slope, _std(regressors, now, weight, np.flatnonzero(clear))


def _solved(regressors: ComplexArray, values: ComplexArray, weight: FloatArray) -> ComplexArray:
    """Return the weighted least squares solution."""
    weighted = (regressors * weight[:, None]).conj().T
    return np.asarray(np.linalg.solve(weighted @ regressors, weighted @ values))


def _std(regressors: ComplexArray, values: ComplexArray, weight: FloatArray, used: IndexArray) -> complex:
    """Return the standard deviations of the parts of the first coefficient: the larger of jackknife and formula."""
    weighted = (regressors * weight[:, None]).conj().T
    normal, product = weighted @ regressors, weighted @ values

    def left_out(block: IndexArray) -> complex:
        less = normal - weighted[:, block] @ regressors[block]
        return complex(np.linalg.solve(less, product - weighted[:, block] @ values[block])[0])

    without = np.array([left_out(block) for block in np.array_split(used, _BLOCKS)])
    moves = without - without.mean()
    share = (_BLOCKS - 1) / _BLOCKS
    error = np.abs(values - regressors @ np.linalg.solve(normal, product)) ** 2
    least = float((weight * error).sum()) / len(used) * float(np.linalg.inv(normal)[0, 0].real) / 2
    return complex(*(max(share * float((part**2).sum()), least) ** 0.5 for part in (moves.real, moves.imag)))


def _noise(envelope: ComplexArray, rate: float, pole: complex) -> float:
    """Return the power of noise in the band: of the spectrum of the quietest segments, the part without resonance."""
    n = min(int(_SEGMENT / abs(pole.real) * rate), len(envelope) // 10)
    taper = np.hanning(n)
    segments = np.array([taper * envelope[start : start + n] for start in range(0, len(envelope) - n + 1, n // 2)])
    powers = np.abs(scipy.fft.fft(segments, axis=1)) ** 2
    quiet = powers.mean(1) <= np.quantile(powers.mean(1), _QUIETEST)
    spectrum = powers[quiet].mean(0)
    shape = np.column_stack([1 / np.abs(2j * np.pi * scipy.fft.fftfreq(n, 1 / rate) - pole) ** 2, np.ones(n)])
    shape[:, 0] /= shape[:, 0].mean()
    least = 1e-6 * spectrum.mean()
    found = np.array([spectrum.mean(), np.quantile(spectrum, 0.1)])
    for _ in range(_NOISE_STEPS):  # maximum likelihood of exponentially distributed lines
        weighted = shape / ((shape @ found) ** 2)[:, None]
        found = np.maximum(np.linalg.solve(weighted.T @ shape, weighted.T @ spectrum), least)
    return float(found[1] / (taper**2).sum())
