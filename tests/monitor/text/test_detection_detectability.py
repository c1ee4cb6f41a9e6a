"""The smallest detectable change is stated, and that a thermometer is needed where there is none."""

import json
from dataclasses import replace

import numpy as np
import pytest

from monitor.detection import DETECTORS, GUARD, DetectionSettings, detectable_change, judge, start
from monitor.results.windows import AlarmResult, DetectableChange, WindowResult
from monitor.text.detection import NO_THERMOMETER, detectable_text
from tests.support.monitor.played_windows import BASELINE, Played, judged, run, without_answers

P, STD, DAY, SEED = 5, 3e-4, 144, 4
WATCHING = DetectionSettings(rate=1 / 52596 / len(DETECTORS), overlap=0.0, hold=2)


def test_detectable_change_brings_a_detector_to_its_limit() -> None:
    """Noiseless windows, changed by the stated size: all modes alike, then each alone."""
    random, day = np.random.default_rng(SEED), 15 + 8 * np.sin(2 * np.pi * np.arange(3 * DAY) / DAY)
    y = STD * random.standard_normal((len(day), P))
    watched = start(y, np.full(y.shape, STD), day, np.full(len(day), 600.0), WATCHING)
    at = np.full(GUARD, 15.0)
    predicted, _ = judge(watched, y[:GUARD], at, np.full(GUARD, 600.0))
    law = watched.law
    expected = law.centre + law.scale * (predicted.terms[:, 0, :] @ law.coefficient)
    last, after = judge(watched, expected, at, np.full(GUARD, 600.0))
    found = detectable_change(after, last)
    print(f"seed {SEED}: {100 * found.alike:.3f} % of all alike, {np.round(100 * found.each, 3)} % of one")
    for change in [np.full(P, found.alike), *np.diag(found.each)]:
        reached = judge(watched, expected + change, at, np.full(GUARD, 600.0))[0]
        assert (reached.value / reached.limit)[:, -1].max() == pytest.approx(1.0, rel=0.1)


def test_detectable_change_is_stated_per_window_and_missing_thermometer_once(monkeypatch: pytest.MonkeyPatch) -> None:
    without_answers(monkeypatch)
    played = Played(5, monkeypatch)
    windows = (replace(w, temperature=np.nan) for w in played.windows(BASELINE + 2))
    results = run(played.pipeline(), windows)
    reported = [r.text for r in results if isinstance(r, AlarmResult)]
    assert reported == [f"baseline learned from {BASELINE} windows; {NO_THERMOMETER}"]
    last = WindowResult.model_validate(judged(results)[-1].payload())
    assert last.novelty is not None
    assert last.novelty.detectable is not None
    text = detectable_text(last.novelty.detectable)
    assert text.startswith(
        f"a lasting change of all frequencies alike by {last.novelty.detectable.alike_percent:.2g} %"
    )
    assert text.endswith(NO_THERMOMETER)


def test_mode_that_is_not_detectable_alone_is_named() -> None:
    found = DetectableChange(alike_percent=0.5, modes_percent=[2.0, np.inf, 3.0], thermometer=True)
    assert detectable_text(DetectableChange.model_validate(json.loads(found.model_dump_json()))) == (
        "a lasting change of all frequencies alike by 0.5 %, or of one mode alone by 2 % (mode 1) to 3 % (mode 3); "
        "not detectable alone: mode 2"
    )
