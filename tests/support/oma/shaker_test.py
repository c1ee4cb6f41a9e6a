"""Tests of the tower with two shakers at once: periodic random forces, and their H1 responses and multiple coherences.

Motion is solved in time, as in an impact test (`tests.support.oma.impact_test`). Each block of forces is repeated until
the transient has decayed, and its last period is measured: there is no leakage.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from oma import ComplexArray
from tests.support.oma.impact_test import REFERENCES, Tower, accelerations

_PERIODS = 5  # the slowest mode has decayed to exp(-9) when the last one begins
_FINE = 8  # time steps per sample


@dataclass(frozen=True, kw_only=True)
class ShakerTest:
    """Settings of a test."""

    rate: float = 200.0  #: [Hz]
    seconds: float = 8.0  #: length of a block
    blocks: int = 12  #: averaged
    noise: float = 0.05  #: of each response, over its rms [-]
    poor: int | None = None  #: channel whose noise is ten times as large; None: none

    def h1(self, structure: Tower, seed: int) -> tuple[FloatArray, ComplexArray, FloatArray]:
        """Return lines [Hz], accelerances (n_lines, n_channels, n_forces), coherences (n_lines, n_channels)."""
        random = np.random.default_rng(seed)
        blocks = [self._block(structure, random) for _ in range(self.blocks)]
        force, motion = (np.array([block[k] for block in blocks]) for k in (0, 1))
        own = np.einsum("bfi,bfj->fij", force, force.conj())
        cross = np.einsum("bfi,bfj->fij", motion, force.conj())
        response = cross @ np.linalg.inv(own)
        coherent = np.einsum("fij,fij->fi", response, cross.conj()).real
        line = np.arange(force.shape[1]) / self.seconds
        kept = (line > 1.0) & (line < 0.4 * self.rate)
        return line[kept], response[kept], (coherent / (np.abs(motion) ** 2).sum(axis=0))[kept]

    def _block(self, structure: Tower, random: np.random.Generator) -> tuple[ComplexArray, ComplexArray]:
        """Return the spectra of forces (n_lines, n_forces) and accelerations (n_lines, n_channels) of one period."""
        n = round(self.seconds * self.rate)
        band = np.fft.rfftfreq(n * _FINE, 1 / (self.rate * _FINE)) < 0.45 * self.rate
        spectra = band[:, None] * np.exp(2j * np.pi * random.random((len(band), len(REFERENCES))))
        force = np.fft.irfft(spectra * n, n * _FINE, axis=0)
        motion = sum(
            accelerations(structure, place, np.tile(force[:, k], _PERIODS), self.rate * _FINE)
            for k, place in enumerate(REFERENCES)
        )
        last = np.asarray(motion)[-n * _FINE :: _FINE]
        share = np.full(last.shape[1], self.noise)
        if self.poor is not None:
            share[self.poor] *= 10
        noise = share * last.std(axis=0) * random.standard_normal(last.shape)
        return np.fft.rfft(force[::_FINE], axis=0), np.fft.rfft(last + noise, axis=0)
