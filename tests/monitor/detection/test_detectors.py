"""Detectors hold their rate, find what is small and stays, and are not fooled by temperature or wild values."""

import numpy as np
import pytest
from scipy.stats import poisson

from daq import FloatArray
from monitor.detection import CHUNK, DETECTORS, GUARD, Judged, Watched, Watching, accept, judge, start

P, STD, STEP = 8, 5e-4, 600.0
DAY = 144  # windows
PER_WINDOW = 2e-4  # false alarms of each detector: some hundred a run
WATCHING = Watching(rate=PER_WINDOW, overlap=0.0, hold=2)
YEARLY = Watching(rate=1 / 52596 / len(DETECTORS), overlap=0.0, hold=2)


def seconds(n: int) -> FloatArray:
    return np.full(n, STEP)


def started(y: FloatArray, temperature: FloatArray, watching: Watching = YEARLY) -> Watched:
    return start(y, np.full(y.shape, STD), temperature, seconds(y.shape[-2]), watching)


def count(judged: list[Judged]) -> FloatArray:
    """False alarms of each detector: pairs of windows for jumps, beginnings for drifts."""
    over = np.concatenate([j.value > j.limit for j in judged], axis=-1)
    jumps = (over[0][:, 1:] & over[0][:, :-1]).sum()
    return np.array([jumps, *((over[i][:, 1:] & ~over[i][:, :-1]).sum() for i in (1, 2))])


@pytest.mark.parametrize("n_baseline", [12, DAY])
@pytest.mark.parametrize("factor", [0.7, 1.6])
def test_no_detector_alarms_more_often_than_stated_whatever_windows_claim(n_baseline: int, factor: float) -> None:
    """Gaussian windows whose real deviation is `factor` times the stated; upper Poisson bound at 1e-4."""
    random, n_sites, n_chunks = np.random.default_rng(3), 150, 25

    def windows(n: int) -> FloatArray:
        return factor * STD * random.standard_normal((n_sites, n, P))

    warm = np.full((n_sites, n_baseline), 20.0)
    watched = started(windows(n_baseline), warm, WATCHING)
    judged: list[Judged] = []
    for _ in range(n_chunks):
        judged.append((found := judge(watched, windows(CHUNK), warm[:, :1].repeat(CHUNK, 1), seconds(CHUNK)))[0])
        watched = found[1]
        if len(judged) > GUARD // CHUNK:
            old = judged[-1 - GUARD // CHUNK]
            watched = accept(watched, old.terms, old.whitened)
    expected = PER_WINDOW * n_sites * n_chunks * CHUNK
    print(f"seed 3, {count(judged)} false alarms where {expected:.0f} are stated")
    assert np.all(count(judged) <= poisson.ppf(1 - 1e-4, expected))
    assert count(judged)[0] >= 0.4 * expected  # and is not deaf: scores of short baselines give away half at most


def test_a_shift_of_one_deviation_that_stays_is_found_within_a_quarter_of_a_day() -> None:
    """All modes by their own deviation, which no single window shows.

    The quick average of eight modes has T2/p = 9 once settled (variance 1/9 of a window's) against a limit of 5, and
    is half way there in three windows; a quarter of a day is 36.
    """
    random = np.random.default_rng(5)
    warm = np.full(DAY, 20.0)
    watched = started(STD * random.standard_normal((DAY, P)), warm)
    shifted = STD * (1 + random.standard_normal((36, P)))
    judged, _ = judge(watched, shifted, warm[:36], seconds(36))
    assert judged.value[1, -1] > judged.limit[1, -1]
    calm, _ = judge(watched, shifted - STD, warm[:36], seconds(36))
    assert not calm.over.any()


def test_temperature_is_taken_out_where_seen_and_allowed_for_where_not() -> None:
    """-2e-4 per kelvin (steel, the modulus): 5 K seen in a day, then 30 K colder, which must not be an alarm."""
    random = np.random.default_rng(6)
    temperature = 15 + 5 * np.sin(2 * np.pi * np.arange(3 * DAY) / DAY)

    def windows(celsius: FloatArray) -> FloatArray:
        return -2e-4 * celsius[:, None] + STD * random.standard_normal((len(celsius), P))

    watched = started(windows(temperature), temperature)
    next_day, watched = judge(watched, windows(temperature[:DAY]), temperature[:DAY], seconds(DAY))
    assert not next_day.over.any()
    changed, _ = judge(watched, windows(temperature[:12]) - 4 * STD, temperature[:12], seconds(12))
    assert changed.over.all()
    fall = np.linspace(15, -15, 2 * DAY)
    cold, watched = judge(watched, windows(fall), fall, seconds(len(fall)))
    assert not cold.over.any()
    ratio = cold.value[0, -1] / cold.limit[0, -1]
    known = accept(watched, cold.terms, cold.whitened)
    again, _ = judge(known, windows(np.full(36, -15.0)) - 4 * STD, np.full(36, -15.0), seconds(36))
    print(f"seed 6, unchanged at -15 degC: {ratio:.2f} of the limit")
    assert again.over[6:].all()  # once the cold has been seen, changes show in it too


def test_without_thermometers_what_all_modes_do_alike_is_no_alarm_but_what_one_does_is() -> None:
    random = np.random.default_rng(7)
    unknown = np.full(DAY, np.nan)
    watched = started(STD * random.standard_normal((DAY, P)), unknown)
    noise = STD * random.standard_normal((36, P))
    alike, _ = judge(watched, noise + 3e-3, unknown[:36], seconds(36))
    assert not alike.over.any()
    own, _ = judge(watched, noise + 3e-3 * np.eye(P)[2], unknown[:36], seconds(36))
    assert own.over.mean() > 0.9  # six deviations of one mode of eight


def test_wild_values_and_missing_modes_neither_spoil_the_baseline_nor_alarm() -> None:
    random = np.random.default_rng(8)
    warm = np.full(DAY, 20.0)
    y = STD * random.standard_normal((DAY, P))
    y[random.random(y.shape) < 0.1] = np.nan
    y[random.choice(DAY, 7, replace=False)] += 0.02  # a lorry's load, 5 % of the windows
    watched = started(y, warm)
    assert watched.law.fast == pytest.approx(1.0, rel=0.35)
    windows = STD * random.standard_normal((36, P))
    windows[10, 3] = 0.03
    windows[20:24] = np.nan
    judged, _ = judge(watched, windows, warm[:36], seconds(36))
    assert not judged.over[11:].any()
    assert np.array_equal(judged.value[0, 20:24], np.zeros(4))


def test_windows_one_by_one_are_judged_as_many_at_once() -> None:
    random = np.random.default_rng(9)
    temperature = 15 + random.standard_normal(DAY).cumsum() / 10
    watched = started(STD * random.standard_normal((DAY, P)), temperature)
    y = STD * random.standard_normal((12, P))
    whole, _ = judge(watched, y, temperature[:12], seconds(12))
    for k in range(12):
        one, watched = judge(watched, y[k : k + 1], temperature[k : k + 1], seconds(1))
        np.testing.assert_allclose(one.value[:, 0], whole.value[:, k], rtol=1e-9)
