"""The limit on the largest |z| against distributions known in closed form."""

import numpy as np
import pytest
from scipy.stats import norm, t

from updater.one_step.significance import moderated_variance, z_limit

DRAWS = 4000


def quantile_std(density: float) -> float:
    """Standard deviation of the simulated 99th percentile, where |z| has this density."""
    return float(np.sqrt(0.01 * 0.99 / DRAWS) / density)


@pytest.mark.parametrize("common", [0.0, 0.5, 20.0])
def test_limit_for_one_increment_of_known_deviation_is_normal(common: float) -> None:
    limit = norm.isf(0.005)
    tolerance = 4 * quantile_std(2 * norm.pdf(limit))
    assert z_limit(np.array([[3.0, 4.0]]), np.array([common]), 0) == pytest.approx(limit, abs=tolerance)


@pytest.mark.parametrize("windows", [4, 8, 24])
def test_limit_for_one_increment_of_learnt_deviation_is_student_t(windows: int) -> None:
    limit = t.isf(0.005, windows - 1)
    tolerance = 4 * quantile_std(2 * t.pdf(limit, windows - 1))
    assert z_limit(np.array([[2.0]]), np.zeros(1), windows - 1) == pytest.approx(limit, abs=tolerance)


def test_independent_increments_share_the_false_alarm_rate() -> None:
    """Sidak: each may pass with 1 - 0.99^(1/10)."""
    limit = norm.isf((1 - 0.99 ** (1 / 10)) / 2)
    tolerance = 4 * quantile_std(2 * 10 * norm.pdf(limit))
    assert z_limit(np.eye(10), np.zeros(10), 0) == pytest.approx(limit, abs=tolerance)


def test_fully_correlated_increments_count_as_one() -> None:
    limit = norm.isf(0.005)
    assert z_limit(np.ones((50, 1)), np.zeros(50), 0) == pytest.approx(limit, abs=4 * quantile_std(2 * norm.pdf(limit)))


def test_many_positions_are_thinned_without_changing_the_limit() -> None:
    """100,000 smooth positions: as 1,000 of them, within the scatter of the simulated percentile, in seconds."""
    along = np.linspace(0, 1, 100_000)[:, None]
    noise = np.hstack([np.cos(np.pi * k * along) for k in range(6)])
    few = noise[:: len(noise) // 1000]
    tolerance = 4 * quantile_std(2 * 6 * norm.pdf(norm.isf(0.01 / 12)))
    assert z_limit(noise, np.zeros(len(noise)), 7) == pytest.approx(z_limit(few, np.zeros(len(few)), 7), abs=tolerance)


def test_limit_is_reproducible() -> None:
    noise = np.random.default_rng(1).standard_normal((20, 6))
    assert z_limit(noise, np.ones(20), 7) == z_limit(noise, np.ones(20), 7)


def test_eight_windows_moderate_the_variance_halfway_to_the_mean() -> None:
    """Places that scatter by 1 and 3: 1 and 9, their mean 5, half way 3 and 7."""
    z = np.tile([1.0, 3.0], (8, 1))
    np.testing.assert_allclose(moderated_variance(z), [3.0, 7.0])
