"""What a person tells a running monitor arrives once, whole, and reaches the alarm."""

from pathlib import Path

import pytest
from cli_helpers import Commands

from daq import Event
from monitor.alarm_words import acknowledged_said, duration_text
from monitor.alarms import Alarm, AlarmRules, Change
from monitor.inbox import TOPIC_ACKNOWLEDGE, TOPIC_REFUSED, Acknowledgement, leave, taken
from monitor.pipeline import Pipeline
from monitor.results import AlarmResult
from monitor.settings import parse_settings
from updater import parse_structure, t_structure_toml

SITE = """
structure = "t_structure.toml"

[[device]]
name = "beam_left"
driver = "epson-uart"
port = "/dev/ttyUSB0"
channels = {y = "beam_left_y", z = "beam_left_z"}
"""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    (tmp_path / "site.toml").write_text(SITE, encoding="utf-8")
    return tmp_path / "site.toml"


def test_command_leaves_word_that_is_taken_once(modalwatch: Commands, site: Path) -> None:
    assert list(taken(site.parent / "state")) == []
    done = modalwatch("acknowledge", site, "--by", "Ada", "--note", "a crane")
    assert done.code == 0, done.err
    expected = [(TOPIC_ACKNOWLEDGE, {"by": "Ada", "note": "a crane"})]
    assert list(taken(site.parent / "state")) == expected
    assert list(taken(site.parent / "state")) == []


@pytest.mark.parametrize("text", ["", "not json", "[1, 2]", '{"by": 5}', '{"who": "x"}', "9" * 5000, "\udcff\x00"])
def test_file_that_says_nothing_sensible_is_refused_and_gone(tmp_path: Path, text: str) -> None:
    path = leave(tmp_path, Acknowledgement())
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    [(topic, payload)] = taken(tmp_path)
    assert (topic, payload["file"]) == (TOPIC_REFUSED, path.name)
    assert not path.exists()


def test_acknowledgement_in_the_log_changes_the_alarm(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pipeline = Pipeline(parse_structure(t_structure_toml()), parse_settings(SITE))
    event = Event(topic=TOPIC_ACKNOWLEDGE, time=7, payload={"by": "Ada", "note": "a crane"})
    assert list(pipeline.push(event)) == []  # of no alarm
    raised = Alarm(rules=AlarmRules(), condition="alarm", raised=5)
    monkeypatch.setattr(pipeline, "_alarm", raised)
    [result] = pipeline.push(event)
    assert isinstance(result, AlarmResult)
    assert (result.time, result.state, result.kind) == (7, "alarm", "acknowledged")
    assert result.text == "acknowledged by Ada: a crane"
    assert list(pipeline.push(event)) == []


def test_end_by_acknowledgement_says_how_long_it_was() -> None:
    said = acknowledged_said(Change(kind="state", state="normal", lasted=200 * 60 * 10**9), {})
    assert said == "acknowledged, back to normal after 3 h 20 min of alarm"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0, "0 s"), (59.0, "59 s"), (60.0, "1 min"), (3599.0, "59 min 59 s"), (7200.0, "2 h"), (90000.0, "1 d 1 h")],
)
def test_durations_are_told_in_two_units(seconds: float, text: str) -> None:
    assert duration_text(seconds) == text
