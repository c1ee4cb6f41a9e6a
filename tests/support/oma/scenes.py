"""Scenes on which the unattended identification is measured: modes, forces, noise and disturbances."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import signal

from daq import FloatArray, Recording
from oma import mac_matrix
from oma.mac import Shapes
from tests.support.oma.structures import Structure, chain, simulate

RATE = 100.0  # Hz
_MEMORY = 10.0  # s
_WEAK = 10 ** (-26 / 20)  # amplitude of a weak mode


@dataclass(frozen=True, eq=False, kw_only=True)
class Tone:
    """Tone of a machine."""

    frequency: float  # Hz
    share: float  # rms over that of the signals
    wander: float = 0.0  # standard deviation of its frequency, as a share of it


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """One kind of window."""

    label: str
    structure: Structure
    duration: float = 300.0  # s
    noise: float = 0.05  # of the signals' rms
    tone: Tone | None = None

    def record(self, seed: int) -> Recording:
        """Return a window of this kind."""
        recording = simulate(self.structure, self.duration, RATE, seed, noise=self.noise)
        return recording if self.tone is None else with_tone(recording, self.tone, seed)


def tower() -> Structure:
    """Return eight masses: 2.0 to 21.3 Hz, 1 % damping, the two highest modes 5 % apart."""
    return chain(8, first=2.0)


def _close() -> Structure:
    frequency = tower().frequency.copy()
    frequency[3] = 1.015 * frequency[2]
    return replace(tower(), frequency=frequency)


def _weak() -> Structure:
    """Two of the modes at -26 dB: force and response are both down by 13 dB."""
    size = np.ones(8)
    size[[2, 4]] = np.sqrt(_WEAK)
    return replace(tower(), shapes=tower().shapes * size[:, None])


SCENES = {
    "clean": Scene(label="5 % noise", structure=tower()),
    "noise": Scene(label="50 % noise", structure=tower(), noise=0.5),
    "close": Scene(label="two modes 1.5 % apart", structure=_close()),
    "harmonic": Scene(label="a tone as strong as all else", structure=tower(), tone=Tone(frequency=11.5, share=1.0)),
    "weak": Scene(label="two modes at -26 dB", structure=_weak()),
    "short": Scene(label="60 s", structure=tower(), duration=60.0),
    "near tone": Scene(label="that tone 1.5 % beside a mode", structure=tower(), tone=Tone(frequency=9.87, share=1.0)),
    "machine": Scene(
        label="that tone, wandering by 0.1 %", structure=tower(), tone=Tone(frequency=11.5, share=1.0, wander=1e-3)
    ),
}


def with_tone(recording: Recording, tone: Tone, seed: int) -> Recording:
    """Add a tone of random shape and phase; its frequency wanders within about `_MEMORY`."""
    rng = np.random.default_rng((seed, 1))
    n, n_channels = recording.data.shape
    memory = np.exp(-1 / (_MEMORY * recording.rate))
    white = np.sqrt(1 - memory**2) * rng.standard_normal(n)
    drift = signal.lfilter([1.0], [1.0, -memory], white, zi=[memory * rng.standard_normal()])[0]
    phase = 2 * np.pi * np.cumsum(tone.frequency * (1 + tone.wander * drift)) / recording.rate
    size = tone.share * np.sqrt(2) * float(np.sqrt(np.mean(recording.data**2)))
    shape = rng.standard_normal(n_channels)
    shape *= np.sqrt(n_channels) / np.linalg.norm(shape)
    wave = np.sin(phase + rng.uniform(0, 2 * np.pi))
    return replace(recording, data=recording.data + size * wave[:, None] * shape)


def pairs(frequency: FloatArray, shapes: Shapes, truth: Structure) -> list[tuple[int, int]]:
    """Pair found modes with true ones: within 2 % of frequency and MAC above 0.8, the nearest first, each once."""
    off = np.abs(np.log(frequency[:, None] / truth.frequency))
    cost = off + 1 - mac_matrix(shapes, truth.shapes)
    cost[(off > 0.02) | (cost - off > 0.2)] = np.inf
    result = []
    while np.isfinite(cost).any():
        i, j = (int(k) for k in np.unravel_index(np.argmin(cost), cost.shape))
        result.append((i, j))
        cost[i], cost[:, j] = np.inf, np.inf
    return sorted(result)


def faulty(recording: Recording, fault: str, seed: int) -> Recording:
    """Return a recording with one of `FAULTS`, on its third channel unless all are hit."""
    rng = np.random.default_rng((seed, 2))
    data = recording.data.copy()
    n = len(data)
    signal_of = data[:, 2]
    rms = float(signal_of.std())
    if fault == "scattered":
        data[rng.random(data.shape) < 0.2] = np.nan
    elif fault == "dead":
        data[:, 2] = 0.0123
    elif fault == "lost":
        data[:, 2] = np.nan
    elif fault == "spikes":
        at = rng.choice(n, n // 300, replace=False)
        data[at, 2] += rng.choice([-1, 1], len(at)) * rng.uniform(20, 50, len(at)) * rms
    elif fault == "gaps":
        for start in rng.choice(n - n // 50, 5):
            data[start : start + n // 50, rng.integers(data.shape[1])] = np.nan
    elif fault == "drift":
        data[:, 2] += 3 * rms * np.cumsum(rng.standard_normal(n)) / np.sqrt(recording.rate)  # 3 rms in a second
    elif fault == "warming":
        data += 30 * rms * np.sin(np.linspace(0, 4, n) + 1)[:, None] * rng.uniform(0.5, 1, data.shape[1])
    elif fault == "overdriven":
        data[:, 2] = np.clip(signal_of, -2.6 * rms, 2.6 * rms)
    elif fault == "clipped":
        data[:, 2] = np.clip(signal_of, -1.2 * rms, 1.2 * rms)
    elif fault == "copy":
        data[:, 2] = -2.5 * data[:, 5]
    return replace(recording, data=data)


FAULTS = {
    "scattered": "20 % of the samples missing, each for itself",
    "dead": "a constant channel",
    "lost": "a channel that is not there",
    "spikes": "a channel with a spike in 0.3 % of the samples",
    "gaps": "five gaps of 2 % of the window",
    "drift": "a channel that walks away",
    "warming": "all channels drift by 30 times their rms",
    "clipped": "a channel clipped at 1.2 of its rms",
    "overdriven": "a channel clipped at 2.6 of its rms",
    "copy": "a channel that is another one over again",
}
