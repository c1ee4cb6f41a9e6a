"""The simulator of sites: independent of the code under test, and with the difficulties that its kinds state."""

import ast
from pathlib import Path

import numpy as np
import pytest

from tests.examiner import sites
from tests.examiner.sites import KINDS, SimulatedSites, SiteKind
from tests.support.thorough import few_of


def kind_named(name: str) -> SiteKind:
    return next(kind for kind in KINDS if kind.name == name)


def test_simulator_imports_only_numpy() -> None:
    tree = ast.parse(Path(sites.__file__).read_text())
    found = {a.name.split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    found |= {(n.module or "").split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert found <= {"numpy", "dataclasses", "typing"}


def test_windows_continue_in_time_and_repeat_for_equal_seed() -> None:
    first, second = (SimulatedSites(KINDS[0], 3, seed=5) for _ in range(2))
    pieces = [first.windows(20), first.windows(30)]
    whole = second.windows(50)
    assert np.array_equal(np.concatenate([p.time for p in pieces]), whole.time)
    assert np.array_equal(np.concatenate([p.frequency for p in pieces], axis=1), whole.frequency, equal_nan=True)


@pytest.mark.parametrize("seed", few_of([1, 2]))
def test_frequency_errors_about_temperature_line_have_stated_deviation(seed: int) -> None:
    """20 sites, 8 modes, 400 windows: a ratio of variances is known to 0.6 %, five deviations are allowed."""
    sites = SimulatedSites(kind_named("linear temperature"), 20, seed)
    w = sites.windows(400)
    predicted = sites.slope[:, None, :] * (w.structure - 15)[..., None] + np.log(sites.frequency)[:, None, :]
    score = (np.log(w.frequency) - predicted) / sites.stated[:, None, :]
    n = np.isfinite(score).sum()
    print(f"seed {seed}: variance {np.nanvar(score):.4f} of {n} scores")
    assert np.nanvar(score) == pytest.approx(1.0, abs=5 * np.sqrt(2 / n))


@pytest.mark.parametrize(
    ("name", "share", "length"), [("single wrong poles", 0.01, 1.0), ("bursts of one wrong pole", 0.01, 4.0)]
)
def test_wrong_poles_have_stated_share_and_burst_length(name: str, share: float, length: float) -> None:
    """30 sites, 2000 windows: 600 / length bursts; number and length known within 8 % (one sigma)."""
    wrong = SimulatedSites(kind_named(name), 30, seed=3).windows(2000).wrong
    one = np.asarray(wrong.any(-1))
    begun = (one[:, 1:] & ~one[:, :-1]).sum()
    print(f"seed 3, {name}: share {one.mean():.4f}, length {one.sum() / begun:.2f}")
    assert wrong.sum(-1).max() == 1
    assert one.mean() == pytest.approx(share, rel=0.25)
    assert one.sum() / begun == pytest.approx(length, rel=0.25)


def test_gaps_outages_and_wind_scatter_match_stated_values() -> None:
    gaps = SimulatedSites(kind_named("missing windows"), 1, seed=4).windows(6000).time
    assert 1 - len(gaps) * 600 / gaps[-1] == pytest.approx(0.2, abs=0.06)
    silent = SimulatedSites(kind_named("thermometer silent for 6 h"), 20, seed=4).windows(2000)
    assert np.array_equal(np.isnan(silent.temperature), silent.silent)
    assert silent.silent.mean() == pytest.approx(50 * 6 / 8766, rel=0.3)
    windy = SimulatedSites(kind_named("scatter x4 with wind, stated"), 20, seed=4)
    w = windy.windows(2000)
    assert np.quantile(w.scatter, [0.02, 0.98]) == pytest.approx([1.0, 4.0], rel=0.15)
    stated = np.nanmedian(w.frequency_std / w.frequency / windy.stated[:, None, :], axis=-1)
    assert np.median(stated / w.scatter) == pytest.approx(1.0, abs=0.02)


def test_frost_stiffening_after_summer_baseline_has_stated_size() -> None:
    sites = SimulatedSites(SiteKind(name="frost", frost=(0.02, 0.02), summer_start=True, step=6 * 3600.0), 20, seed=6)
    w = sites.windows(4 * 250)
    frozen, summer = w.structure < -3.5, w.structure > 15
    assert not frozen[:, :120].any()
    level = (
        np.log(w.frequency)
        - np.log(sites.frequency)[:, None, :]
        - sites.slope[:, None, :] * (w.structure - 15)[..., None]
    )
    assert np.nanmean(level[frozen]) - np.nanmean(level[summer]) == pytest.approx(0.02, rel=0.1)
