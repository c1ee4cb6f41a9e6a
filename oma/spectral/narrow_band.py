"""Likelihood of a spectral line against a resonance in a narrow band.

Demodulated to its centre and low-passed, a mode's signal is a complex first-order autoregression with the pole
``exp(-lambda dt)``, ``lambda = 2 pi f zeta``, in white noise. A tone of constant amplitude is the limit without decay.
The Kalman filter gives the exact likelihood of each decay rate, for records of any length. The line of a tone has the
width of the window and no skirts. The random forces of a resonance cause skirts even in a record that is too short for
it to decay.

References
----------
Brockwell, P. J., Davis, R. A. (1991). Time series: theory and methods. Springer, section 12.2: the likelihood.
Wasserman, L., Ramdas, A., Balakrishnan, S. (2020). Universal inference. PNAS 117(29), 16880-16890: likelihood ratios
as tests whose level needs no asymptotics.
"""

from dataclasses import dataclass

import numpy as np
from numpy import fft

from daq import FloatArray
from oma.preparation import BoolArray
from oma.spectral.transforms import fast_length
from oma.types import ComplexArray

_EDGE = 3  # samples at the ends that the low-pass spoils
_LONGEST_DECAY = 4.0  # of a sample: white in the band
_DECAY_RATIO = 1.7  # of successive decay rates tried
_SLOWER = np.array([0.0, 0.03, 0.1, 0.3, 0.6])  # decay rates of a tone, as shares of the least of a resonance
_OFFSETS = np.array([-1.2, -0.6, 0.0, 0.6, 1.2])  # centres tried, in decay rates away from the highest line
_NOISE_RATIOS = np.logspace(-7, 2, 19)  # noise of a sample over the line's power
_PADDING = 16  # finer grid in which the highest line is sought


@dataclass(frozen=True, kw_only=True)
class LineTest:
    """Comparison of a tone with resonances in a narrow band."""

    frequency: float  #: frequency of the highest line, from the centre of the band [lines]
    evidence: float  #: log likelihood of the best tone over that of the best resonance or of noise alone [-]
    decay_evidence: float  #: log likelihood of the best decay over that of none: above 2.7 for 1 % of tones [-]
    significance: float  #: log likelihood of the best tone over that of noise alone [-]
    n_samples: int  #: independent complex samples compared


def line_test(
    lines: ComplexArray, centre: int, reach: int, complete: FloatArray, least_decay: float
) -> LineTest | None:
    """Compare a tone with every resonance that decays at least at a given rate.

    Parameters
    ----------
    lines : (n_lines,) array
        Transform of a real signal.
    centre, reach : int
        Line in the middle of the band, and lines on each side that pass; twice as many are used.
    complete : (n_samples,) array
        1 where a sample of the signal is there, 0 where it is missing.
    least_decay : float
        Least decay rate of a resonance times the duration [-].

    Returns
    -------
    LineTest or None
        None if gaps leave no sample.
    """
    signal = _demodulated(lines, centre, reach)
    n = len(signal)
    there = np.interp((np.arange(n) + 0.5) / n, (np.arange(len(complete)) + 0.5) / len(complete), complete) > 0.99
    there = np.convolve(~np.pad(there, 2, mode="edge"), np.ones(5), mode="valid") == 0  # a gap spoils its neighbours
    there[:_EDGE] = there[-_EDGE:] = False
    if not there.any():
        return None
    peak = _highest_line(np.where(there, signal, 0))
    least = least_decay / n
    n_faster = max(2, int(np.ceil(np.log(_LONGEST_DECAY / least) / np.log(_DECAY_RATIO))) + 1)
    decay = np.concatenate([least * _SLOWER, np.geomspace(least, max(_LONGEST_DECAY, 1.01 * least), n_faster)])
    likelihood = _log_likelihood(signal, there, decay, peak + _OFFSETS * decay[:, None])
    m = int(there.sum())
    noise = -m * np.log(np.mean(np.abs(signal[there]) ** 2)) - m
    tone = float(likelihood[: len(_SLOWER)].max())
    return LineTest(
        frequency=peak * n / (2 * np.pi),
        evidence=tone - max(float(likelihood[len(_SLOWER) :].max()), float(noise)),
        decay_evidence=float(likelihood.max() - likelihood[0]),
        significance=tone - float(noise),
        n_samples=m,
    )


def _demodulated(lines: ComplexArray, centre: int, reach: int) -> ComplexArray:
    """Return the signal of a band about its centre, (2 reach,), whose white noise remains white."""
    k = np.arange(-2 * reach, 2 * reach)
    # slopes are power-complementary, so that folding leaves white noise white
    inside = (centre + k > 0) & (centre + k < len(lines))
    band = np.where(inside, lines[np.clip(centre + k, 0, len(lines) - 1)], 0)
    band = band * np.cos(np.pi / 2 * np.sin(np.pi * k / (4 * reach)) ** 2)
    folded = band.reshape(2, 2 * reach).sum(axis=0)  # lines -2 reach .. -1 and 0 .. 2 reach - 1 alias onto each other
    return np.asarray(fft.ifft(folded))


def _highest_line(signal: ComplexArray) -> float:
    """Return the frequency at which one sinusoid takes most power [rad per sample]."""
    n = fast_length(_PADDING * len(signal))
    size = np.abs(fft.fft(signal, n))
    k = int(np.argmax(size))
    before, at, after = size[k - 1], size[k], size[(k + 1) % n]
    bend = before - 2 * at + after
    found = 2 * np.pi * (k + (0.5 * (before - after) / bend if bend else 0.0)) / n
    return float(np.angle(np.exp(1j * found)))


def _log_likelihood(signal: ComplexArray, there: BoolArray, decay: FloatArray, centre: FloatArray) -> FloatArray:
    """Return the log likelihood of decay rates, the most likely power, noise and centre given (n_decays,).

    Parameters
    ----------
    signal, there : (n_samples,) arrays
    decay : (n_decays,) array
        [1 / sample].
    centre : (n_decays, n_centres) array
        [rad / sample].
    """
    pole, turn = np.exp(-decay)[:, None, None], np.exp(-1j * centre)[:, :, None]
    power = np.ones((len(decay), 1, len(_NOISE_RATIOS)))  # of the state's error, of the resonance's power
    state = np.zeros((*centre.shape, len(_NOISE_RATIOS)), np.complex128)
    log_variance, squares, phase = np.zeros_like(power), np.zeros(state.shape), np.ones_like(turn)
    for k, value in enumerate(signal):
        if k:
            state, power, phase = pole * state, pole**2 * power + (1 - pole**2), phase * turn
        if there[k]:
            error, variance = value * phase - state, power + _NOISE_RATIOS
            log_variance += np.log(variance)
            squares += (error.real**2 + error.imag**2) / variance
            gain = power / variance
            state, power = state + gain * error, power - gain * power
    n = np.count_nonzero(there)
    result: FloatArray = (-n * np.log(squares / n) - log_variance - n).max(axis=(1, 2))
    return result
