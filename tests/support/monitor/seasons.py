"""Modes of a structure through a simulated month, as identification would hand them on window by window."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray, Recording
from oma import ModalEstimate, normalise
from oma.selection import uncertainty_law
from tests.support.oma.structures import Structure, simulate

WINDOW = 600.0  # s
RARE = 6  # the mode that is seldom excited
STRANGE = -1  # what is no mode


@dataclass(frozen=True, kw_only=True)
class Month:
    """Events of a month."""

    days: float = 30.0
    drift: float = 0.05  # of the frequencies that temperature moves most, in all
    daily: float = 0.005  # of the same, within a day
    missing: float = 0.10  # share of the windows that are lost, in outages of half a day in the mean
    unseen: float = 0.03  # share of the windows in which a well excited mode is not found
    rare: float = 0.05  # share of the windows in which the rare one is
    spurious: float = 0.10  # share of the windows that show a mode that is none
    n_channels: int = 6
    jump: float = 0.0  # of all frequencies, in mid-month: a change of the structure


# the fifth mode does not drift; the fourth comes from below and is above it in the end
FREQUENCY = np.array([2.1, 3.0, 4.6, 6.0, 6.15, 8.2, 9.4, 11.0])  # Hz
SENSITIVITY = np.array([0.8, 1.0, 0.9, 1.0, 0.0, 0.7, 0.9, 1.0])
DAMPING = 0.01


def month(month: Month, seed: int) -> Iterator[tuple[ModalEstimate, IndexArray]]:
    """Yield the estimate of each window, and which mode each of its modes is (n_modes,)."""
    rng = np.random.default_rng(seed)
    n = round(month.days * 86400 / WINDOW)
    there = ~_outages(rng, n, month.missing)
    shapes = _shapes(rng, month.n_channels)
    for k in np.flatnonzero(there).tolist():
        season = 0.5 - 0.5 * np.cos(np.pi * k / n)
        warmth = month.drift * season + month.daily * np.sin(2 * np.pi * k * WINDOW / 86400)
        frequency = FREQUENCY * (1 + SENSITIVITY * warmth) * (1 - month.jump * (k > n / 2))
        likely = np.where(np.arange(len(FREQUENCY)) == RARE, month.rare, 1 - month.unseen)
        modes = np.flatnonzero(rng.random(len(FREQUENCY)) < likely)
        strange = rng.random() < month.spurious
        yield _estimate(rng, k, frequency[modes], shapes[modes], modes, strange)


def _shapes(rng: np.random.Generator, n_channels: int) -> FloatArray:
    """Return random shapes (n_modes, n_channels); no two neighbours have a MAC above 0.4."""
    while True:
        shapes = rng.standard_normal((len(FREQUENCY), n_channels))
        unit = shapes / np.linalg.norm(shapes, axis=1, keepdims=True)
        if (np.sum(unit[1:] * unit[:-1], axis=1) ** 2).max() < 0.4:
            return np.asarray(unit)


def _outages(rng: np.random.Generator, n: int, share: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    lost = np.zeros(n, np.bool_)
    while np.mean(lost) < share:
        start, length = rng.integers(round(0.95 * n)), 1 + rng.exponential(0.5 * 86400 / WINDOW)
        lost[start : min(start + round(length), round(0.95 * n))] = True  # the end is seen
    return lost


def _estimate(
    rng: np.random.Generator, k: int, frequency: FloatArray, shape: FloatArray, modes: IndexArray, strange: bool
) -> tuple[ModalEstimate, IndexArray]:
    """Return a window's estimate: errors of twice the uncertainty law, as stated."""
    if strange:
        frequency = np.append(frequency, rng.uniform(1.5, 12.0))
        shape = np.vstack([shape, rng.standard_normal(shape.shape[1])])
        shape[-1] /= np.linalg.norm(shape[-1])
        modes = np.append(modes, STRANGE)
    damping = np.full(len(frequency), DAMPING)
    std = np.array([2 * uncertainty_law(f, DAMPING, WINDOW)[0] for f in frequency])
    found = frequency + std * rng.standard_normal(len(frequency))
    shape_std = 0.03 * np.where(modes == RARE, 3.0, 1.0)[:, None] * np.ones(shape.shape)
    noisy = normalise(shape + shape_std * rng.standard_normal(shape.shape))
    order = np.argsort(found)
    start = round(k * WINDOW * 1e9)
    estimate = ModalEstimate(
        channels=tuple(f"ch{i}" for i in range(shape.shape[1])),
        frequency=found[order],
        frequency_std=std[order],
        damping=damping,
        damping_std=0.1 * damping,
        shape=noisy[order],
        shape_std=shape_std[order],
        support=np.ones(len(found)),
        law_ratio=np.full(len(found), 2.0),
        start=start,
        end=start + round(WINDOW * 1e9),
    )
    return estimate, modes[order]


@dataclass(frozen=True, eq=False, kw_only=True)
class Truth:
    """The modes that are excited in a window."""

    modes: IndexArray  # (n,)
    frequency: FloatArray  # (n,) Hz
    shapes: FloatArray  # (n, n_channels)


def month_of_recordings(seed: int, what: Month = Month()) -> Iterator[tuple[Recording, Truth]]:
    """Yield a recording per hour, of the same month, and its true modes."""
    rng = np.random.default_rng(seed)
    n = round(what.days * 24)
    shapes = _shapes(rng, what.n_channels)
    lost = rng.random(n) < what.missing
    for k in np.flatnonzero(~lost).tolist():
        season = 0.5 - 0.5 * np.cos(np.pi * k / n)
        warmth = what.drift * season + what.daily * np.sin(2 * np.pi * k / 24)
        frequency = FREQUENCY * (1 + SENSITIVITY * warmth)
        modes = np.flatnonzero((np.arange(len(FREQUENCY)) != RARE) | (rng.random() < what.rare))
        structure = Structure(
            frequency=frequency[modes],
            damping=np.full(len(modes), DAMPING),
            shapes=shapes[modes],
            channels=tuple(f"ch{i}" for i in range(what.n_channels)),
        )
        recording = simulate(structure, WINDOW, 40.0, seed=1000 * seed + k)
        start = round(k * 3600e9)
        yield replace(recording, start=start), Truth(modes=modes, frequency=frequency[modes], shapes=shapes[modes])
