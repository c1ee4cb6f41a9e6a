"""Parts of the law of temperature: evidence of slow movements, of frost and of the thermometer, tails, chance."""

from dataclasses import replace

import numpy as np
import pytest

from monitor.detection import CHUNK, DetectionSettings, LawState, accept, judge, start
from monitor.detection import detectors as detectors_module
from monitor.detection import temperature_law as law_module
from monitor.detection.detectors import WEIGHTS
from monitor.detection.temperature_terms import THERMOMETER_STD
from monitor.detection.window_variance import Scatter
from tests.support.thorough import few_of

P, STD, STEP, DAY = 8, 5e-4, 600.0, 144
WATCHING = DetectionSettings(rate=1e-4, overlap=0.0, hold=2)


def state(celsius: np.ndarray, slope: float, *, off: float = 0.0, seed: int = 1) -> LawState:
    """Return what is learned from windows at temperatures, by a thermometer that is wrong for hours at a time [K]."""
    random = np.random.default_rng(seed)
    n = len(celsius)
    error = np.repeat(off * random.standard_normal(-(-n // CHUNK)), CHUNK)[:n]
    y = slope * (celsius + error)[:, None] + STD * random.standard_normal((n, P))
    return start(y, np.full(y.shape, STD), celsius, np.full(n, STEP), WATCHING)


def days(n: int, mean: float = 15.0, swing: float = 5.0) -> np.ndarray:
    """Return temperatures of days, whose means differ [degC]."""
    t = np.arange(n * DAY) / DAY
    return np.asarray(mean + swing * np.sin(2 * np.pi * t) + 3 * np.sin(2 * np.pi * t / 5.3))


@pytest.mark.parametrize("off", few_of([0.0, 0.4, 0.8], 2))
def test_thermometer_error_is_estimated_from_means_over_hours(off: float) -> None:
    """Half of the modes' deviation per kelvin; 24 days give 144 means, so that a deviation is known to 6 %."""
    found = float(state(days(24), -3e-4, off=off).law.thermometer)
    print(f"seed 1: {found:.2f} K where the thermometer is off by {off} K")
    assert found == pytest.approx(off, rel=0.3) if off else found < 0.25


def test_thermometer_error_keeps_its_prior_with_few_means() -> None:
    """They are fitted by the law: two days leave the prior, whatever the residuals are."""
    assert float(state(days(1), -3e-4, off=0.8).law.thermometer) == pytest.approx(THERMOMETER_STD, rel=0.1)


def test_frost_variance_equals_the_sum_over_its_regressors() -> None:
    """The sum over the common direction and those across it is the sum of squares; the law's own variance comes on."""
    watched = state(days(6, mean=-1.0), -2e-4)
    judged, _ = judge(watched, np.zeros((DAY, P)), days(1, mean=-4.0), np.full(DAY, STEP))
    law, terms = watched.law, judged.terms
    moved = law.by_temperature(terms)[..., 2:, :]
    assert np.abs(moved).max() > 0.5  # in deviations of a window
    exact = replace(law, unknown=np.zeros_like(law.unknown))
    along, across = np.moveaxis(exact.freezing(terms), -1, 0)
    assert along + (P - 1) * across == pytest.approx((moved**2).sum((-1, -2)))
    assert along == pytest.approx(((moved @ law.common) ** 2).sum(-1))
    assert (law.freezing(terms)[..., 0] >= along).all()


def test_own_share_of_variance_falls_with_frost_and_rises_with_error() -> None:
    watched = state(days(6, mean=-1.0), -2e-4)
    cold = judge(watched, np.zeros((DAY, P)), days(1, mean=-4.0), np.full(DAY, STEP))[0].terms
    warm = judge(watched, np.zeros((DAY, P)), days(1, mean=15.0), np.full(DAY, STEP))[0].terms
    law = replace(watched.law, unknown=np.zeros_like(watched.law.unknown))
    share = law_module._own_share(law, cold, np.ones(DAY))
    frost = (law.by_temperature(cold)[..., 2:, :] ** 2).sum((-1, -2)) / P
    assert share == pytest.approx(law.fast / (law.fast + frost))
    assert (law_module._own_share(law, cold, np.full(DAY, 4.0)) > share).all()
    assert law_module._own_share(law, warm, np.ones(DAY)) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize(("n", "p"), [(12, 4), (40, 8), (400, 8)])
def test_dominant_direction_is_kept_above_the_one_percent_noise_level(n: int, p: int) -> None:
    """Johnstone's mean and deviation of the largest eigenvalue of n values of white noise, with its 99 % quantile."""
    mean = (np.sqrt(n - 1) + np.sqrt(p)) ** 2
    deviation = (np.sqrt(n - 1) + np.sqrt(p)) * ((n - 1) ** -0.5 + p**-0.5) ** (1 / 3)
    chance = (mean + 2.02 * deviation) / n
    for factor, kept in ((0.999, False), (1.001, True)):
        covariance = 3.0 * np.diag([factor * chance, *np.ones(p - 1)])
        found = law_module._dominant(covariance, np.array(float(n)), np.array(3.0))
        assert found[0, 0] == pytest.approx(3.0 * (factor * chance - 1) if kept else 0.0, abs=1e-9)
    random = np.random.default_rng(n)
    values = random.standard_normal((2000, n, p))
    noise = np.swapaxes(values, 1, 2) @ values / n
    share = (law_module._dominant(noise, np.full(2000, float(n)), np.ones(2000)) != 0).any((1, 2)).mean()
    print(f"seed {n}: {100 * share:.1f} % of {n} values of noise in {p} directions")
    assert share < 0.03


def test_heavier_tails_are_less_probable_and_absent_at_start() -> None:
    assert (np.diff(law_module._TAILS_PRIOR) > 0).all()
    blank = law_module._blank(np.zeros(P), np.full(P, STD), np.array(True), STEP)
    assert float(blank.tail) == law_module._TAILS[-1]


@pytest.mark.parametrize(("overlap", "windows"), [(0.0, 1), (0.5, 2), (0.75, 4), (0.8, 5), (0.9, 10)])
def test_lag_to_the_next_window_without_shared_samples(overlap: float, windows: int) -> None:
    assert detectors_module._lag(replace(WATCHING, overlap=overlap)) == windows


def test_single_mode_is_reported_only_if_all_exceeding_detectors_agree() -> None:
    """Cases by column; the rows are the three detectors."""
    over = np.array([[1, 0, 1, 1, 0, 1, 0], [1, 0, 0, 1, 0, 1, 0], [1, 1, 0, 0, 0, 1, 1]], bool)
    single = np.array([[1, 0, 0, 1, 1, 1, 0], [1, 0, 1, 1, 1, 1, 0], [1, 1, 1, 0, 1, 1, 1]], bool)
    mode = np.array([[3, 5, 2, 4, 1, 0, 5], [3, 5, 2, 6, 1, 0, 5], [3, 7, 2, 4, 1, 0, 0]])
    assert detectors_module._single(over, single, mode).tolist() == [3, 7, -1, -1, -1, 0, 0]


def test_limits_of_averages_weight_the_uncertainty_of_window_variance() -> None:
    """Of an average with weight w a window has w^2 of the variance, all windows have w / (2 - w)."""
    law = replace(state(days(1), -2e-4).law, freedom=np.array(1e12))
    freedom = 12.0  # of the variance of a window, that of whose logarithm is twice its inverse
    scatter = Scatter(variance=np.ones(1), log_variance=np.full(1, 2 / freedom))
    _, drifts = detectors_module._limits(law, scatter, WATCHING)
    for column, weight in enumerate(WEIGHTS):
        share = weight**2 / (weight / (2 - weight))
        expected = detectors_module._table(P, np.array([freedom / share]), WATCHING)[0, column - len(WEIGHTS)]
        assert drifts[0, column] == expected
    shares = [weight * (2 - weight) for weight in WEIGHTS]
    tables = [detectors_module._table(P, np.array([freedom / share]), WATCHING)[0] for share in shares]
    assert len({tuple(table) for table in tables}) == len(WEIGHTS)


def test_weekly_means_are_log_frequencies_relative_to_the_centre() -> None:
    watched = state(days(2), -2e-4)
    judged, _ = judge(watched, np.log1p(np.full((CHUNK, P), 4e-4)), np.full(CHUNK, 15.0), np.full(CHUNK, STEP))
    after = accept(watched, judged.terms, judged.teaching, judged.variance, age=np.full(CHUNK, 3.5 * 86400))
    known = after.weekly.count[-1] > 0
    assert known.any()
    mean = (after.weekly.total / np.maximum(after.weekly.count, 1))[-1]
    assert mean[known] == pytest.approx((np.log1p(4e-4) - watched.law.centre)[known], rel=1e-6)
