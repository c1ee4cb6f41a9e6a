"""Simulated structures with known modes, sampled exactly."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import signal

from daq import Channel, FloatArray, Recording

FRAME_CHANNELS = (
    "col_037_x", "col_037_y", "col_074_x", "col_074_y", "col_111_x", "col_111_y",
    "beam_mid_x", "beam_mid_y", "beam_left_y", "beam_left_z", "beam_right_y", "beam_right_z",
)  # fmt: skip
FRAME_FREQUENCY = np.array([10.78, 10.97, 38.84, 68.77, 92.53, 158.02, 253.11, 270.96])  # Hz
FRAME_DAMPING = np.array([0.004, 0.006, 0.003, 0.005, 0.008, 0.004, 0.002, 0.005])
# Columns as FRAME_CHANNELS: bending in x with rocking arms, bending in y, torsion with arms against each other.
FRAME_SHAPES = np.array(
    [
        [0.10, 0.01, 0.35, 0.02, 0.65, 0.02, 1.00, 0.02, 0.02, -0.45, 0.02, 0.45],
        [-0.01, 0.10, -0.02, 0.35, -0.02, 0.66, -0.02, 1.00, 1.03, 0.01, 0.99, -0.01],
        [0.00, 0.01, 0.01, 0.01, 0.01, 0.02, 0.01, 0.02, 1.00, 0.01, -0.97, -0.01],
        [0.40, 0.01, 0.75, 0.01, 0.60, 0.01, -0.05, 0.01, 0.01, 0.90, 0.01, -0.92],
        [0.01, 0.50, 0.01, 0.85, 0.01, 0.45, 0.01, -0.45, -0.70, 0.01, -0.68, -0.01],
        [0.80, 0.01, 0.20, -0.01, -0.85, 0.01, -0.40, 0.01, 0.01, 0.55, -0.01, -0.52],
        [0.01, 0.85, 0.01, -0.05, 0.01, -0.80, 0.02, 0.10, 0.75, 0.01, 0.72, 0.02],
        [0.60, 0.02, -0.80, 0.01, 0.25, -0.02, 0.30, 0.01, 0.02, 0.45, 0.01, 0.48],
    ]
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Structure:
    """Modes of a simulated structure."""

    frequency: FloatArray  # (n_modes,) Hz
    damping: FloatArray  # (n_modes,)
    shapes: FloatArray  # (n_modes, n_channels), mass-normalised
    channels: tuple[str, ...]


def frame(damping: npt.ArrayLike = FRAME_DAMPING) -> Structure:
    """Return a T-shaped steel frame with two close modes in orthogonal planes."""
    shapes = FRAME_SHAPES / np.linalg.norm(FRAME_SHAPES, axis=1, keepdims=True)
    return Structure(
        frequency=FRAME_FREQUENCY,
        damping=np.broadcast_to(np.asarray(damping, dtype=np.float64), FRAME_FREQUENCY.shape),
        shapes=shapes,
        channels=FRAME_CHANNELS,
    )


def chain(n: int = 6, first: float = 2.0, damping: float = 0.01) -> Structure:
    """Return a fixed-free chain of equal masses and springs; its modes are known in closed form.

    Blevins (1979), Formulas for natural frequency and mode shape, table 6-2.
    """
    angle = (2 * np.arange(1, n + 1) - 1) * np.pi / (2 * n + 1)
    shapes = np.sin(angle[:, None] * np.arange(1, n + 1))
    return Structure(
        frequency=first * np.sin(angle / 2) / np.sin(angle[0] / 2),
        damping=np.full(n, damping),
        shapes=shapes / np.linalg.norm(shapes, axis=1, keepdims=True),
        channels=tuple(f"mass_{i}" for i in range(1, n + 1)),
    )


def simulate(
    structure: Structure,
    duration: float,
    rate: float,
    seed: int,
    noise: float = 0.05,
    forced: slice = slice(None),
    taps: int = 0,
) -> Recording:
    """Return accelerations under white forces at the sensors `forced`, held between samples; exact for such forces.

    `noise` is the standard deviation of white sensor noise as a share of the signals' root mean square; `taps` are
    blows at random sensors and times, each as strong as ten seconds of the forces.
    """
    rng = np.random.default_rng(seed)
    settle = int(min(5.0 / np.min(structure.damping * structure.frequency * 2 * np.pi), 30.0) * rate)
    n = round(duration * rate)
    forces = np.zeros((settle + n, len(structure.channels)))
    forces[:, forced] = rng.standard_normal(forces[:, forced].shape)
    blows = np.random.default_rng((seed, 1))
    for when, where in zip(
        blows.integers(settle, len(forces), taps), blows.integers(forces.shape[1], size=taps), strict=True
    ):
        forces[when, where] += np.sqrt(10 * rate)
    data = np.zeros((n, len(structure.channels)))
    for f, zeta, shape in zip(structure.frequency, structure.damping, structure.shapes, strict=True):
        omega = 2 * np.pi * f
        # zero-order hold of s^2 / (s^2 + 2 zeta omega s + omega^2)
        system = (np.array([1.0, 0.0, 0.0]), np.array([1.0, 2 * zeta * omega, omega**2]))
        numerator, denominator, _ = signal.cont2discrete(system, 1 / rate, method="zoh")
        data += np.outer(signal.lfilter(numerator.ravel(), denominator, forces @ shape)[settle:], shape)
    data += noise * np.sqrt(np.mean(data**2)) * rng.standard_normal(data.shape)
    channels = tuple(Channel(name=name, device=name.rsplit("_", 1)[0], axis=0) for name in structure.channels)
    return Recording(channels=channels, data=data, rate=rate, start=1_700_000_000_000_000_000)


def frame_with_higher_modes() -> Structure:
    """Return the frame with modes beyond the eight, inside and outside the band of 1000 samples per second."""
    low, rng = frame(), np.random.default_rng(7)
    higher = rng.standard_normal((4, len(FRAME_CHANNELS)))
    return Structure(
        frequency=np.append(low.frequency, [341.7, 393.9, 576.1, 733.7]),
        damping=np.append(low.damping, np.full(4, 0.005)),
        shapes=np.vstack((low.shapes, higher / np.linalg.norm(higher, axis=1, keepdims=True))),
        channels=low.channels,
    )


def anti_aliased(recording: Recording, factor: int, noise: float, seed: int) -> Recording:
    """Return the recording at a lower rate, as a sensor's own filter and noise would leave it.

    `noise` is the standard deviation of white sensor noise as a share of the signals' root mean square.
    """
    taps = signal.firwin(32 * factor + 1, 0.88 / factor)
    data = signal.upfirdn(taps, recording.data, down=factor, axis=0)[32:-32]
    data = data + noise * np.sqrt(np.mean(data**2)) * np.random.default_rng(seed).standard_normal(data.shape)
    return replace(recording, data=data, rate=recording.rate / factor)
