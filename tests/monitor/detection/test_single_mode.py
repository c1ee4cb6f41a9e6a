"""One mode alone: wrong poles that stay for some windows raise no alarm, a change that moves one mode does in time."""

import numpy as np
import pytest
from scipy.stats import poisson

from daq import FloatArray
from monitor.detection import CHUNK, DETECTORS, DetectionSettings, LawState, ScoredWindows, accept, judge, start
from monitor.detection.single_mode import MAX_HOLD_WINDOWS, no_runs, wait
from tests.support.thorough import few_of

P, STD, STEP, DAY = 6, 5e-4, 600.0, 144
YEARLY = DetectionSettings(rate=1 / 52596 / len(DETECTORS), overlap=0.0, hold=2)


def noise(random: np.random.Generator, n_sites: int, n: int) -> FloatArray:
    return STD * random.standard_normal((n_sites, n, P))


def bursts(random: np.random.Generator, n_sites: int, n: int) -> FloatArray:
    """Wrong poles in 1 % of the windows: three to six windows of one mode, 1 % to 2 % off."""
    off = np.zeros((n_sites, n, P))
    for site in range(n_sites):
        for first in np.flatnonzero(random.random(n) < 0.01 / 4.5):
            length, mode = random.integers(3, 7), random.integers(P)
            off[site, first : first + length, mode] = random.choice([-1, 1]) * random.uniform(0.01, 0.02)
    return off


def watched_days(y: FloatArray, watched: LawState) -> tuple[list[ScoredWindows], LawState]:
    """Judge, and learn from all that is calm."""
    found = []
    for first in range(0, y.shape[1], CHUNK):
        piece = y[:, first : first + CHUNK]
        judged, watched = judge(watched, piece, np.full(piece.shape[:2], 15.0), np.full(piece.shape[1], STEP))
        watched = accept(watched, judged.terms, np.where(judged.over[..., None], np.nan, judged.teaching))
        found.append(judged)
    return found, watched


def learnt(random: np.random.Generator, n_sites: int) -> LawState:
    y = noise(random, n_sites, DAY)
    return start(y, np.full(y.shape, STD), np.full(y.shape[:2], 15.0), np.full(DAY, STEP), YEARLY)


def over(found: list[ScoredWindows]) -> FloatArray:
    return np.concatenate([judged.over for judged in found], axis=-1).astype(float)


@pytest.mark.thorough
@pytest.mark.parametrize(("seed", "days"), few_of([(1, 10), (1, 30), (2, 30)]))
def test_bursts_of_spurious_poles_raise_no_alarm(seed: int, days: int) -> None:
    """Ten bursts a day at 30 sites; 1.5 false alarms per year would be 3.7 in 30 days: Poisson bound at 1e-3."""
    random = np.random.default_rng(seed)
    n = days * DAY
    found, watched = watched_days(noise(random, 30, n) + bursts(random, 30, n), learnt(random, 30))
    passed = over(found)
    alarms = int(((passed[:, 1:-1] * passed[:, 2:]) * (1 - passed[:, :-2])).sum())
    print(f"seed {seed}: {alarms} alarms from {watched.runs.n_ended.sum():.0f} bursts")
    assert watched.runs.n_ended.sum() > 5 * days
    assert alarms <= poisson.ppf(1 - 1e-3, 1.5 * 30 * days / 365)


@pytest.mark.parametrize("seed", few_of([1, 2]))
@pytest.mark.parametrize(("n_sites", "days"), few_of([(12, 4), (30, 10)]))
@pytest.mark.parametrize("busy", few_of([True, False]))
def test_a_change_of_one_mode_is_found_in_bounded_time(seed: int, n_sites: int, days: int, *, busy: bool) -> None:
    """0.5 % of one mode, ten deviations, on sites without wrong poles and on sites with bursts of them.

    Days without wrong poles shorten the wait of a new site.
    """
    random, n = np.random.default_rng(seed), days * DAY
    wrong = bursts(random, n_sites, n) if busy else 0.0
    _, watched = watched_days(noise(random, n_sites, n) + wrong, learnt(random, n_sites))
    changed = noise(random, n_sites, DAY)
    changed[..., 2] -= 5e-3
    passed = over(watched_days(changed, watched)[0])
    first = passed.argmax(-1)
    print(f"seed {seed}: found after {np.median(first) + 1:.0f} windows, at most {first.max() + 1}")
    assert passed.any(-1).all()
    assert first.max() < MAX_HOLD_WINDOWS
    assert busy or np.median(first) + 1 < no_runs(()).hold(YEARLY.rate)


def test_change_of_all_modes_is_detected_without_delay() -> None:
    random = np.random.default_rng(3)
    watched = watched_days(noise(random, 30, DAY), learnt(random, 30))[1]
    found, _ = judge(
        watched, noise(random, 30, 3) + 5e-3 * (-1.0) ** np.arange(P), np.full((30, 3), 15.0), np.full(3, STEP)
    )
    assert found.over.all()


def test_run_continues_while_its_mode_is_missing_or_deviating() -> None:
    single = np.array([-1, 2, 2, -1, 2, -1, 2, -1, 1, 2, -1])
    score = np.zeros((11, P))
    score[3, 2], score[5, 2] = np.nan, 4.0
    waiting, runs = wait(no_runs(()), single, score, 1e-6)
    assert waiting.tolist() == (single >= 0).tolist()
    assert [float(v) for v in (runs.n_ended, runs.in_ended, runs.n_windows, runs.mode)] == [3, 7, 11, -1]


def test_hold_time_grows_with_run_length_up_to_a_maximum() -> None:
    rate = 6e-6
    short, long = (
        wait(no_runs(()), np.tile([*[0] * n, *[-1] * 40], 50), np.zeros((50 * (n + 40), P)), rate)[1] for n in (1, 12)
    )
    hold = [int(runs.hold(rate)) for runs in (short, long)]
    print(f"runs of 1 and of 12 windows: waited for {hold}")
    assert hold[0] < 8 < hold[1] <= MAX_HOLD_WINDOWS
