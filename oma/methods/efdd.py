"""Frequency and damping from the bell about a peak: enhanced and frequency-spatial domain decomposition.

EFDD takes them from the decay that the bell of a singular value transforms into, FSDD from a bell fitted to the
spectrum that a mode's shape filters out.

References
----------
Brincker, R., Ventura, C. E., Andersen, P. (2001). Damping estimation by frequency domain decomposition. Proceedings of
IMAC-XIX, 698-703.
Zhang, L., Wang, T., Tamura, Y. (2010). A frequency-spatial domain decomposition (FSDD) method for operational modal
analysis. Mechanical Systems and Signal Processing 24(5), 1227-1239.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from daq import FloatArray
from oma.methods.fdd import FDD, Reading, read_bell
from oma.spectral import Decomposition, SpectralResonance
from oma.types import ComplexArray

_DOMAIN = 0.8  # least MAC of a line's singular vector with that of the peak (Brincker et al. 2001)
_DECAY = (0.9, 0.2)  # of its start: the part of the decay that is used
_MIN_LAGS = 8


@dataclass(frozen=True, kw_only=True)
class EFDD(FDD):
    """EFDD, corrected for the decay of the segments' windows. Shapes are those of `FSDD`.

    The bell is cut at the ends of the modal domain. The scatter of the blocks does not contain this error: the
    differences of frequency and damping from those of the whole bell (`FSDD`) are added to their deviations.
    """

    name: ClassVar[str] = "efdd"

    def read(self, parts: Decomposition, one: SpectralResonance, others: Sequence[SpectralResonance]) -> Reading:
        """Return frequency and damping from the transform of the bell."""
        lines = _domain(parts, one)
        spectrum, moves = parts.filtered(one.filter, lines), parts.moved(one.filter, lines)
        pole = _poles(parts, one, lines, np.vstack((spectrum, spectrum + moves, spectrum - moves)))
        n = len(moves)
        frequency, damping = np.abs(pole) / (2 * np.pi), -pole.real / np.abs(pole)
        bell = read_bell(parts, one, others)
        return Reading(
            frequency=float(frequency[0]),
            damping=float(damping[0]),
            shape=bell.shape,
            frequency_moves=(frequency[1 : n + 1] - frequency[n + 1 :]) / 2,
            damping_moves=(damping[1 : n + 1] - damping[n + 1 :]) / 2,
            shape_moves=bell.shape_moves,
            frequency_resolution=abs(float(frequency[0]) - bell.frequency),
            damping_resolution=abs(float(damping[0]) - bell.damping),
        )


def _domain(parts: Decomposition, one: SpectralResonance) -> slice:
    """Return the lines around the peak at which one of the first vectors is the mode's (the modal domain)."""
    agreement = np.max(np.abs(parts.vectors[one.lines] @ one.shape.conj()) ** 2, axis=1)
    peak = round(one.pole.imag / parts.width) - parts.sums.first - one.lines.start
    peak = min(max(peak, 1), len(agreement) - 2)
    other = np.flatnonzero(agreement < _DOMAIN)
    first = max((int(k) + 1 for k in other if k < peak), default=0)
    last = min((int(k) for k in other if k > peak), default=len(agreement))
    return slice(one.lines.start + min(first, peak - 1), one.lines.start + max(last, peak + 2))


def _poles(parts: Decomposition, one: SpectralResonance, lines: slice, spectra: FloatArray) -> ComplexArray:
    """Return the poles [rad/s] whose decays have spectra (n, n_lines).

    A line is laid through the logarithm of the decay, growth and phase at once, each lag weighing as its error permits;
    which lags are used follows from the first spectrum.
    """
    n_fft, n_lines = parts.sums.n_fft, spectra.shape[1]
    lag = np.unique(np.linspace(0, n_fft // 2, min(4 * n_lines, n_fft // 2)).astype(np.intp))
    time, window = lag / parts.sums.rate, parts.sums.window[lag]
    beat = 2 * np.pi * parts.sums.frequency[lines] - one.pole.imag
    decay = spectra @ np.exp(1j * np.outer(beat, time)) / window
    size = np.abs(decay[0]) / np.abs(decay[0, 0])
    first, last = (int(np.argmax(size < share)) if np.any(size < share) else len(lag) for share in _DECAY)
    first = min(first, len(lag) - _MIN_LAGS)
    used = slice(first, max(last, first + _MIN_LAGS))
    weight = size[used] * window[used]
    slope = np.linalg.pinv(np.column_stack((np.ones(len(weight)), time[used])) * weight[:, None])[1] * weight
    logarithm = np.log(np.abs(decay[:, used])) + 1j * np.unwrap(np.angle(decay[:, used]), axis=1)
    return np.asarray(logarithm @ slope + 1j * one.pole.imag)


@dataclass(frozen=True, kw_only=True)
class FSDD(FDD):
    """FSDD; where the paper fits a line to the inverse of the spectrum, this takes the most likely bell."""

    name: ClassVar[str] = "fsdd"

    def read(self, parts: Decomposition, one: SpectralResonance, others: Sequence[SpectralResonance]) -> Reading:
        """Return frequency and damping from the bell."""
        return read_bell(parts, one, others)
