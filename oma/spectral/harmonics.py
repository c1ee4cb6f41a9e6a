"""Tones of machines and mains, distinguished from lightly damped modes.

Three properties distinguish a tone from the narrow-band Gaussian noise that random forces make of a resonance:

- its line is as wide as the window and has no skirts (`oma.spectral.narrow_band`): compared with every resonance
  of at least the smallest damping that a mode may have, by likelihood, for modes whose damping may be nearly zero;
- its power is constant: the variance of the envelope's power divided by its mean squared is 0 for a sine and 1 for a
  resonance (this combines the kurtosis of the signal and the two peaks of its probability density). It also detects a
  tone with a varying frequency and a wide line. The steadiness of a resonance by chance depends on the number of its
  decay times: over 300 s, a mode at 2 Hz with 0.2 % has only eight;
- it lies at a multiple of another tone.

Each test is stated with the rate at which it takes a resonance for a tone. A mode whose line agrees with a tone's, in a
record in which it may also be a resonance, is uncertain.

References
----------
Jacobsen, N.-J., Andersen, P., Brincker, R. (2007). Eliminating the influence of harmonic components in operational
modal analysis. Proceedings of IMAC XXV.
Brincker, R., Andersen, P., Møller, N. (2000). An indicator for separation of structural and harmonic modes in
output-only modal testing. Proceedings of IMAC XVIII.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy import fft

from daq import FloatArray
from oma.preparation import BoolArray, bridged
from oma.selection import BAND, Selection, uncertainty_law
from oma.spectral.narrow_band import LineTest, line_test
from oma.spectral.transforms import fast_length
from oma.types import ComplexArray, ModalEstimate

_AT_ONCE = 2  # shapes, which bounds the memory
_WANDER = 0.01  # half a band that a wandering tone stays in, as a share of its frequency [-]
_MIN_LINES = 8  # on each side
_MIN_COMPLETE = 0.5  # share of samples
_FALSE_TONE = 1e-4  # rate at which a resonance is taken for a tone, by its line or by its steadiness
_DECAY_EVIDENCE = 2.7  # log likelihood ratio of some decay over none that a tone exceeds in 1 % of cases
_SUSPECT = 1e-3  # damping below which a mode may be, within three standard deviations, to be compared with a tone
_LIGHT = 5e-4  # damping of the lightest modes, whose estimates may be below the limit of a tone's by chance
_REACH = (24, 64)  # half width of the band compared [lines]
_LINE_STD = 0.1  # standard deviation of a line's frequency, not less than the bound for 10 dB [lines]
_FALSE_MULTIPLE = 1e-2  # chance that any frequency of the record lies so near to a multiple of a tone
# Variance of the power of an envelope over its mean squared that a resonance stays under once in ten thousand windows,
# by how often it has forgotten: decay rate times duration. Simulated: `tests/oma/spectral/test_harmonics.py`.
_TIMES = 2.0 ** np.arange(1, 12)
_STEADIEST = np.array([0.016, 0.058, 0.109, 0.211, 0.357, 0.461, 0.577, 0.667, 0.753, 0.804, 0.864])


@dataclass(frozen=True, eq=False, kw_only=True)
class LineClasses:
    """Modes of an estimate that are tones."""

    tone: BoolArray  #: (n_modes,) taken for tones
    uncertain: BoolArray  #: (n_modes,) tone and lightly damped mode explain the record alike
    frequency: FloatArray  #: (n_modes,) of the line where one was found, else of the mode [Hz]


def steadiest(times: float) -> float:
    """Return the variance of power over its mean squared that chance leaves a resonance once in ten thousand windows.

    Parameters
    ----------
    times : float
        Decay rate times duration: ``2 pi f zeta T``.

    Returns
    -------
    float
        1 in the long run; 0 if the window is too short to decide.
    """
    if times < _TIMES[0]:
        return 0.0
    return float(np.interp(np.log(times), np.log(_TIMES), _STEADIEST))


def classify(
    data: FloatArray, rate: float, estimate: ModalEstimate, suspected: BoolArray, limits: Selection
) -> LineClasses:
    """Distinguish tones from modes.

    Parameters
    ----------
    data : (n_samples, n_channels) array
        Of the estimate's channels, NaN where a sample is missing.
    rate : float
        [Hz].
    estimate : ModalEstimate
        Modes and tones.
    suspected : (n_modes,) array of bool
        Taken for tones by their damping alone, which decides if the data allow no test.
    limits : Selection

    Returns
    -------
    LineClasses
    """
    tone, uncertain, frequency = suspected.copy(), np.zeros_like(suspected), estimate.frequency.copy()
    complete: BoolArray = np.all(np.isfinite(data), axis=1)
    if complete.mean() < _MIN_COMPLETE:
        return LineClasses(tone=tone, uncertain=uncertain, frequency=frequency)
    duration = len(data) / rate
    tests: dict[int, LineTest] = {}
    variations: list[list[float]] = []  # of each mode, over each of its bands
    for i, lines in enumerate(_transforms(data, estimate.shape.real, complete)):
        if estimate.damping[i] - 3 * estimate.damping_std[i] < _SUSPECT:
            test = _line(lines, complete, duration, estimate, i, limits.min_damping)
            tests |= {i: test} if test else {}
        centre, widths = estimate.frequency[i] * duration, _half_widths(estimate.frequency[i], estimate.damping[i])
        variations.append([_variation(lines, complete, centre, width * duration) for width in widths])
    law = np.array([uncertainty_law(f, _LIGHT, duration)[1] for f in estimate.frequency])
    undamped = suspected & (estimate.damping < _LIGHT - 3 * law)  # as no light mode's estimate would be
    for i, test in tests.items():
        threshold = np.log(test.n_samples / _FALSE_TONE)
        if test.significance > threshold:
            tone[i] = undamped[i] or test.evidence > threshold
            uncertain[i] = not tone[i] and test.decay_evidence < _DECAY_EVIDENCE
            frequency[i] = (round(float(estimate.frequency[i]) * duration) + test.frequency) / duration
    multiple = _multiples(frequency, tone, duration) & uncertain
    tone, uncertain = tone | multiple, uncertain & ~multiple
    steady = _steady(variations, duration, estimate, tone)
    return LineClasses(tone=tone | steady, uncertain=uncertain & ~steady, frequency=frequency)


def _transforms(data: FloatArray, shapes: FloatArray, complete: BoolArray) -> Iterator[ComplexArray]:
    """Yield the transforms (n_lines,) of the signals along each shape, gaps bridged."""
    for start in range(0, len(shapes), _AT_ONCE):
        moved = shapes[start : start + _AT_ONCE] @ data.T
        if not complete.all():
            moved = bridged(moved.T, np.repeat(~complete[:, None], len(moved), axis=1)).T
        yield from map(fft.rfft, moved)  # one by one: twice as fast, in memory that is used again


def _line(
    lines: ComplexArray, complete: BoolArray, duration: float, estimate: ModalEstimate, i: int, least_damping: float
) -> LineTest | None:
    """Return the comparison of a tone with resonances for one mode; None if it is not the mode's, or of gaps alone."""
    frequency, std = float(estimate.frequency[i]), float(estimate.frequency_std[i])
    wide = BAND * float(estimate.damping[i]) * frequency * duration
    centre = round(frequency * duration)
    reach = int(min(np.clip(wide, *_REACH), centre // 2))
    if reach < _REACH[0] // 2:
        return None
    test = line_test(lines, centre, reach, complete.astype(float), 2 * np.pi * frequency * least_damping * duration)
    if test is None:
        return None
    away = abs(centre + test.frequency - frequency * duration)
    return test if away < 1 + 3 * std * duration else None


def _multiples(frequency: FloatArray, tone: BoolArray, duration: float) -> BoolArray:
    """Return which frequencies are multiples of a tone's, closer than expected by chance for any of them."""
    pairs = max(len(frequency) * np.count_nonzero(tone), 1)
    result = np.zeros_like(tone)
    for base in frequency[tone]:
        order = np.round(frequency / base)
        margin = 3 * _LINE_STD * np.hypot(order, 1) / duration
        sure = 2 * margin / base * pairs < _FALSE_MULTIPLE
        result |= (order >= 2) & (np.abs(frequency - order * base) < margin) & sure
    return result


def _steady(
    variations: Sequence[Sequence[float]], duration: float, estimate: ModalEstimate, known: BoolArray
) -> BoolArray:
    """Return which modes are too steady to be resonances under random forces (n_modes,).

    A mode with a known tone in its band is not tested, because the steady part there is the tone.
    """
    result = np.zeros_like(known)
    for i in np.argsort(estimate.damping):
        others = estimate.frequency[known | result]
        frequency, damping = float(estimate.frequency[i]), float(estimate.damping[i])
        result[i] = not known[i] and any(
            variation < steadiest(2 * np.pi * frequency * damping * duration)
            for variation, width in zip(variations[i], _half_widths(frequency, damping), strict=True)
            if not np.any(np.abs(others - frequency) < width)
        )
    return result


def _half_widths(frequency: float, damping: float) -> tuple[float, float]:
    """Return the half widths [Hz] of the bands to look at: a resonance's, and that of a tone that wanders."""
    narrow = BAND * damping * frequency
    return narrow, max(narrow, _WANDER * frequency)


def _variation(lines: ComplexArray, complete: BoolArray, centre: float, half_width: float) -> float:
    """Return the variance of the power of a band's envelope over its mean squared; centre and width in lines.

    Infinite, which is no sign of a tone, where the spectrum has too few lines of the band.
    """
    reach = max(half_width, _MIN_LINES)
    first, last = max(round(centre - reach), 1), min(round(centre + reach), len(lines) - 1)
    if last - first < _MIN_LINES - 1:
        return np.inf
    n = fast_length(4 * (last - first + 1))  # so many points that the power, of twice the band, is resolved
    band = np.zeros(n, dtype=np.complex128)
    band[: last - first + 1] = lines[first : last + 1]
    power = np.abs(fft.ifft(band)) ** 2
    if not complete.all():
        power = power[np.interp(np.arange(n) / n, np.linspace(0, 1, len(complete)), complete) > 1 / 2]
    return float(np.var(power) / np.mean(power) ** 2)
