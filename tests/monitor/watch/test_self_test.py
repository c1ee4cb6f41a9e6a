"""The self-test adds a mass at the stated place, detects it as it should, and leaves the monitor unchanged."""

from pathlib import Path

import numpy as np
import pytest

from daq import FloatArray, SystemClock
from monitor.outputs.history import HistoryStore, Reader, Span
from monitor.outputs.notices.filter import NoticeFilter
from monitor.results.site_status import FILE_NAME, read_status
from monitor.results.windows import Result, SelfTestResult, WindowResult, result_event
from monitor.service.servers.web import Source
from monitor.service.servers.web.metrics import metrics
from monitor.service.servers.web.source import problems
from monitor.service.servers.web.status_page import state_html
from monitor.service.site_run import pace_of
from monitor.service.status import MonitorStatus, Pace
from monitor.watch.memory import memory_text, parse_memory
from monitor.watch.self_test import DRAWS, with_mass
from tests.support.monitor.played_windows import BASELINE, STEP, Played, judged, run, site_settings, without_answers
from tests.support.monitor.service.status import WELL
from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame
from updater import Body, build_model, nominal_reference, stack_tracks

OFTEN = f"self_test_days = {5.5 * STEP / 86400}\nself_test_percent = "  # six windows after the last


def self_tests(results: list[Result]) -> list[SelfTestResult]:
    return [result for result in results if isinstance(result, SelfTestResult)]


def frequencies(*bodies: Body) -> FloatArray:
    """Return the first frequencies of the nominal frame with bodies [Hz], by the whole model."""
    structure = t_frame().model_copy(update={"body": bodies})
    return build_model(structure, shear_flexible=True, mass="consistent").modes(8).frequency


def test_simulated_mass_shifts_frequencies_as_in_the_full_model() -> None:
    """Thirty modes represent the rest, within the allowed 2e-4: shifts are up to a tenth."""
    model, random = build_model(t_frame(), shear_flexible=True, mass="consistent"), np.random.default_rng(0)
    measured = [measure(model, random, np.ones(12)) for _ in range(3)]
    reference = nominal_reference(t_frame(), stack_tracks(measured, [np.arange(8)] * 3))
    places = np.array([(0.0, 0.0, 0.9), (0.3, 0.0, 1.48)])
    found = with_mass(reference, places, 0.2)
    bare = frequencies()
    for place, ratio in zip(places, found, strict=True):
        x, y, z = (float(v) for v in place)
        expected = frequencies(Body(at=(x, y, z), mass=0.2)) / bare
        np.testing.assert_allclose(ratio, expected[reference.paired], atol=2e-4)
    assert np.all(with_mass(reference, places, 0.0) == pytest.approx(1.0, abs=1e-12))


