"""Frequency domain decomposition: the singular values of the spectral matrix peak at modes, its vectors are shapes.

References
----------
Brincker, R., Zhang, L., Andersen, P. (2001). Modal identification of output-only systems using frequency domain
decomposition. Smart Materials and Structures 10(3), 441-445.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from daq import FloatArray
from oma.mac import normalise
from oma.methods.base import LevelModes, Method
from oma.preparation import Level
from oma.selection import Mode, block_std, normalised_move, pole_moves, uncertainty_law
from oma.spectral import Decomposition, SpectralResonance, SpectrumAccumulator, decompose, residue_weight, resonances
from oma.types import ComplexArray, Stabilization

_LONGEST, _SHORTEST = 2048, 64  # samples per segment
_ROUNDING = 0.2  # of the logarithm of a length, upwards
_MIN_SEGMENTS = 4  # without overlap
_MARGIN = (0.8, 1.15)  # of the band, that bells at its ends reach into
_STORE = 1 << 27  # bytes that the blocks' spectra may take


@dataclass(frozen=True, eq=False, kw_only=True)
class Reading:
    """Result of a method at a resonance, and the influence of each block of time on it."""

    frequency: float  #: [Hz]
    damping: float  #: [-]
    shape: ComplexArray  #: (n_channels,)
    frequency_moves: FloatArray  #: (n_blocks,) [Hz]
    damping_moves: FloatArray  #: (n_blocks,) [-]
    shape_moves: ComplexArray  #: (n_blocks, n_channels) changes of the shape per block, not normalised
    frequency_resolution: float = 0.0  #: standard deviation by the resolution of the lines [Hz]
    damping_resolution: float = 0.0  #: the same of damping [-]
    shape_resolution: FloatArray | float = 0.0  #: (n_channels,) possible contribution of close modes to the shape [-]


@dataclass(frozen=True, kw_only=True)
class FDD(Method):
    """Frequency domain decomposition: frequencies and shapes where a singular value peaks.

    FDD gives no damping. The damping of the bell (`FSDD`) is stated; a peak without a bell is not a resonance.
    """

    name: ClassVar[str] = "fdd"
    n_fft: int | None = None  #: samples per segment; None: `segment` chooses [-]
    n_blocks: int = 16  #: blocks of time, whose scatter gives the uncertainty [-]

    def __post_init__(self) -> None:
        """Refuse invalid options."""
        super().__post_init__()
        if self.n_fft is not None:
            self.check_least(n_fft=_SHORTEST)

    def least_samples(self, n_channels: int) -> int:
        """Return the least number of samples at one rate from which modes can be identified."""
        del n_channels
        return _MIN_SEGMENTS * (self.n_fft or _SHORTEST)

    def segment(self, n_samples: int, n_channels: int) -> int:
        """Return the number of samples per segment: a balance of resolution, number of averages, and memory."""
        if self.n_fft:
            return self.n_fft
        held = 2 * _STORE / (8 * self.n_blocks * n_channels * (n_channels + 1) / 2)
        wanted = min(10 * np.sqrt(n_samples), _LONGEST, n_samples / _MIN_SEGMENTS, held)
        return max(_SHORTEST, 1 << int(np.log2(max(wanted, 1)) + _ROUNDING))

    def start(self, channels: Sequence[str], level: Level) -> "SpectralLevel":
        """Return an empty identifier for one rate."""
        return SpectralLevel(self, len(channels), level)

    def read(self, parts: Decomposition, one: SpectralResonance, others: Sequence[SpectralResonance]) -> Reading:
        """Return frequency and damping from the peak of the singular value.

        Parameters
        ----------
        parts : Decomposition
        one : SpectralResonance
        others : sequence of SpectralResonance
            All of the band.
        """
        bell = read_bell(parts, one, others)
        spectrum = np.log(parts.filtered(one.filter, one.lines))
        width = parts.sums.rate / parts.sums.n_fft
        expected = one.pole.imag / parts.width - parts.sums.first - one.lines.start
        reach = max(2.0, -one.pole.real / parts.width)
        near = np.abs(np.arange(len(spectrum)) - expected) <= reach
        near[[0, -1]] = False
        peak = int(np.argmax(np.where(near, spectrum, -np.inf)))
        line = slice(one.lines.start + peak - 1, one.lines.start + peak + 2)
        moves = parts.moved(one.filter, line) / np.exp(spectrum[peak - 1 : peak + 2])
        offset = _vertex(spectrum[peak - 1 : peak + 2])
        step = np.array([_vertex(spectrum[peak - 1 : peak + 2] + move) for move in moves]) - offset
        # the vector of one line is the shape only as far as shapes of close modes are orthogonal
        shape, shape_moves = parts.moved_vectors(slice(line.start + 1, line.start + 2), np.ones(1), one.shape)
        return Reading(
            frequency=float(parts.sums.frequency[line.start + 1] + width * offset),
            damping=bell.damping,
            shape=shape,
            frequency_moves=width * step,
            damping_moves=bell.damping_moves,
            shape_moves=shape_moves,
            frequency_resolution=width / np.sqrt(12),
            shape_resolution=np.abs(normalise(shape) - normalise(bell.shape)),
        )


def _vertex(three: FloatArray) -> float:
    """Return where the parabola through three equidistant points has its vertex, from the middle one [steps]."""
    curvature = min(three[0] - 2 * three[1] + three[2], -1e-12)
    return float(np.clip(0.5 * (three[0] - three[2]) / curvature, -1, 1))


def read_bell(parts: Decomposition, one: SpectralResonance, others: Sequence[SpectralResonance]) -> Reading:
    """Return the mode from the bell fitted to a resonance's enhanced spectrum; arguments as for `FDD.read`."""
    moves = parts.moved(one.filter, one.lines) @ one.influence.T
    frequency_moves, damping_moves = pole_moves(one.pole, moves[:, 1] + 1j * moves[:, 0])
    shape, shape_moves = parts.moved_vectors(one.lines, residue_weight(parts, one, others), one.shape)
    return Reading(
        frequency=one.frequency,
        damping=one.damping,
        shape=shape,
        frequency_moves=frequency_moves,
        damping_moves=damping_moves,
        shape_moves=shape_moves,
    )


