"""Run lengths against simulated ones, limits against the quantiles they become in simple cases."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import chi2, norm, t
from scipy.stats import f as f_distribution

from monitor.detection.run_length import DetectionSettings, averaged, drift_limit, jump_limit, overlapping
from monitor.detection.scores import distance, normal_score, tamed


@pytest.mark.parametrize("freedom", [20.0, 200.0])
def test_limit_for_one_window_is_the_f_quantile(freedom: float) -> None:
    """The predictive distribution of a learned variance; 0.2 % is the table's interpolation."""
    found = jump_limit(5, 0, freedom, DetectionSettings(rate=1e-4, overlap=0.0, hold=1))
    assert found == pytest.approx(f_distribution.isf(1e-4, 5, freedom), rel=2e-3)


def test_limit_for_two_windows_uses_the_square_root_of_the_rate() -> None:
    found = jump_limit(5, 0, 1e4, DetectionSettings(rate=1e-6, overlap=0.0, hold=2))
    assert found == pytest.approx(chi2.isf(1e-3, 5) / 5, rel=2e-3)


def test_lasting_components_and_overlap_raise_the_limit() -> None:
    plain = [jump_limit(5, k, 1e4, DetectionSettings(rate=1e-6, overlap=0.0, hold=2)) for k in range(6)]
    overlapped = jump_limit(5, 0, 1e4, DetectionSettings(rate=1e-6, overlap=0.5, hold=2))
    assert np.all(np.diff(plain) > 0)
    assert plain[-1] == pytest.approx(chi2.isf(1e-6, 5) / 5, rel=2e-3)
    assert plain[0] < overlapped < plain[-1]


@pytest.mark.parametrize(("n", "lasting"), [(4, 2), (5, 1), (3, 2)])
def test_limit_with_lasting_components_matches_numerical_integration(n: int, lasting: int) -> None:
    """P(both over) = integral of the lasting part's density times the chance that both others fill up to the limit."""
    limit = n * jump_limit(n, lasting, 1e4, DetectionSettings(rate=1e-4, overlap=0.0, hold=2))
    free = n - lasting
    below = quad(lambda x: chi2.pdf(x, lasting) * chi2.sf(limit - x, free) ** 2, 0, limit, epsabs=1e-12, limit=200)[0]
    assert below + chi2.sf(limit, lasting) == pytest.approx(1e-4, rel=0.03)  # 0.2 % of the limit


def test_limits_are_extrapolated_beyond_the_table() -> None:
    """Distances of 245 and more, where logarithms of rates are straight to 1 %."""
    for rate in (1e-52, 1e-60):
        found = jump_limit(5, 0, 1e4, DetectionSettings(rate=rate, overlap=0.0, hold=1))
        assert found == pytest.approx(chi2.isf(rate, 5) / 5, rel=2e-3)


def test_limit_for_three_windows_uses_the_cube_root_of_the_rate() -> None:
    found = jump_limit(5, 0, 1e4, DetectionSettings(rate=1e-6, overlap=0.0, hold=3))
    assert found == pytest.approx(chi2.isf(1e-2, 5) / 5, rel=2e-3)


@pytest.mark.parametrize(("overlap", "weight"), [(0.0, 0.2), (0.5, 0.2), (0.75, 0.05)])
def test_variance_and_crossing_rate_of_averages_match_simulation(overlap: float, weight: float) -> None:
    """Windows as means over quarters of their length; 4e5 values: variance within 3 %, crossings within 10 %."""
    random, p, rate = np.random.default_rng(4), 4, 2e-3
    step = round(4 * (1 - overlap))
    quarters = random.standard_normal((4000, step * 120 + 4, p))
    windows = np.stack([quarters[:, k * step : k * step + 4].sum(1) / 2 for k in range(120)], axis=1)
    assert np.mean(windows[:, :-1] * windows[:, 1:]) == pytest.approx(overlapping(overlap, 1), abs=0.01)
    variance = averaged(weight, overlap)[0]
    limit = drift_limit(p, 1e4, weight, DetectionSettings(rate=rate, overlap=overlap, hold=2)) * p * variance
    average = np.sqrt(variance) * random.standard_normal((4000, p))
    distances = []
    for k in range(120):
        average = (1 - weight) * average + weight * windows[:, k]
        distances.append((average**2).sum(-1))
    settled = np.array(distances[int(2 / weight) :])
    assert settled.mean() / p == pytest.approx(variance, rel=0.03)
    crossings = np.mean((settled[1:] > limit) & (settled[:-1] <= limit))
    print(f"seed 4, {crossings:.2e} crossings a window where {rate:.2e} are stated")
    assert crossings == pytest.approx(rate, rel=0.1)


def test_outliers_of_independent_modes_are_reduced_separately() -> None:
    random = np.random.default_rng(5)
    std, freedom = random.uniform(0.5, 2.0, 6), np.array(4.0)
    deviation = std * random.standard_t(4, (50, 6))
    deviation[random.random(deviation.shape) < 0.1] = np.nan
    covariance = np.broadcast_to(np.diag(std**2), (50, 6, 6))
    expected = std * normal_score(deviation / std, freedom)
    np.testing.assert_allclose(tamed(deviation, covariance, freedom), expected, rtol=1e-9)


def test_outlier_is_recognized_relative_to_correlated_modes() -> None:
    """All modes move by thirty deviations together; one is eight off, and costs as much as one such value."""
    common = np.linspace(0.5, 1.5, 6)
    covariance = np.eye(6) + 900 * np.outer(common, common)
    deviation = 20 * common
    before = distance(deviation, covariance)[0]
    deviation[2] += 8
    freedom = np.array(4.0)
    after = distance(tamed(deviation, covariance, freedom), covariance)[0]
    assert distance(deviation, covariance)[0] > before + 40
    assert after < before + 1.1 * normal_score(np.array(8.0), freedom) ** 2


def test_outlier_of_one_mode_does_not_affect_the_others() -> None:
    """Sixty deviations of one mode, where modes move together by four times the variance of each by itself."""
    common = np.linspace(0.4, 1.0, 6)
    covariance = np.eye(6) + 4 * np.outer(common, common)
    deviation = np.zeros(6)
    deviation[5] = 60
    for freedom in (3.0, 8.0, 24.0):
        left = tamed(deviation, covariance, np.array(freedom))
        others = distance(left[:5], covariance[:5, :5])[0]
        print(f"tail {freedom:g}: squared distance of the others {others:.2f}")
        assert others < 1


def test_normal_scores_match_the_tail_probability_of_deviations() -> None:
    """Wallace's approximation: 2 % small at five degrees of freedom, the safe side, and less with more."""
    chance = np.geomspace(1e-6, 0.4, 30)
    for freedom in (5.0, 8.0, 100.0):
        unit = t.isf(chance, freedom) * np.sqrt((freedom - 2) / freedom)
        scores = normal_score(-unit, np.array(freedom))
        np.testing.assert_allclose(scores, norm.ppf(chance), rtol=0.02, atol=0.01)
