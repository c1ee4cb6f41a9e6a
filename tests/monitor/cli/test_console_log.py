"""The lines printed by a run: readable, structured, and limited in number."""

import io
import json
import re

import pytest

from daq import Event
from monitor.cli.site.console_log import journal, line
from monitor.results.windows import LearningProgress, WindowResult, event_result
from tests.support.daq.blocks import make_block
from tests.support.monitor.history import change, run_events

START = 1_767_225_600_000_000_000


def event(what: str, **payload: object) -> Event:
    return Event(topic=f"/event/{what}", time=START, payload=payload)


def reported(*items: Event, as_json: bool = False) -> list[str]:
    stream = io.StringIO()
    with journal(as_json=as_json, stream=stream) as lines:
        lines.take(make_block("left", 0))  # signals are not printed
        for item in items:
            lines.take(item)
    return stream.getvalue().splitlines()


def test_text_format_of_lines() -> None:
    lines = reported(event("device_failed", device="left", why="the port is gone"), change(START, "alarm", "it moved"))
    assert all(re.match(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ ", line) for line in lines)
    assert [line.split(" ", 1)[1] for line in lines] == [
        'device_failed device=left why="the port is gone"',
        "  alarm: it moved",
    ]


def test_times_within_an_event_are_dates_for_people_and_numbers_for_programs() -> None:
    accepted = event("accept", by="Ann", alarm=START)
    [line] = reported(accepted)
    assert line.endswith('Z accept by=Ann alarm="2026-01-01 00:00:00 UTC"')
    [line] = reported(accepted, as_json=True)
    assert json.loads(line)["fields"]["alarm"] == START


def test_word_alarm_is_not_repeated() -> None:
    [line] = reported(change(START, "alarm", "ALARM: the structure has changed"))
    assert line.endswith("Z   alarm: the structure has changed")


def test_json_format_of_lines() -> None:
    lines = reported(
        event("device_recovered", device="left", serial="E1"),
        event("device_failed", device="left"),
        change(START, "alarm", "it moved"),
        as_json=True,
    )
    found = [json.loads(line) for line in lines]
    assert [line["level"] for line in found] == ["info", "warning", "warning"]
    assert found[0]["fields"] == {"what": "device_recovered", "at": START, "device": "left", "serial": "E1"}
    assert found[2] | {"time": ""} == {
        "time": "",
        "level": "warning",
        "text": "alarm: it moved",
        "fields": {"what": "alarm", "at": START},
    }


def test_each_event_of_a_run_is_printed_as_one_line() -> None:
    events = run_events()
    lines = reported(*events)
    assert len(lines) == len(events)
    assert sum("window" in line for line in lines) >= 10
    assert any("reference:" in line for line in lines)


def test_last_learning_window_announces_the_computation_of_the_reference() -> None:
    """The calibration of a model takes seconds to minutes, in which no other line is printed."""
    [usual] = [result for e in run_events() if isinstance(result := event_result(e), WindowResult)][:1]
    for windows, announced in ((11, False), (12, True)):
        progress = LearningProgress(windows=windows, target=12)
        text = line(usual.model_copy(update={"phase": "learning", "learning": progress}))
        assert text.endswith("; computing the reference from 12 windows ...") is announced


def test_repeated_events_are_counted_instead_of_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hundred gaps within a minute are ten lines; the next one after it states how many were left out."""
    now = 1000.0
    monkeypatch.setattr("monitor.cli.site.console_log.time.monotonic", lambda: now)
    stream = io.StringIO()
    with journal(as_json=False, stream=stream) as lines:
        for _ in range(100):
            lines.take(event("gap", device="left", missing=3))
        lines.take(event("gap", device="right", missing=1))  # others are heard all the same
        now += 61.0
        lines.take(event("gap", device="left", missing=3))
    found = stream.getvalue().splitlines()
    assert len(found) == 12
    assert "device=right" in found[10]
    assert found[11].endswith("gap device=left missing=3 omitted=90")
