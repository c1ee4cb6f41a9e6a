"""Rates of slow trends and their standard deviations, on simulated sites that share nothing with the estimator."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from daq import FloatArray
from monitor.detection.correlated_noise import effective_number, regress
from monitor.detection.temperature_terms import first_climate, follow, terms
from monitor.detection.trend import (
    NO_TREND,
    SIGNIFICANT,
    Trend,
    add_windows,
    follow_trend,
    next_state,
    no_weeks,
    trend_of,
)
from tests.examiner.sites import KINDS, SimulatedSites
from tests.support.thorough import few_of

STEP, N_SITES, WEEK_WINDOWS = 3 * 3600.0, 8, 56
STEP_UP = 0.01  # of all log frequencies, by an accepted change


def trends(name: str, drift: float, weeks: int, seed: int, changed: int = 0) -> list[Trend]:
    """Return the trends of sites of a kind after so many weeks; an accepted change comes `changed` weeks before."""
    kind = replace(next(k for k in KINDS if k.name == name), drift=drift, step=STEP)
    sites = SimulatedSites(kind, N_SITES, seed)
    weekly, climate, last = no_weeks((N_SITES,), kind.n_modes), None, 0.0
    for week in range(weeks):
        if changed and week == weeks - changed:
            weekly = next_state(weekly)
            sites.damage(STEP_UP)
        w = sites.windows(WEEK_WINDOWS)
        climate = climate or first_climate(w.temperature)
        temperatures, climate = follow(climate, w.temperature, np.diff(w.time, prepend=last))
        last = float(w.time[-1])
        y = np.log(w.frequency / sites.frequency[:, None, :])
        known = terms(temperatures)[..., 0, :]
        weekly = add_windows(weekly, w.time, known, y, y)
    found = []
    for i in range(N_SITES):
        one = replace(
            weekly,
            count=weekly.count[i],
            total=weekly.total[i],
            n_terms=weekly.n_terms[i],
            terms=weekly.terms[i],
        )
        trend = trend_of(one)
        assert trend is not None
        found.append(trend)
    return found


@pytest.mark.parametrize(
    ("name", "largest_std"),
    few_of([("badly placed thermometer", 3e-4), ("bridge, hourly", 6e-4)]),
)
def test_drift_rate_is_estimated_within_its_standard_deviation(name: str, largest_std: float) -> None:
    """0.2 % per year for 56 weeks: at least as often within two deviations as 95 % let expect, and significant."""
    found = trends(name, -2e-3, 56, seed=7)
    z = np.array([(t.common_rate + 2e-3) / t.common_std for t in found])
    each = np.concatenate([(t.rate + 2e-3) / t.std for t in found])
    std = np.median([t.common_std for t in found])
    within, each_within = (np.abs(z) < 1.96).sum(), (np.abs(each) < 1.96).mean()
    print(f"seed 7, {name}: {within}/{N_SITES}, modes {each_within:.2f}, std {1e2 * std:.3f} % per year")
    assert within >= binom.ppf(1e-3, N_SITES, 0.95)
    assert each_within > 0.9
    assert std < largest_std
    assert all(t.score > SIGNIFICANT for t in found)


def test_accepted_change_is_no_trend() -> None:
    found = trends("quiet", 0.0, 30, seed=9, changed=10)
    print(f"seed 9: scores up to {max(t.score for t in found):.1f}")
    assert all(t.score < SIGNIFICANT for t in found)


@pytest.mark.parametrize("constant", [0.01, 6.0])
def test_standard_deviation_is_correct_for_autocorrelated_errors(constant: float) -> None:
    """Errors of an autoregressive process over 52 weeks, its time constant given in weeks: 95 % of 100 draws."""
    random, n = np.random.default_rng(10), 52
    time = np.arange(n, dtype=float)
    x = np.column_stack([time - time.mean(), np.ones(n)])
    z = []
    for _ in range(100):
        y = autoregressive(random, n, constant) + 0.5 * random.standard_normal(n)
        found = regress(y, x, np.array([1e3, 1e3]), time, (1.5, 5.0, 15.0, 50.0, 150.0))
        z.append(found.coefficient[0] / found.std[0])
    within = int((np.abs(z) < 1.96).sum())
    print(f"seed 10, {constant} weeks: {within} of 100 within 1.96 deviations")
    assert within >= binom.ppf(1e-3, 100, 0.95)


def test_trend_is_reported_only_at_start_change_and_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scores that hover about the threshold report once."""
    scores = [1.0, 3.9, 4.2, 3.5, 4.5, 2.5, 4.1, 1.0, 1.5, 4.2, 20.0]
    reported, watch, weekly = [], NO_TREND, no_weeks((), 2)
    for week, score in enumerate(scores):
        found = Trend(rate=np.zeros(2), std=np.ones(2), common_rate=score, common_std=1.0, seconds=1.0)
        monkeypatch.setattr("monitor.detection.trend.trend_of", lambda _weekly, found=found: found)
        weekly = replace(weekly, week=np.append(weekly.week, week))
        for _ in range(2):  # within a week it is estimated once
            watch, new = follow_trend(watch, weekly)
            if new:
                reported.append((week, None if watch.present is None else watch.present.common_rate))
    assert reported == [(2, 4.2), (7, None), (9, 4.2), (10, 20.0)]


def autoregressive(random: np.random.Generator, n: int, constant: float) -> FloatArray:
    """Return a stationary series of unit variance."""
    kept, value = np.exp(-1 / constant), float(random.standard_normal())
    out = np.empty(n)
    for i in range(n):
        value = kept * value + np.sqrt(1 - kept**2) * float(random.standard_normal())
        out[i] = value
    return out


def test_effective_number_of_values_matches_theory() -> None:
    """Of 200 values of a process of first order with rho = exp(-1/5): n (1 - rho) / (1 + rho)."""
    random, n, constant = np.random.default_rng(11), 200, 5.0
    time, rho = np.arange(n, dtype=float), np.exp(-1 / constant)
    found = [
        effective_number(
            np.column_stack([autoregressive(random, n, constant) for _ in range(4)]),
            np.ones((n, 1)),
            np.array([1e3]),
            time,
            (1.0, 5.0, 25.0),
        )
        for _ in range(10)
    ]
    expected = n * (1 - rho) / (1 + rho)
    print(f"seed 11: {np.median(found):.1f}, expected {expected:.1f}")
    assert 0.6 * expected < np.median(found) < 1.5 * expected
