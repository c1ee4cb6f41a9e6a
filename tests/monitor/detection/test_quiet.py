"""Quiet sites: limits approach the scatter that is seen, and small changes are found after two weeks."""

import numpy as np
import pytest

from monitor.detection import CHUNK, DETECTORS, DetectionSettings, accept, detectable_change, judge, start
from tests.examiner.sites import SimulatedSites, SiteKind

STEP, SITES, DAYS, SEED = 600.0, 6, 14, 3
DAY = round(86400 / STEP)
WATCHING = DetectionSettings(rate=STEP / 31.6e6 / len(DETECTORS), overlap=0.0, hold=2)
KIND = SiteKind(name="quiet", stated=(5e-5, 1.5e-4), step=STEP)


@pytest.mark.thorough
def test_change_of_a_tenth_of_a_per_cent_is_found_after_two_weeks() -> None:
    """Deviations of about 1e-4, changes of 0.05 to 0.15 % after a day and two weeks, no false alarm before."""
    sites = SimulatedSites(KIND, SITES, SEED)

    def windows(n: int) -> tuple[np.ndarray, ...]:
        w = sites.windows(n)
        y = np.log(w.frequency / sites.frequency[:, None, :])
        return y, w.temperature, np.full(n, STEP), w.frequency_std / w.frequency, w.rms

    y, temperature, seconds, std, rms = windows(DAY)
    watched, alarms = start(y, std, temperature, seconds, WATCHING, rms), 0
    for _ in range(DAYS * DAY // CHUNK):
        judged, watched = judge(watched, *windows(CHUNK))
        alarms += int((judged.over[:, 1:] & judged.over[:, :-1]).any(-1).sum())
        watched = accept(watched, judged.terms, judged.teaching, judged.variance)
    assert alarms == 0
    sites.damage(1e-3)
    judged, _ = judge(watched, *windows(DAY))
    found = (judged.over[:, 1:] & judged.over[:, :-1]).any(-1)
    print(f"seed {SEED}: found on {found.sum()} of {SITES} sites within a day")
    assert found.mean() > 0.6


def test_smallest_detectable_change_approaches_the_scatter() -> None:
    """One site without temperature effect, errors of 1e-4: the smallest change of all modes alike shrinks with days."""
    random, n_modes, std = np.random.default_rng(SEED), 6, 1e-4

    def least(days: int) -> float:
        day = 15 + 8 * np.sin(2 * np.pi * np.arange(days * DAY) / DAY)
        y = std * random.standard_normal((len(day), n_modes))
        watched = start(y, np.full(y.shape, std), day, np.full(len(day), STEP), WATCHING)
        judged, after = judge(watched, y[:1], np.array([15.0]), np.array([STEP]))
        return detectable_change(after, judged).alike

    found = [least(days) for days in (1, 3, 14)]
    print(f"seed {SEED}: {', '.join(f'{100 * size:.3f} %' for size in found)} after 1, 3 and 14 days")
    assert found[0] > 2 * found[1]
    assert found[-1] < 4.5 * std