@pytest.mark.parametrize(("percent", "seen"), few_of([(8.0, range(DRAWS // 2, DRAWS + 1)), (1e-4, range(1))]))
def test_self_test_detects_a_sufficient_mass_and_no_negligible_one(
    percent: float, seen: range, monkeypatch: pytest.MonkeyPatch
) -> None:
    played = Played(21, monkeypatch)
    played.settings = site_settings(OFTEN + str(percent))
    pipeline = played.pipeline()
    run(pipeline, played.windows(BASELINE + 5))
    windows = list(played.windows(2))
    without = played.pipeline(pipeline.memory)
    [test] = self_tests(run(pipeline, iter(windows[:1])))  # the sixth calm one
    assert test.detected in seen
    assert test.passed == (percent == 8.0)
    assert test.last_passed == (test.time if test.passed else None)
    whole = build_model(t_frame()).total_mass()
    assert test.mass == pytest.approx(percent / 100 * whole, rel=1e-6)
    # the watch is as it would be without the test
    without_settings = site_settings("self_test_days = 0")
    played.settings = without_settings
    untested = played.pipeline(without.memory)
    after = judged(run(pipeline, iter(windows[1:])))
    reported = run(untested, iter(windows))
    assert self_tests(reported) == []
    assert [w.payload() for w in judged(reported)][1:] == [w.payload() for w in after]


@pytest.mark.thorough
def test_self_tests_run_when_due_but_not_during_alarms(monkeypatch: pytest.MonkeyPatch) -> None:
    without_answers(monkeypatch)
    played = Played(22, monkeypatch)
    played.settings = site_settings(OFTEN + "2.0")
    pipeline = played.pipeline()
    run(pipeline, played.windows(BASELINE + 6))
    pipeline = played.pipeline(parse_memory(memory_text(pipeline.memory)))
    again = run(pipeline, played.windows(8))
    assert [test.time for test in self_tests(again)] == [judged(again)[5].end]
    played.put(Body(at=(0.0, 0.0, 0.9), mass=0.25))
    assert self_tests(run(pipeline, played.windows(6))) == []


@pytest.mark.thorough
@pytest.mark.parametrize(("percent", "passed", "tested"), few_of([(8.0, True, 1), (1e-4, False, 2)]))
def test_failed_self_test_is_repeated_the_next_day(
    percent: float, passed: bool, tested: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_answers(monkeypatch)
    played = Played(23, monkeypatch)
    played.settings = site_settings(f"self_test_days = 2.5\nself_test_percent = {percent}")
    pipeline = played.pipeline()
    reported = run(pipeline, played.windows(BASELINE + 6))
    played.wait(3)
    reported += run(pipeline, played.windows(6))
    played.wait(1)
    reported += run(pipeline, played.windows(6))
    assert [test.passed for test in self_tests(reported)] == [passed] * tested


TEST = SelfTestResult(time=10**18, mass=0.15, places=24, detected=20, passed=True, last_passed=10**18)
FAILED = TEST.model_copy(update={"detected": 3, "passed": False})


def test_failed_self_test_and_next_success_are_each_reported_once(tmp_path: Path) -> None:
    assert TEST.text == "self-test passed: 150 g would raise the alarm at 20 of 24 places"
    assert TEST.probability == pytest.approx(20 / 24)
    news = NoticeFilter("frame")
    assert news.of(result_event(TEST)) is None
    stated = [news.of(result_event(test)) for test in (FAILED, FAILED, TEST, TEST)]
    assert [(notice.kind, notice.text) if notice else None for notice in stated] == [
        ("trouble", FAILED.text),
        None,
        ("trouble", TEST.text),
        None,
    ]
    url = f"sqlite:///{tmp_path / 'history.sqlite'}"
    with HistoryStore(url) as store:
        store.write([result_event(FAILED)])
    with Reader(url) as reader:
        [event] = reader.events(Span(start=0, end=2**62))
    assert (event.topic, event.time) == ("/result/self_test", 10**18)
    assert '"detected": 3' in event.json


@pytest.mark.parametrize("damage", ["[]", "", '{"time": 1}'])
def test_last_self_test_survives_restart_and_damaged_status_is_ignored(tmp_path: Path, damage: str) -> None:
    path = tmp_path / FILE_NAME
    assert read_status(path) is None
    for results in ([FAILED], []):
        status = MonitorStatus(path, (), Pace(step=600.0, window=600.0), SystemClock())
        for result in results:
            status.take(result_event(result))
        status.write(*WELL)
        found = read_status(path)
        assert found is not None
        assert found.self_test == FAILED
    path.write_text(damage)
    assert read_status(path) is None


def test_self_test_in_metrics_and_on_the_page(tmp_path: Path) -> None:
    source = Source(name="frame", state=tmp_path, url=f"sqlite:///{tmp_path / 'history.sqlite'}")
    for test, ratio, count in ((TEST, 20 / 24, 1), (FAILED, 3 / 24, 2)):
        status = MonitorStatus(tmp_path / FILE_NAME, (), Pace(step=600.0, window=600.0), SystemClock())
        status.take(result_event(test))
        status.write(*WELL)
        text = metrics(source.status()).decode()
        assert f"modalwatch_self_test_detection_ratio {ratio}" in text
        assert "modalwatch_self_test_success_age_seconds" in text
        assert problems(source.status()) == ([] if test.passed else [f"{test.text} (2001-09-09 01:46:40 UTC)"])
        assert state_html(source).count(test.text) == count  # a failed one among what is not well too


@pytest.mark.parametrize(
    ("days", "phase", "well"), [(7, "watching", False), (7, "learning", True), (0, "watching", True)]
)
def test_failed_self_test_without_a_successor_is_not_a_health_problem(
    tmp_path: Path, days: int, phase: str, well: bool
) -> None:
    """A test has failed before tests were turned off, or before a new baseline was learned."""
    path, pace = tmp_path / FILE_NAME, pace_of(site_settings(f"self_test_days = {days}"))
    before = MonitorStatus(path, (), Pace(step=600.0, window=600.0), SystemClock())
    before.take(result_event(FAILED))
    before.write(*WELL)
    status = MonitorStatus(path, (), pace, SystemClock())
    window = {"index": 0, "start": 0, "end": 1, "phase": phase, "channels": [], "modes": []}
    status.take(result_event(WindowResult.model_validate(window)))
    status.write(*WELL)
    reported = read_status(path)
    assert reported is not None
    assert (reported.self_test is None) == well
    assert (problems(reported) == []) == well
