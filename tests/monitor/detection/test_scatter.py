"""Scatter that follows the wind is no change, whether stated deviations follow it or not."""

import numpy as np
import pytest
from scipy.stats import poisson

from daq import FloatArray
from monitor.detection import CHUNK, DETECTORS, DetectionSettings, LawState, ScoredWindows, accept, judge, start
from monitor.detection.window_variance import first_scatter, follow_scatter, regressors
from tests.examiner.sites import SimulatedSites, SiteKind, SiteWindows
from tests.support.thorough import few_of

STEP, DAY = 600.0, 144
YEARLY = DetectionSettings(rate=1 / 52596 / len(DETECTORS), overlap=0.0, hold=2)


def log_frequency(sites: SimulatedSites, w: SiteWindows) -> tuple[FloatArray, FloatArray]:
    return np.log(w.frequency / sites.frequency[:, None, :]), w.frequency_std / w.frequency


def learnt(sites: SimulatedSites) -> LawState:
    w = sites.windows(DAY)
    y, std = log_frequency(sites, w)
    return start(y, std, w.temperature, np.full(DAY, STEP), YEARLY, w.rms)


def watch(sites: SimulatedSites, watched: LawState, n: int) -> tuple[list[ScoredWindows], LawState]:
    found = []
    for _ in range(n // CHUNK):
        w = sites.windows(CHUNK)
        y, std = log_frequency(sites, w)
        judged, watched = judge(watched, y, w.temperature, np.full(CHUNK, STEP), std, w.rms)
        taught = np.where(judged.over[..., None], np.nan, judged.teaching)
        watched = accept(watched, judged.terms, taught, judged.variance)
        found.append(judged)
    return found, watched


@pytest.mark.parametrize(
    ("factor", "stated", "days"), few_of([(4.0, False, 4), (4.0, False, 8), (2.0, False, 8), (4.0, True, 8)])
)
def test_wind_dependent_scatter_keeps_the_false_alarm_rate(factor: float, stated: bool, days: int) -> None:
    """Twelve sites at 1.5 per year are 0.2 or 0.4: Poisson bound at 1e-3. A mean variance gives six per day."""
    kind = SiteKind(name="windy", wind=factor, wind_stated=stated)
    sites, n = SimulatedSites(kind, 12, seed=11), days * DAY
    found, _ = watch(sites, learnt(sites), n)
    over = np.concatenate([judged.over for judged in found], axis=-1)
    alarms = int((over[:, 1:-1] & over[:, 2:] & ~over[:, :-2]).sum())
    print(f"seed 11, x{factor:g}, {'stated' if stated else 'not stated'}: {alarms} alarms in {12 * days} days")
    assert alarms <= poisson.ppf(1 - 1e-3, 1.5 * 12 * days / 365)


@pytest.mark.parametrize("seed", few_of([1, 2]))
def test_varying_variance_is_predicted_within_30_percent(seed: int) -> None:
    """The RMS follows the wind by an unknown power, and traffic, too, which the scatter does not follow."""
    sites = SimulatedSites(SiteKind(name="windy", wind=4.0, slope=(0.0, 0.0)), 20, seed)
    w = sites.windows(10 * DAY)
    y, std = log_frequency(sites, w)
    x = regressors(std, sites.stated, w.rms)
    n = y.shape[-1]
    state = first_scatter(x[:, :DAY], n, np.ones(20), 1)
    found, _ = follow_scatter(state, y / sites.stated[:, None, :], x, np.full(10 * DAY, STEP))
    error = np.log(found.variance) - 2 * np.log(w.scatter)
    late = slice(DAY, None)
    true = 2 * np.log(w.scatter[:, late])
    print(f"seed {seed}: log variance off by {error[:, late].std():.2f}, itself {true.std():.2f}")
    assert error[:, late].std() < 0.3 < 0.5 * true.std()


def test_variance_of_constant_scatter_is_estimated_accurately() -> None:
    sites = SimulatedSites(SiteKind(name="steady", slope=(0.0, 0.0)), 20, seed=3)
    w = sites.windows(10 * DAY)
    y, std = log_frequency(sites, w)
    x = regressors(std, sites.stated, w.rms)
    state = first_scatter(x[:, :DAY], y.shape[-1], np.ones(20), 1)
    found, _ = follow_scatter(state, y / sites.stated[:, None, :], x, np.full(10 * DAY, STEP))
    error = np.log(found.variance[:, -DAY:])
    off, stated = np.sqrt((error**2).mean()), found.log_variance[:, -DAY:].mean()
    print(f"seed 3: log variance off by {off:.3f}, stated {stated:.4f}")
    assert off < 0.15
    assert stated < 0.05


def test_single_structural_change_barely_increases_predicted_variance() -> None:
    """Ten deviations of all modes at once: the variance predicted for the next window grows by less than a half."""
    random = np.random.default_rng(4)
    y = random.standard_normal((20, 5 * DAY, 6))
    x = np.full((20, 5 * DAY, 2), np.nan)
    state = first_scatter(x, 6, np.ones(20), 1)
    _, state = follow_scatter(state, y, x, np.full(5 * DAY, STEP))
    after, _ = follow_scatter(state, random.standard_normal((20, 2, 6)) + 10, x[:, :2], np.full(2, STEP))
    grown = np.median(after.variance[:, 1] / after.variance[:, 0])
    print(f"seed 4: variance grows by a factor of {grown:.2f}")
    assert grown < 1.5
