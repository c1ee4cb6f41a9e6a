"""Impact tests of a tower in the time domain: forces and accelerations with noise, windows, and their H1 responses.

The tower is two chains of masses and springs, one per horizontal direction, with nearly the same stiffness and a weak
coupling, so that its modes come in close pairs. Its motion is the exact solution for forces that are straight between
fine time steps, mode by mode; nothing here knows a rational fraction.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import linalg, signal

from daq import FloatArray
from oma import ComplexArray

_FINE = 8  # time steps per sample
_STRAIGHT = (1 / 12, 10 / 12, 1 / 12)  # spectrum of straight pieces over that of their ends, to fourth order
_PULSE_SECONDS = 4e-3  # half sine of the hammer
_FLOORS, _MASS, _STIFFNESS = 4, 12.0, 4.5e5  # [-], [kg], [N/m]
_RATIO, _COUPLING = 1.06, 0.01  # stiffness in y over that in x, and between the two [-]
CHANNELS = tuple(f"{floor}_{axis}" for axis in "xy" for floor in range(1, _FLOORS + 1))
REFERENCES = (3, 5)  # hit: top along x, second floor along y


@dataclass(frozen=True, eq=False, kw_only=True)
class Tower:
    """Modes of the tower; shapes are mass-normalised."""

    frequency: FloatArray  #: (n_modes,) [Hz]
    damping: FloatArray  #: (n_modes,) [-]
    shape: FloatArray  #: (n_modes, n_channels) [kg^-1/2]


def tower(damping: tuple[float, float] = (0.004, 0.015)) -> Tower:
    """Return the tower with damping ratios that rise from the first to the last mode."""
    chain = 2 * np.eye(_FLOORS) - np.eye(_FLOORS, k=1) - np.eye(_FLOORS, k=-1)
    chain[-1, -1] = 1
    coupling = _COUPLING * chain
    stiffness = _STIFFNESS * np.block([[chain, coupling], [coupling, _RATIO * chain]])
    mass = np.tile(_MASS * np.linspace(1.2, 0.8, _FLOORS), 2)
    values, vectors = linalg.eigh(stiffness, np.diag(mass))
    return Tower(
        frequency=np.sqrt(values) / (2 * np.pi),
        damping=np.linspace(*damping, len(values)),
        shape=vectors.T,
    )


@dataclass(frozen=True, kw_only=True)
class ImpactTest:
    """Settings of a test."""

    rate: float = 200.0  #: [Hz]
    seconds: float = 8.0  #: length of a hit's record
    hits: int = 5  #: averaged, per reference
    noise: float = 0.002  #: of each response, over its rms in a record [-]
    force_noise: float = 0.0005  #: of the force, over its peak [-]
    force_window: float | None = 0.15  #: time after which the force is set to zero [s]; None: never
    decay: float | None = None  #: time constant of the exponential window on force and responses [s]; None: none
    poor: int | None = None  #: channel whose noise is ten times as large; None: none
    hum: float = 0.0  #: amplitude of a hum of each response, over its rms in a record [-]
    hum_frequency: float = 31.3  #: [Hz]

    def h1(
        self, structure: Tower, seed: int, references: tuple[int, ...] = REFERENCES
    ) -> tuple[FloatArray, ComplexArray]:
        """Return lines [Hz] and accelerances (n_lines, n_channels, n_references) [m/s2/N]."""
        return self.h1_with_coherence(structure, seed, references)[:2]

    def h1_with_coherence(
        self, structure: Tower, seed: int, references: tuple[int, ...] = REFERENCES
    ) -> tuple[FloatArray, ComplexArray, FloatArray]:
        """Return lines [Hz], accelerances (n_lines, n_channels, n_references) [m/s2/N] and coherences [-]."""
        random = np.random.default_rng(seed)
        pairs = [self._reference(structure, reference, random) for reference in references]
        line = np.arange(round(self.rate * self.seconds) // 2 + 1) / self.seconds
        kept = line < 0.4 * self.rate  # below the anti-alias filter
        response, coherence = (np.stack(columns, axis=2)[kept] for columns in zip(*pairs, strict=True))
        return line[kept], response, coherence.real

    def _reference(
        self, structure: Tower, reference: int, random: np.random.Generator
    ) -> tuple[ComplexArray, FloatArray]:
        """Return the H1 estimate over all hits at one place, and the coherence, (n_lines, n_channels) each."""
        pairs = []
        for _ in range(self.hits):
            force, motion = self._hit(structure, reference, random)
            pairs.append((np.fft.rfft(force)[:, None], np.fft.rfft(motion, axis=0)))
        cross = np.sum([force.conj() * motion for force, motion in pairs], axis=0)
        power, own = (np.sum([np.abs(pair[k]) ** 2 for pair in pairs], axis=0) for k in (0, 1))
        return cross / power, np.abs(cross) ** 2 / (power * own)

    def _hit(self, structure: Tower, reference: int, random: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        """Return force (n,) [N] and accelerations (n, n_channels) [m/s2] of one hit, windowed."""
        n, rate = round(self.seconds * self.rate), self.rate * _FINE
        t = np.arange(n * _FINE) / rate
        begin = 0.02 + random.uniform(0, 0.01)
        inside = (t >= begin) & (t <= begin + _PULSE_SECONDS)
        force = np.where(inside, random.uniform(150, 300) * np.sin(np.pi * (t - begin) / _PULSE_SECONDS), 0.0)
        motion = accelerations(structure, reference, force, rate)
        both = np.column_stack([np.convolve(force, _STRAIGHT)[: len(force)], np.roll(motion, 1, axis=0)])
        low = signal.firwin(20 * _FINE + 1, 0.9 / _FINE)
        both = signal.lfilter(low, np.ones(1), both, axis=0)[::_FINE]
        size = np.sqrt(np.mean(both**2, axis=0))
        size[0] = np.abs(both[:, 0]).max()
        share = np.full(len(size), self.noise)
        share[0] = self.force_noise
        if self.poor is not None:
            share[1 + self.poor] *= 10
        both = both + share * size * random.standard_normal(both.shape)
        if self.hum:
            phase = 2 * np.pi * (self.hum_frequency * np.arange(n) / self.rate + random.uniform())
            both[:, 1:] += self.hum * size[1:] * np.sin(phase)[:, None]
        if self.force_window:
            both[round(self.force_window * self.rate) :, 0] = 0.0
        if self.decay:
            both = both * np.exp(-np.arange(n) / self.rate / self.decay)[:, None]
        return both[:, 0], both[:, 1:]


def accelerations(structure: Tower, reference: int, force: FloatArray, rate: float) -> FloatArray:
    """Return the accelerations (n, n_channels) [m/s2] to a force [N] at a channel, straight between samples."""
    result = np.zeros((len(force), structure.shape.shape[1]))
    for frequency, damping, shape in zip(structure.frequency, structure.damping, structure.shape, strict=True):
        omega = 2 * np.pi * frequency
        system: Any = signal.TransferFunction([1.0, 0.0, 0.0], [1.0, 2 * damping * omega, omega**2])
        exact = system.to_discrete(1 / rate, method="foh")
        result += np.outer(signal.lfilter(exact.num, exact.den, force), shape * shape[reference])
    return result


SCENES = {
    "exponential window, noise 2 %": ImpactTest(noise=0.02, decay=1.0, force_noise=1e-4),
    "exponential window, noise 10 %": ImpactTest(noise=0.1, decay=1.0, force_noise=1e-4),
    "records of 4 s": ImpactTest(noise=0.02, decay=0.6, force_noise=1e-4, seconds=4.0),
    "no exponential window": ImpactTest(noise=0.02, force_noise=1e-4, seconds=16.0),
    "noise of the force in the whole record": ImpactTest(noise=0.02, force_window=None, seconds=16.0),
}  #: tests of the statistics and of the benchmark

DISTURBED = {
    "a sensor with ten times the noise": replace(SCENES["exponential window, noise 2 %"], poor=2),
    "a hum of 31.3 Hz, 20 % of the rms": replace(SCENES["exponential window, noise 2 %"], hum=0.2),
}  #: tests in which coherences differ between sensors or lines
