"""Reports of a site over MQTT: made from what is logged, and read from messages of anybody."""

import json
from dataclasses import replace

import pytest

from monitor.outputs.history import SiteState
from monitor.outputs.site_report import N_LEVELS, SiteReporter, parse_report
from monitor.results.windows import AlarmResult, WindowResult, result_event
from monitor.text.causes import change_text
from tests.support.monitor.answers import diagnosis
from tests.support.monitor.history import run_events

STATE = SiteState(state="alarm", window=7, window_age=3.0, overdue=False, problems=("disk: full",), url="http://a")


def alarm(state: str, kind: str = "state", since: int | None = None) -> AlarmResult:
    return AlarmResult(time=5, state=state, text="changed", window=1, kind=kind, since=since)  # type: ignore[arg-type]


def test_report_has_the_alarm_as_last_diagnosed_and_the_levels() -> None:
    reporter = SiteReporter()
    events = run_events()
    for event in events:
        reporter.take(event)
    assert (first := reporter.report("bridge", STATE).alarm)
    assert first.text.startswith("ALARM: the structure has changed")
    last = WindowResult.model_validate(events[-1].payload)
    reporter.take(result_event(last.model_copy(update={"diagnosis": diagnosis()})))
    report = parse_report(reporter.report("bridge", STATE).model_dump_json().encode())
    assert report is not None
    assert (report.site, report.state, report.window, report.problems) == ("bridge", "alarm", 7, ("disk: full",))
    assert report.alarm is not None
    assert not report.alarm.acknowledged
    assert report.alarm.text == change_text(diagnosis())
    assert 0 < len(report.levels) <= N_LEVELS
    assert report.levels[-1] > 1


def test_alarm_is_acknowledged_continued_and_ended() -> None:
    reporter = SiteReporter()
    found = []
    for change in (alarm("alarm", "resumed", since=3), alarm("alarm", "acknowledged"), alarm("normal")):
        reporter.take(result_event(change))
        active = reporter.report("bridge", STATE).alarm
        found.append(active and (active.raised, active.acknowledged))
    assert found == [(3, False), (3, True), None]


def test_age_alone_is_no_change() -> None:
    reporter = SiteReporter()
    first = reporter.report("bridge", STATE)
    assert (
        reporter.report("bridge", replace(STATE, window_age=9.0, problems=("disk: fuller",))).content == first.content
    )
    assert reporter.report("bridge", replace(STATE, overdue=True)).content != first.content


@pytest.mark.parametrize(
    "change",
    [
        {"site": ""},
        {"site": "x" * 201},
        {"lasts": "soon"},
        {"levels": [0.1] * 41},
        {"problems": ["a"] * 101},
        {"problems": ["a" * 70_000]},
        {"alarm": {"text": "no time"}},
    ],
)
def test_message_that_is_no_report_is_left_out(change: dict[str, object]) -> None:
    content = json.loads(SiteReporter().report("bridge", STATE).model_dump_json())
    assert parse_report(json.dumps(content).encode()) is not None
    assert parse_report(json.dumps(content | change).encode()) is None
    assert parse_report(b"\xff{") is None
