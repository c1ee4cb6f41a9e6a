"""A thermometer that is silent: the last reading is carried on, less and less certain, and no alarm comes of it."""

import numpy as np
import pytest
from scipy.stats import poisson

from daq import FloatArray
from monitor.detection import DETECTORS, DetectionSettings, LawState, ScoredWindows, accept, judge, least_unsure, start
from monitor.detection.temperature_terms import first_climate, follow
from tests.support.thorough import few_of

P, STD, STEP, DAY = 6, 5e-4, 600.0, 144
YEARLY = DetectionSettings(rate=1 / 52596 / len(DETECTORS), overlap=0.0, hold=2)


def air(random: np.random.Generator, n_sites: int, n: int) -> FloatArray:
    """A day's cycle of 2 to 7 K of amplitude about a mean of 0 to 20 degC, and fronts of 3 K that last two days."""
    cycle = random.uniform(2, 7, (n_sites, 1)) * np.sin(2 * np.pi * (np.arange(n) / DAY + random.random((n_sites, 1))))
    front, kept = np.zeros((n_sites, n)), np.exp(-1 / (2 * DAY))
    for k in range(1, n):
        front[:, k] = kept * front[:, k - 1] + 3 * np.sqrt(1 - kept**2) * random.standard_normal(n_sites)
    return random.uniform(0, 20, (n_sites, 1)) + cycle + front


def frequencies(random: np.random.Generator, celsius: FloatArray) -> FloatArray:
    slope = -2e-4 * (1 + 0.2 * random.standard_normal((len(celsius), 1, P)))
    return slope * celsius[..., None] + STD * random.standard_normal((*celsius.shape, P))


def seconds(n: int) -> FloatArray:
    return np.full(n, STEP)


@pytest.mark.parametrize(
    ("seed", "hours", "n_sites"), few_of([(1, 6, 24), (1, 6, 200), (2, 30, 200), (1, 30, 200), (2, 6, 200)])
)
def test_thermometer_outage_raises_no_alarm_during_or_afterwards(seed: int, hours: int, n_sites: int) -> None:
    """An outage a site at 0 to 20 degC; four days of each at one false alarm per year: Poisson bound at 1e-4."""
    random, n, silent = np.random.default_rng(seed), 5 * DAY, slice(2 * DAY, 2 * DAY + 6 * hours)
    celsius = air(random, n_sites, n)
    y = frequencies(random, celsius)
    reading = celsius.copy()
    reading[:, silent] = np.nan
    stated = np.full(y.shape, STD)
    watched = start(y[:, :DAY], stated[:, :DAY], reading[:, :DAY], seconds(DAY), YEARLY)
    judged, watched = judge(watched, y[:, DAY:], reading[:, DAY:], seconds(n - DAY))
    over = judged.over
    alarmed = int((over[:, 1:] & over[:, :-1]).any(-1).sum())
    print(f"seed {seed}: {alarmed} of {n_sites} outages of {hours} h raise an alarm")
    assert alarmed <= poisson.ppf(1 - 1e-4, n_sites * 4 / 365)


def watched_and_silent(hours: float) -> tuple[LawState, ScoredWindows]:
    random = np.random.default_rng(5)
    celsius = air(random, 1, 8 * DAY)
    y = frequencies(random, celsius)[0]
    watched = start(y[:DAY], np.full((DAY, P), STD), celsius[0, :DAY], seconds(DAY), YEARLY)
    for k in range(1, 7):
        day = slice(k * DAY, (k + 1) * DAY)
        judged, watched = judge(watched, y[day], celsius[0, day], seconds(DAY))
        watched = accept(watched, judged.terms, judged.teaching)
    n = round(6 * hours)
    judged, watched = judge(watched, y[7 * DAY : 7 * DAY + n], np.full(n, np.nan), seconds(n))
    return watched, judged


def test_structural_change_is_detectable_during_a_thermometer_outage() -> None:
    watched, judged = watched_and_silent(6)
    law = watched.law
    predicted = law.centre + law.scale * (judged.terms[-1:, 0, :] @ law.coefficient)
    alternating, _ = judge(watched, predicted + 3e-3 * (-1.0) ** np.arange(P), np.full(1, np.nan), seconds(1))
    assert alternating.over.all()
    last = ScoredWindows(
        value=judged.value[:, -1:],
        limit=judged.limit[:, -1:],
        terms=judged.terms[-1:],
        whitened=judged.whitened[-1:],
        variance=judged.variance[-1:],
        age=judged.age[-1:],
        carried=judged.carried[-1:],
        waiting=judged.waiting[-1:],
    )
    least = least_unsure(watched, last)
    assert least is not None
    print(f"after six silent hours {100 * least:.2f} % of all modes alike could be found")
    assert 2e-4 * 3 < least < 2e-4 * 80  # of steel, by 3 to 80 K: an order of magnitude


def test_windows_without_a_temperature_reading_are_not_learned() -> None:
    judged = watched_and_silent(12)[1]
    assert not judged.carried[0]  # of 10 minutes
    assert judged.carried[18:].all()
    assert np.isnan(judged.teaching[18:]).all()


def test_temperature_in_a_gap_is_interpolated_linearly_afterwards() -> None:
    """A rise of 0.5 K per hour, silent for nine hours: the structures of three inertias lie behind it by theirs."""
    n = 60 * DAY
    rise = 5 + 0.5 / 6 * np.arange(n) / 10
    gap = rise.copy()
    gap[-60:-6] = np.nan
    whole, _ = follow(first_climate(rise), rise, seconds(n))
    found, _ = follow(first_climate(gap), gap, seconds(n))
    np.testing.assert_allclose(found.lagged[-6:], whole.lagged[-6:], atol=1e-9)
    assert found.lagged_std[-6:].max() > 0.1
    assert found.air_std[-7] > found.air_std[-30] > found.air_std[-61] == 0


def test_uncertainty_of_a_held_reading_matches_temperature_changes() -> None:
    """50 sites: the change within 3, 6, and 12 hours over its deviation has a mean square of one in the median."""
    random = np.random.default_rng(7)
    celsius = air(random, 50, 30 * DAY)
    _, climate = follow(first_climate(celsius[:, : 10 * DAY]), celsius[:, : 10 * DAY], seconds(10 * DAY))
    later = celsius[:, 10 * DAY :]
    for hours in (3, 6, 12):
        moved = later[:, 6 * hours :] - later[:, : -6 * hours]
        ratio = (moved**2).mean(-1) / climate.change_std(np.full(50, hours * 3600.0)) ** 2
        print(f"seed 7, {hours} h: mean square {np.median(ratio):.2f} ({ratio.min():.2f} to {ratio.max():.2f})")
        assert 0.3 < np.median(ratio) < 1.5
