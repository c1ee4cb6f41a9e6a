"""Windows of one state, and windows of a state that changed while they were recorded."""

import numpy as np
import pytest

from daq import FloatArray
from updater import TrackedModes, learn_scatter
from updater.modal_data import is_steady

N, STD = 12, 1e-3


def windows(shift: FloatArray, seed: int) -> TrackedModes:
    """Six modes with noise as stated, moved by (N, 6) of log frequency."""
    random = np.random.default_rng(seed)
    shape = np.tile(np.ones(4) / 2, (N, 6, 1))
    return TrackedModes(
        channels=tuple("abcd"),
        log_frequency=np.log(np.arange(10.0, 70.0, 10.0)) + STD * random.standard_normal((N, 6)) + shift,
        log_frequency_std=np.full((N, 6), STD),
        damping=np.full((N, 6), 0.005),
        damping_std=np.full((N, 6), np.nan),
        shape=shape + 1e-3 * random.standard_normal(shape.shape),
        shape_std=np.full(shape.shape, 1e-3),
        imaginary=np.full(shape.shape, np.nan),
    )


UNKNOWN = np.full(N, np.nan)


@pytest.mark.parametrize("seed", range(5))
def test_noise_and_outliers_are_one_state_but_drift_is_not(seed: int) -> None:
    random = np.random.default_rng((seed, 1))
    scatter = learn_scatter(windows(np.zeros((N, 6)), seed + 100))
    assert is_steady(windows(np.zeros((N, 6)), seed), scatter, UNKNOWN, UNKNOWN)
    wrong = np.where(random.random((N, 6)) < 0.05, 0.05, 0.0)
    assert is_steady(windows(wrong, seed), scatter, UNKNOWN, UNKNOWN)
    slide = np.linspace(0, 0.02, N)[:, None] * random.uniform(0.3, 1.0, 6)
    assert not is_steady(windows(slide, seed), scatter, UNKNOWN, UNKNOWN)


def test_changes_correlated_with_temperature_are_one_state() -> None:
    warmth = np.random.default_rng(6).uniform(10, 30, N)
    warm = windows(np.outer(-2e-4 * warmth, np.ones(6)), 7)
    scatter = learn_scatter(windows(np.zeros((N, 6)), 8))
    assert is_steady(warm, scatter, np.ones(N), warmth)
    assert is_steady(warm, scatter, UNKNOWN, warmth)
    hot = windows(np.outer(-2e-3 * warmth, np.ones(6)), 7)
    assert is_steady(hot, scatter, UNKNOWN, warmth)
    assert not is_steady(hot, scatter, UNKNOWN, UNKNOWN)


@pytest.mark.parametrize("seed", range(5))
def test_limited_changes_correlated_with_amplitude_are_one_state(seed: int) -> None:
    """Bolts soften by per cents where it shakes twice as much; five windows that slide go with a tenth more as well."""
    rms = np.geomspace(0.01, 0.03, N)
    scatter = learn_scatter(windows(np.zeros((N, 6)), seed + 100))
    softer = windows(np.outer(-0.02 * np.log(rms / rms[0]), np.linspace(0.3, 1.0, 6)), seed)
    assert is_steady(softer, scatter, rms, UNKNOWN)
    assert not is_steady(softer, scatter, UNKNOWN, UNKNOWN)
    louder = 0.01 * (1 + 0.1 * np.linspace(0, 1, N))
    slide = windows(np.outer(np.linspace(0, 0.05, N), np.linspace(0.3, 1.0, 6)), seed)
    assert not is_steady(slide, scatter, louder, UNKNOWN)
