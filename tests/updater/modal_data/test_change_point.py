"""Change points within a baseline, on simulated sites that share nothing with the test: missed and false ones."""

import numpy as np
import pytest
from scipy.stats import binom

from daq import FloatArray
from tests.examiner.sites import KINDS, SimulatedSites, SiteWindows
from tests.support.thorough import few_of
from tests.support.updater.tracked_sites import modes_of, tracked
from updater.modal_data import find_change, windows_of_one_state
from updater.modal_data.states.change_point import FALSE_POSITIVE


@pytest.mark.parametrize("n_windows", few_of([8, 24]))
def test_false_change_points_are_no_more_frequent_than_stated(n_windows: int) -> None:
    """Eighteen kinds of site: frost, drift, wind, bursts of a wrong pole, thermometers late or absent, loads."""
    found, n = 0, 0
    for kind in KINDS:
        windows = SimulatedSites(kind, 3, 21).windows(n_windows)
        for site in range(3):
            change = find_change(modes_of(windows, site), windows.time, windows.temperature[site], windows.rms[site])
            found += change is not None
            n += 1
    print(f"seed 21, {n_windows} windows: {found} changes found in {n} baselines of one state")
    assert found <= binom.ppf(1 - 1e-4, n, FALSE_POSITIVE)


@pytest.mark.parametrize(
    "name", few_of(["linear temperature", "bursts of one wrong pole", "no thermometer", "quiet"], 2)
)
def test_a_change_of_one_per_cent_is_found_with_its_time_and_size(name: str) -> None:
    (kind,) = (kind for kind in KINDS if kind.name == name)
    sites = SimulatedSites(kind, 6, 22)
    before = sites.windows(15)
    sites.damage(0.01)
    after = sites.windows(9)
    found = 0
    for site in range(6):
        y, std = (np.concatenate([np.asarray(a), np.asarray(b)]) for a, b in _both(before, after, site))
        time, warm, rms = (
            np.append(before.time, after.time),
            np.append(before.temperature[site], after.temperature[site]),
            np.append(before.rms[site], after.rms[site]),
        )
        change = find_change(tracked(y, std), time, warm, rms)
        if change is None:
            continue
        found += 1
        edge = change.first if change.first else change.stop
        assert abs(edge - 15) <= 1
        sign = 1.0 if change.first else -1.0
        off = (sign * change.shift - np.log1p(sites.change[site])) / 0.01
        print(f"seed 22, {name}: window {edge}, largest error of size {np.nanmax(np.abs(off)):.2f} of it")
        assert np.nanmedian(np.abs(off)) < 0.2
    assert found >= 5


def _both(before: SiteWindows, after: SiteWindows, site: int) -> list[tuple[FloatArray, FloatArray]]:
    return [
        (np.log(before.frequency[site]), np.log(after.frequency[site])),
        (before.frequency_std[site] / before.frequency[site], after.frequency_std[site] / after.frequency[site]),
    ]


@pytest.mark.parametrize("seed", range(4))
def test_three_shifted_windows_of_eight_are_excluded(seed: int) -> None:
    random = np.random.default_rng(seed)
    first = int(random.integers(0, 6))
    y = 5e-4 * random.standard_normal((8, 6))
    y[first : first + 3] -= 0.03 * random.uniform(0.3, 1.0, 6)
    unknown = np.full(8, np.nan)
    modes = tracked(y, np.full(y.shape, 5e-4))
    kept, changes = windows_of_one_state(modes, 60.0 * np.arange(8.0), unknown, unknown)
    print(f"seed {seed}: windows {first} to {first + 2} moved, kept {kept}, p {changes[0].p_value:.1e}")
    assert kept.tolist() == np.setdiff1d(np.arange(8), np.arange(first, first + 3)).tolist()


def test_shift_explained_by_temperature_or_amplitude_is_no_change() -> None:
    """A step of 12 K of steel, and bolts that soften by 1 % where it shakes twice as much."""
    random, n, p = np.random.default_rng(3), 16, 6
    noise = 3e-4 * random.standard_normal((n, p))
    modes = np.where(np.arange(n) < 9, 0.0, 1.0)
    warm, loud = 15 + 12 * modes + 0.1 * random.standard_normal(n), 0.01 * (1 + modes)
    time, std, unknown = 600.0 * np.arange(float(n)), np.full((n, p), 3e-4), np.full(n, np.nan)
    by_warmth = tracked(noise - 2e-4 * (warm - 15)[:, None], std)
    assert find_change(by_warmth, time, warm, unknown) is None
    by_amplitude = tracked(noise - 0.01 * modes[:, None] * np.linspace(0.3, 1.0, p), std)
    assert find_change(by_amplitude, time, np.full(n, 15.0), loud) is None
    assert find_change(by_amplitude, time, np.full(n, 15.0), np.full(n, 0.01)) is not None
