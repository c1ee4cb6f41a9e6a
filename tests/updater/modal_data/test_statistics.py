"""False alarms, scatter and delays, as statistics over many draws."""

import numpy as np
import pytest
from scipy.stats import binom
from scipy.stats import f as f_distribution

from daq import FloatArray
from oma import ModalEstimate
from tests.support.thorough import few_of
from updater import (
    ModalMean,
    Scatter,
    TrackedModes,
    estimate_delays,
    learn_scatter,
    mean_modes,
    remove_delays,
)

N_MODES, N_WINDOWS, N_CHANNELS = 8, 12, 6
DEVICES = {"a_x": "a", "a_y": "a", "b_x": "b", "b_y": "b", "c_x": "c", "c_y": "c"}


def baseline(random: np.random.Generator, stated: float, real: float) -> tuple[ModalMean, Scatter]:
    size = (N_WINDOWS, N_MODES)
    modes = TrackedModes(
        channels=tuple(DEVICES),
        log_frequency=np.log(np.arange(1, N_MODES + 1)) + real * random.standard_normal(size),
        log_frequency_std=np.full(size, stated),
        damping=np.full(size, 0.005),
        damping_std=np.full(size, 1e-4),
        shape=np.full((*size, N_CHANNELS), N_CHANNELS**-0.5),
        shape_std=np.full((*size, N_CHANNELS), 1e-3),
        imaginary=np.zeros((*size, N_CHANNELS)),
    )
    scatter = learn_scatter(modes)
    return mean_modes(modes, frequency_factor=scatter.frequency_factor), scatter


def distance(window: FloatArray, mean: ModalMean, scatter: Scatter) -> tuple[float, int]:
    """T2 of log frequencies over its degrees of freedom p, and p: F(p, degrees of freedom of the scatter) by theory."""
    z2 = (window - mean.log_frequency) ** 2 / (scatter.window_std**2 + mean.log_frequency_std**2)
    p = int(np.isfinite(z2).sum())
    return float(np.nansum(z2)) / p, p


@pytest.mark.parametrize("factor", few_of([1.6, 0.7, 1.0]))
def test_false_alarm_rate_is_as_stated_for_wrong_window_deviations(factor: float) -> None:
    """1 % a window, over 1500 baselines of twelve windows; binomial bounds at 1e-4 each side."""
    random, n, alpha = np.random.default_rng(7), 1500, 0.01
    alarms = 0
    for _ in range(n):
        mean, scatter = baseline(random, 1e-3, factor * 1e-3)
        window = np.log(np.arange(1, N_MODES + 1)) + factor * 1e-3 * random.standard_normal(N_MODES)
        t2, p = distance(window, mean, scatter)
        alarms += t2 > f_distribution.isf(alpha, p, scatter.degrees_of_freedom)
    print(f"factor {factor}: {alarms} false alarms in {n}")
    assert binom.ppf(1e-4, n, alpha) <= alarms <= binom.ppf(1 - 1e-4, n, alpha)


def test_window_with_missing_modes_is_scored_by_the_remaining_modes() -> None:
    mean, scatter = baseline(np.random.default_rng(1), 1e-3, 1e-3)
    window = mean.log_frequency.copy()
    window[3:] = np.nan
    t2, p = distance(window, mean, scatter)
    assert (t2, p) == (0.0, 3)


def test_learnt_scatter_recovers_the_true_factor() -> None:
    """Its relative standard deviation is 1 / sqrt(2 x 88 degrees of freedom) = 7.5 %: four of them."""
    _, scatter = baseline(np.random.default_rng(2), 1e-3, 1.5e-3)
    assert scatter.degrees_of_freedom == N_MODES * (N_WINDOWS - 1)
    assert scatter.frequency_factor == pytest.approx(1.5, rel=0.3)


def test_too_few_windows_are_refused() -> None:
    modes = TrackedModes(
        channels=("a",),
        log_frequency=np.zeros((2, 1)),
        log_frequency_std=np.ones((2, 1)),
        damping=np.ones((2, 1)),
        damping_std=np.ones((2, 1)),
        shape=np.ones((2, 1, 1)),
        shape_std=np.ones((2, 1, 1)),
        imaginary=np.zeros((2, 1, 1)),
    )
    with pytest.raises(ValueError, match="at least 3 windows"):
        learn_scatter(modes)


def delayed(random: np.random.Generator, delay: dict[str, float]) -> ModalEstimate:
    frequency = np.array([10.8, 11.0, 38.8, 68.8, 92.5, 158.0, 253.1, 271.0])
    shape = random.standard_normal((8, 6))
    shape /= np.linalg.norm(shape, axis=1, keepdims=True)
    tau = np.array([delay[DEVICES[c]] for c in DEVICES])
    turned = shape * np.exp(-2j * np.pi * frequency[:, None] * tau) + 2e-3 * random.standard_normal((8, 6))
    ones = np.ones(8)
    return ModalEstimate(
        channels=tuple(DEVICES),
        frequency=frequency,
        frequency_std=1e-3 * frequency,
        damping=0.005 * ones,
        damping_std=0.001 * ones,
        shape=turned,
        shape_std=np.full((8, 6), 2e-3),
        support=ones,
        law_ratio=ones,
        start=0,
        end=1,
    )


@pytest.mark.parametrize("seed", range(5))
def test_device_delays_are_estimated_from_phases_and_removed(seed: int) -> None:
    """Up to 0.4 ms, found to 10 us: a phase noise of 2e-3 / 0.4 over two channels at 271 Hz is 2 us."""
    random = np.random.default_rng(seed)
    true = dict(zip("abc", random.uniform(-2e-4, 2e-4, 3), strict=True))
    estimate = delayed(random, true)
    found = estimate_delays(estimate, DEVICES)
    middle = np.mean(list(true.values()))
    for name, value in found.items():
        assert value == pytest.approx(true[name] - middle, abs=1e-5)
    cleaned = remove_delays(estimate, DEVICES, found).shape
    assert np.abs(cleaned.imag).max() < 0.03
