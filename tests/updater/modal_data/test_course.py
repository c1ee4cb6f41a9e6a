"""Courses of changes within a record, on simulated sites that share nothing with the test: missed and false ones."""

import numpy as np
import pytest
from scipy.stats import binom

from tests.examiner.sites import KINDS, SimulatedSites
from tests.support.updater.tracked_sites import modes_of, tracked
from updater.modal_data import find_course
from updater.modal_data.states.change_point import FALSE_POSITIVE

N_WINDOWS, N_MODES, STD = 24, 5, 1e-4
COURSES = {
    "gradual": lambda u: u,
    "saturating": lambda u: 1 - np.exp(-4 * u),
    "sudden": lambda u: 1.0 * (u > 0.6),
    "there and back": lambda u: np.sin(2 * np.pi * u),
}


@pytest.mark.parametrize("n_sites", [2, pytest.param(30, marks=pytest.mark.thorough)])
def test_false_courses_are_no_more_frequent_than_stated(n_sites: int) -> None:
    """Eighteen kinds of site: frost, drift, wind, bursts of a wrong pole, thermometers late or absent, loads."""
    found = n = 0
    for kind in KINDS:
        windows = SimulatedSites(kind, n_sites, 31).windows(N_WINDOWS)
        for site in range(n_sites):
            course = find_course(modes_of(windows, site), windows.time, windows.temperature[site], windows.rms[site])
            found += course is not None
            n += 1
    print(f"seed 31: {found} courses found in {n} records of one state")
    assert found <= binom.ppf(1 - 1e-4, n, 2 * FALSE_POSITIVE)  # of two tests, one for steps and one for drifts


@pytest.mark.parametrize("name", COURSES)
def test_course_of_a_change_is_found(name: str) -> None:
    random = np.random.default_rng(32)
    print("seed 32")
    share = COURSES[name]((np.arange(N_WINDOWS) + 0.5) / N_WINDOWS)
    change = np.array([0.0, 4e-3, -2e-3, 1e-3, 6e-3])
    value = np.log([10.0, 12.0, 31.0, 47.0, 60.0]) - np.outer(share, change)
    modes = tracked(value + STD * random.standard_normal(value.shape), np.full(value.shape, STD))
    unknown = np.full(N_WINDOWS, np.nan)
    course = find_course(modes, 120.0 * np.arange(N_WINDOWS, dtype=np.float64), unknown, unknown)
    assert course is not None
    kind = {"saturating": "gradual", "there and back": "irregular"}.get(name, name)
    assert course.kind == kind
    if kind != "irregular":
        first, last = share[course.first].mean(), share[course.last].mean()
        error = (course.share - (share - first) / (last - first)) / course.share_std
        assert np.sqrt(np.mean(error**2)) < 1.5  # one but for the errors of both ends


@pytest.mark.parametrize("n_draws", [60, pytest.param(400, marks=pytest.mark.thorough)])
def test_end_of_a_gradual_change(n_draws: int) -> None:
    """Of 40 windows at most; changes from 4 to 60 standard deviations of a window, that go on or end."""
    random = np.random.default_rng(34)
    print("seed 34")
    goes_on = found = early = ended = 0
    for _ in range(n_draws):
        n, ends = int(random.integers(16, 40)), bool(random.integers(2))
        rise = int(random.integers(8, n - 5)) if ends else n
        size = 1e-4 * np.exp(random.uniform(np.log(4), np.log(60)))
        share = np.minimum((np.arange(n) + 0.5) / rise, 1.0)
        value = np.log([10.0, 12.0, 31.0, 47.0, 60.0]) - size * np.outer(share, random.standard_normal(5))
        modes = tracked(value + STD * random.standard_normal(value.shape), np.full(value.shape, STD))
        unknown = np.full(n, np.nan)
        course = find_course(modes, 120.0 * np.arange(n, dtype=np.float64), unknown, unknown)
        if course is None or course.kind != "gradual":
            continue
        found += ends
        goes_on += not ends
        ended += ends and course.end is not None
        early += course.end is not None and (not ends or course.end < rise - 2)
    print(f"of {goes_on} changes that go on and {found} that end, {ended} are found to end, {early} too early")
    assert early == 0  # at a constant rate such a slope is six standard deviations off
    assert ended > found / 2


def test_drift_of_a_single_mode_or_in_few_windows_is_no_course() -> None:
    random = np.random.default_rng(33)
    print("seed 33")
    value = np.log(np.linspace(10, 60, N_MODES)) + STD * random.standard_normal((N_WINDOWS, N_MODES))
    value[:, 2] += 0.01 * np.arange(N_WINDOWS) / N_WINDOWS
    unknown, time = np.full(N_WINDOWS, np.nan), 120.0 * np.arange(N_WINDOWS, dtype=np.float64)
    assert find_course(tracked(value, np.full(value.shape, STD)), time, unknown, unknown) is None
    value += 0.01 * np.arange(N_WINDOWS)[:, None] / N_WINDOWS
    few = tracked(value[::3], np.full((8, N_MODES), STD))
    assert find_course(few, time[::3], unknown[::3], unknown[::3]) is None
