"""Tones of machines and mains: told from resonances by how steady their amplitude is.

A resonance under random forces is narrow-band Gaussian noise: its power rises and falls by as much as its mean, about
as often as it forgets. The power of a machine's tone stays. The probability density of a sine has two horns, that of a
resonance one hump; the variance of the envelope's power says the same, and a tone whose frequency wanders, and that so
looks like a lightly damped mode, is known by it too. How much steadiness chance brings about depends on how often the
resonance has forgotten: over 300 s a mode at 2 Hz with 0.2 % forgets eight times only.

References
----------
Jacobsen, N.-J., Andersen, P., Brincker, R. (2007). Eliminating the influence of harmonic components in operational
modal analysis. Proceedings of IMAC XXV.
Brincker, R., Andersen, P., Møller, N. (2000). An indicator for separation of structural and harmonic modes in
output-only modal testing. Proceedings of IMAC XVIII.
"""

import numpy as np
from scipy import fft

from daq import FloatArray
from oma.conditioning import BoolArray
from oma.estimate import ComplexArray, ModalEstimate
from oma.gaps import bridged
from oma.selection import BAND

_WANDER = 0.01  # half a band that a wandering tone stays in, as a share of its frequency [-]
_LEAST_LINES = 8  # on each side
_LEAST_COMPLETE = 0.5  # share of samples
# Variance of the power of an envelope over its mean squared that a resonance stays under once in ten thousand windows,
# by how often it has forgotten: decay rate times duration. Simulated; `tests/oma/test_harmonics.py` repeats it.
_TIMES = 2.0 ** np.arange(1, 12)
_STEADIEST = np.array([0.016, 0.058, 0.109, 0.211, 0.357, 0.461, 0.577, 0.667, 0.753, 0.804, 0.864])


def steadiest(times: float) -> float:
    """Return the variance of power over its mean squared that chance leaves a resonance once in ten thousand windows.

    Parameters
    ----------
    times : float
        Decay rate times duration: ``2 pi f zeta T``.

    Returns
    -------
    float
        1 in the long run; 0 where the window is too short to tell.
    """
    if times < _TIMES[0]:
        return 0.0
    return float(np.interp(np.log(times), np.log(_TIMES), _STEADIEST))


def steady_modes(data: FloatArray, rate: float, estimate: ModalEstimate, known: FloatArray) -> BoolArray:
    """Tell which modes are too steady to be resonances under random forces.

    Parameters
    ----------
    data : (n_samples, n_channels) array
        Of the estimate's channels, NaN where a sample is missing.
    rate : float
        [Hz].
    estimate : ModalEstimate
    known : (n_tones,) array
        Tones known otherwise [Hz]; a mode with one in its band is not doubted, for what is steady there is the tone.

    Returns
    -------
    (n_modes,) array of bool
    """
    result = np.zeros(estimate.n_modes, dtype=np.bool_)
    complete: BoolArray = np.all(np.isfinite(data), axis=1)
    if complete.mean() < _LEAST_COMPLETE:
        return result
    gaps = np.repeat(~complete[:, None], estimate.n_modes, axis=1)
    lines = fft.rfft(bridged(data @ estimate.shape.real.T, gaps), axis=0)
    duration = len(data) / rate
    for i in np.argsort(estimate.damping):
        others = np.append(known, estimate.frequency[result])
        frequency, damping = float(estimate.frequency[i]), float(estimate.damping[i])
        result[i] = any(
            _variation(lines[:, i], complete, frequency * duration, width * duration)
            < steadiest(2 * np.pi * frequency * damping * duration)
            for width in _half_widths(frequency, damping)
            if not np.any(np.abs(others - frequency) < width)
        )
    return result


def _half_widths(frequency: float, damping: float) -> tuple[float, float]:
    """Return the half widths [Hz] of the bands to look at: a resonance's, and that of a tone that wanders."""
    narrow = BAND * damping * frequency
    return narrow, max(narrow, _WANDER * frequency)


def _variation(lines: ComplexArray, complete: BoolArray, centre: float, half_width: float) -> float:
    """Return the variance of the power of a band's envelope over its mean squared; centre and width in lines."""
    reach = max(half_width, _LEAST_LINES)
    first, last = max(round(centre - reach), 1), min(round(centre + reach), len(lines) - 1)
    n = fft.next_fast_len(4 * (last - first + 1))  # so many points that the power, of twice the band, is resolved
    band = np.zeros(n, dtype=np.complex128)
    band[: last - first + 1] = lines[first : last + 1]
    power = np.abs(fft.ifft(band)) ** 2
    there = np.interp(np.arange(n) / n, np.linspace(0, 1, len(complete)), complete) > 1 / 2
    return float(np.var(power[there]) / np.mean(power[there]) ** 2)