class SpectralLevel:
    """Spectral sums at one rate, and the modes in them; built by `FDD.start`.

    The samples are kept until there are enough of them for the longest segments: only then is the length of the
    segments chosen once for all.
    """

    def __init__(self, method: FDD, n_channels: int, level: Level) -> None:
        self._method, self._n_channels, self._level = method, n_channels, level
        self._waiting: list[FloatArray] | None = []
        self._spectra = self._accumulator(_LONGEST**2)

    def _accumulator(self, n_samples: int) -> SpectrumAccumulator:
        """Return an empty accumulator with segments for so many samples."""
        low, high = self._level.band
        band = (_MARGIN[0] * low, min(_MARGIN[1] * high, self._level.rate / 2))
        n_fft = self._method.segment(n_samples, self._n_channels)
        return SpectrumAccumulator(self._n_channels, self._level.rate, n_fft, band)

    def add(self, data: FloatArray) -> None:
        """Add a block, (n_samples, n_channels), zero-mean, NaN where a sample is missing."""
        if self._waiting is None:
            self._spectra.add(data)
            return
        self._waiting.append(data)
        n_samples = sum(map(len, self._waiting))
        if self._method.segment(n_samples, self._n_channels) == self._spectra.n_fft:
            for block in self._waiting:
                self._spectra.add(block)
            self._waiting = None

    def drop(self, n_blocks: int) -> None:
        """Remove the oldest blocks."""
        if self._waiting is None:
            self._spectra.drop(n_blocks)
        else:
            del self._waiting[:n_blocks]

    def _held(self) -> SpectrumAccumulator:
        """Return the spectra of the blocks held, in shorter segments if there are too few samples for long ones."""
        if self._waiting is None:
            return self._spectra
        spectra = self._accumulator(sum(map(len, self._waiting)))
        for block in self._waiting:
            spectra.add(block)
        return spectra

    def identify(self) -> LevelModes | None:
        """Return the modes in the blocks held; None if gaps leave too little to be worth a look."""
        held, limits = self._held(), self._method.selection
        if held.n_complete < self._method.least_samples(self._n_channels):
            return None
        duration = held.n_complete / self._level.rate
        parts = decompose(held.sums)
        found = resonances(parts, self._level.band, duration, limits)
        modes = [self._mode(parts, one, found, duration) for one in found]
        return LevelModes(poles=_diagram(found, self._n_channels), modes=modes)

    def _mode(
        self, parts: Decomposition, one: SpectralResonance, found: Sequence[SpectralResonance], duration: float
    ) -> Mode:
        """Return a mode with its standard deviations: none is claimed that lies under the law's."""
        reading = self._method.read(parts, one, found)
        bell = read_bell(parts, one, found)
        floor = uncertainty_law(reading.frequency, max(reading.damping, self._method.selection.min_damping), duration)
        frequency_std = np.hypot(block_std(reading.frequency_moves), reading.frequency_resolution)
        damping_std = np.hypot(block_std(reading.damping_moves), reading.damping_resolution)
        shape_std = block_std(normalised_move(reading.shape, reading.shape_moves).real)
        return Mode(
            frequency=reading.frequency,
            frequency_std=max(float(frequency_std), floor[0]),
            damping=reading.damping,
            damping_std=max(float(damping_std), floor[1]),
            shape=normalise(reading.shape),
            shape_std=np.hypot(shape_std, reading.shape_resolution),
            support=one.coherence,
            law_ratio=float(block_std(bell.frequency_moves)) / floor[0],
            frequency_moves=bell.frequency_moves,
        )


def _diagram(found: Sequence[SpectralResonance], n_channels: int) -> Stabilization:
    """Return resonances as poles; the number of the singular value is the order."""
    n = len(found)
    return Stabilization(
        frequency=np.array([one.frequency for one in found]),
        damping=np.array([one.damping for one in found]),
        shape=np.array([one.shape for one in found], dtype=np.complex128).reshape(n, n_channels),
        order=np.array([one.level for one in found], dtype=np.intp),
        column=np.arange(n),
        stable=np.ones(n, dtype=np.bool_),
    )
