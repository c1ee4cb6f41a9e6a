"""A slow trend is an event of its own: it is no alarm, and a setting forgives, reports or sends it."""

from dataclasses import replace

import numpy as np
import pytest

from monitor.detection import CHUNK, DETECTORS, GUARD, DetectionSettings, Trend, TrendWatch, judge, start
from monitor.outputs.notices import NoticeFilter
from monitor.results.run_results import RunResults
from monitor.results.windows import AlarmResult, ReferenceResult, result_event
from monitor.text.verdicts import headline
from monitor.watch.detector import Detector, DetectorState
from monitor.watch.memory import memory_text, parse_memory
from tests.support.monitor.played_windows import BASELINE, Played, judged, run, site_settings, without_answers


def trend(n_modes: int) -> Trend:
    """Return a trend of -0.2 % per year in all modes, but for one that is not known."""
    rate = np.full(n_modes, -2e-3)
    rate[-1] = np.nan
    return Trend(rate=rate, std=np.full(n_modes, 1e-4), common_rate=-2e-3, common_std=5e-5, seconds=52 * 7 * 86400.0)


@pytest.mark.thorough
def test_trend_is_reported_once_and_raises_no_alarm(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first estimate of a trend is made significant; the run continues with another setting after a restart."""
    without_answers(monkeypatch)
    played = Played(3, monkeypatch)

    def follow(watch: TrendWatch, _weekly: object) -> tuple[TrendWatch, bool]:
        found = trend(4)
        return TrendWatch(week=0, present=found, reported=found), watch.present is None

    monkeypatch.setattr("monitor.watch.detector.follow_trend", follow)
    played.settings = site_settings("self_test_days = 0")
    pipeline = played.pipeline()
    found = run(pipeline, played.windows(BASELINE + GUARD + CHUNK + 1))
    (event,) = (r for r in found if isinstance(r, AlarmResult) and r.kind == "trend")
    assert (event.state, event.quiet) == ("normal", True)
    assert event.text == (
        "slow trend of the frequencies over 52 weeks, the effects of temperature and season removed: "
        "-0.200 ± 0.005 % per year on average over all modes (mode 1 -0.200 ± 0.010, mode 2 -0.200 ± 0.010, "
        "mode 3 -0.200 ± 0.010); the temperature model adapts to it; it raises no alarm"
    )
    last = judged(found)[-1]
    again = type(last).model_validate(last.payload())
    assert last.phase == "watching"
    assert again.novelty is not None
    assert again.novelty.trend is not None
    assert again.novelty.trend.percent_per_year == pytest.approx(-0.2)
    assert np.isnan(again.novelty.trend.modes[-1].percent_per_year)
    reference = next(r for r in found if isinstance(r, ReferenceResult))
    alarms = tuple(r for r in found if isinstance(r, AlarmResult))
    run_results = RunResults(name="frame", reference=reference, windows=tuple(judged(found)), alarms=alarms)
    assert headline(run_results, None).startswith(
        f"No sudden change in {GUARD + CHUNK + 1} windows; slow trend of the freq"
    )
    assert NoticeFilter("site").of(result_event(event)) is None
    notice = NoticeFilter("site").of(result_event(event.model_copy(update={"quiet": False})))
    assert notice is not None
    assert notice.kind == "trend"
    played.settings = site_settings('trend = "forgive"\nself_test_days = 0')
    assert pipeline.memory is not None
    resumed = judged(run(played.pipeline(parse_memory(memory_text(pipeline.memory))), played.windows(1)))[-1]
    assert resumed.novelty is not None
    assert resumed.novelty.trend is None


def test_forgiven_trend_is_reported_after_the_setting_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    def follow(watch: TrendWatch, _weekly: object) -> tuple[TrendWatch, bool]:
        return TrendWatch(week=watch.week + 1, present=trend(3), reported=trend(3)), watch.reported is None

    monkeypatch.setattr("monitor.watch.detector.follow_trend", follow)
    y = 1e-4 * np.random.default_rng(5).standard_normal((100, 3))
    watching = DetectionSettings(rate=1 / 52596 / len(DETECTORS), overlap=0.0, hold=2)
    watched = start(y, np.full(y.shape, 1e-4), np.full(100, 15.0), np.full(100, 600.0), watching)
    calm, watched = judge(watched, y[:1], np.array([15.0]), np.array([600.0]))
    state, found = DetectorState(watched=watched, before=0), []
    for setting in ("forgive", "forgive", "report", "report"):
        filled = replace(state, calm=(calm,) * (GUARD + CHUNK))
        detector = Detector(filled, site_settings(f'trend = "{setting}"'))
        found.append(detector.settle(calm=True))
        state = detector.state
    assert found == [False, False, True, False]
