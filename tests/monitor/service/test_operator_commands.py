"""A command of a person to a running monitor arrives once, whole, and reaches the alarm."""

import errno
import os
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from daq import SystemClock
from monitor.detection.alarm import Alarm, AlarmRules, Change
from monitor.results.service_events import Acknowledged, CommandRefused
from monitor.results.site_status import FILE_NAME
from monitor.results.windows import AlarmResult
from monitor.service.operator_commands import Acknowledgement, Inbox, write_command
from monitor.service.status import MonitorStatus, Pace
from monitor.settings import parse_settings
from monitor.text.alarms import acknowledged_text
from monitor.text.quantities import duration_text
from monitor.watch.pipeline import Pipeline
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.monitor.service.status import WELL
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


def test_command_is_received_once(modalwatch: Commands, site: Path) -> None:
    assert list(Inbox(site.parent / "state").taken()) == []
    done = modalwatch("acknowledge", site, "--by", "Ada", "--note", "a crane")
    assert done.code == 0, done.err
    expected = [Acknowledged(by="Ada", note="a crane")]
    assert list(Inbox(site.parent / "state").taken()) == expected
    assert list(Inbox(site.parent / "state").taken()) == []


@pytest.mark.parametrize("text", ["", "not json", "[1, 2]", '{"by": 5}', '{"who": "x"}', "9" * 5000, "\udcff\x00"])
def test_invalid_command_file_is_refused_and_removed(tmp_path: Path, text: str) -> None:
    path = write_command(tmp_path, Acknowledgement())
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    [refused] = Inbox(tmp_path).taken()
    assert isinstance(refused, CommandRefused)
    assert refused.file == path.name
    assert not path.exists()


def test_command_text_is_reduced_to_one_printable_line(tmp_path: Path) -> None:
    """A zero byte would be refused by PostgreSQL, with everything that waits behind it, for good."""
    write_command(tmp_path, Acknowledgement(by="Ada\0", note="a crane\n2026 ALARM \u00e4"))
    assert list(Inbox(tmp_path).taken()) == [Acknowledged(by="Ada", note="a crane 2026 ALARM \u00e4")]


def test_commands_are_received_in_the_order_written(tmp_path: Path) -> None:
    """Accepted, undone, accepted again while no monitor ran: another order would have another result."""
    for k in range(12):
        write_command(tmp_path, Acknowledgement(by=str(k)))
    assert [command.payload()["by"] for command in Inbox(tmp_path).taken()] == [str(k) for k in range(12)]


def test_command_file_that_cannot_be_removed_is_refused_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another user's folder: executed each time it would repeat the command; ignored, it needs a message."""

    def forbidden(_: Path) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    path, inbox = write_command(tmp_path, Acknowledgement()), Inbox(tmp_path)
    monkeypatch.setattr(Path, "unlink", forbidden)
    assert list(inbox.taken()) == [CommandRefused(file=path.name, why="it cannot be taken: Permission denied")]
    assert list(inbox.taken()) == []


@pytest.mark.skipif(os.geteuid() != 0, reason="only the superuser gives files away")
def test_command_file_of_root_gets_the_state_folder_owner(tmp_path: Path) -> None:
    os.chown(tmp_path, 1234, 1234)
    path = write_command(tmp_path, Acknowledgement())
    assert {path.stat().st_uid, path.parent.stat().st_uid} == {1234}


def test_unwritable_state_folder_is_a_one_line_error(
    modalwatch: Commands, site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (site.parent / "state").write_text("a file stands where the folder should")
    assert_refused(modalwatch("acknowledge", site), "state: ", "expected a user who may write there")


def test_command_waits_until_the_monitor_has_received_it(
    modalwatch: Commands, site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A running monitor takes it at once; one that hangs is reported."""
    state = site.parent / "state"
    MonitorStatus(state / FILE_NAME, (), Pace(step=600.0, window=600.0), SystemClock()).write(*WELL)
    monkeypatch.setattr("monitor.cli.operation.sending._WAIT", 0.2)
    assert "has not received it within 0.2 s" in modalwatch("acknowledge", site).out
    monkeypatch.setattr("monitor.cli.operation.sending._WAIT", 10.0)
    stop, inbox = threading.Event(), Inbox(state)

    def take() -> None:
        while not stop.wait(0.01):
            list(inbox.taken())

    thread = threading.Thread(target=take)
    thread.start()
    try:
        assert "the monitor has received it" in modalwatch("acknowledge", site).out
    finally:
        stop.set()
        thread.join()


def test_acknowledgement_in_the_log_changes_the_alarm() -> None:
    structure, settings = parse_structure(t_structure_toml()), parse_settings(SITE)
    pipeline = Pipeline(structure, settings)
    event = Acknowledged(by="Ada", note="a crane").event(7)
    assert list(pipeline.push(event)) == []  # of no alarm
    raised = Alarm(rules=AlarmRules(), condition="alarm", raised=5)
    pipeline = Pipeline(structure, settings, replace(pipeline.memory, alarm=raised))
    [result] = pipeline.push(event)
    assert isinstance(result, AlarmResult)
    assert (result.time, result.state, result.kind) == (7, "alarm", "acknowledged")
    assert result.text == "acknowledged by Ada: a crane"
    assert list(pipeline.push(event)) == []


def test_text_of_an_alarm_cleared_by_acknowledgement_states_its_duration() -> None:
    reported = acknowledged_text(Change(kind="state", state="normal", lasted=200 * 60 * 10**9), Acknowledged())
    assert reported == "acknowledged, back to normal after 3 h 20 min of alarm"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0, "0 s"), (59.0, "59 s"), (60.0, "1 min"), (3599.0, "59 min 59 s"), (7200.0, "2 h"), (90000.0, "1 d 1 h")],
)
def test_durations_are_written_in_at_most_two_units(seconds: float, text: str) -> None:
    assert duration_text(seconds) == text
