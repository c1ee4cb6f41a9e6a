"""A failing database never stops the loop: items that it cannot take wait on disk, and the failure is reported."""

import sqlite3
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from daq import Event
from monitor.outputs.history import HistoryRecorder, HistoryStore, engines, recorder
from monitor.results.service_events import HistoryFailed, HistoryRecovered
from tests.support.monitor.history import change, rows, run_events, sqlite_url

EVENTS = run_events()
recording = partial(HistoryRecorder, keep_events=1000)


def until(condition: Callable[[], object], seconds: float = 5.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.01)


def test_all_entries_are_stored_at_the_end(tmp_path: Path) -> None:
    with recording(sqlite_url(tmp_path), tmp_path / "spool.jsonl") as made:
        for event in EVENTS:
            made.put(event)
    assert len(rows(sqlite_url(tmp_path), "windows")) == 20
    assert (list(made.events()), made.dropped) == ([], 0)
    assert not (tmp_path / "spool.jsonl").exists()


def test_entries_for_a_locked_database_are_spooled_to_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engines, "_BUSY_SECONDS", 0.02)
    url, spool = sqlite_url(tmp_path), tmp_path / "spool.jsonl"
    HistoryStore(url).__exit__()
    lock = sqlite3.connect(tmp_path / "history.sqlite", isolation_level=None)
    lock.execute("BEGIN EXCLUSIVE")
    with recording(url, spool, retry_seconds=0.05) as made:
        for event in EVENTS:
            made.put(event)
        until(spool.exists)
        assert made.problem is not None
        assert "locked" in made.problem
        lock.execute("ROLLBACK")
        lock.close()
        until(lambda: made.problem is None)
        assert not spool.exists()
    assert len(rows(url, "windows")) == 20
    failed, recovered = made.events()
    assert isinstance(failed, HistoryFailed)
    assert "locked" in failed.why
    assert recovered == HistoryRecovered(brought_in=len(EVENTS))


def test_unresponsive_database_is_reported_and_does_not_delay_shutdown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Items wait on disk, and are stored once if the database accepted them after all."""
    monkeypatch.setattr(engines, "_BUSY_SECONDS", 60.0)
    monkeypatch.setattr(recorder, "_MUTE", 0.1)
    monkeypatch.setattr(recorder, "_LAST", 0.1)
    url, spool = sqlite_url(tmp_path), tmp_path / "spool.jsonl"
    HistoryStore(url).__exit__()
    lock = sqlite3.connect(tmp_path / "history.sqlite", isolation_level=None)
    lock.execute("BEGIN EXCLUSIVE")
    with recording(url, spool) as mute:
        mute.put(EVENTS[0])
        until(lambda: mute.problem)
        for event in EVENTS[1:]:
            mute.put(event)
        [failed] = mute.events()
        assert isinstance(failed, HistoryFailed)
        assert "history.sqlite: no answer for" in failed.why
    lines = spool.read_text(encoding="utf-8").splitlines()
    assert len(lines) == len(EVENTS)
    lock.execute("ROLLBACK")
    lock.close()
    until(lambda: mute.problem is None)  # it has taken what was at hand
    assert spool.read_text(encoding="utf-8").splitlines() == lines
    with recording(url, spool) as made:
        until(lambda: not spool.exists())
    assert len(rows(url, "windows")) == 20
    assert list(made.events()) == [HistoryRecovered(brought_in=len(EVENTS))]


def test_unopenable_database_is_reported_once_and_entries_survive_a_restart(tmp_path: Path) -> None:
    url, spool, file = sqlite_url(tmp_path), tmp_path / "spool.jsonl", tmp_path / "history.sqlite"
    file.mkdir()
    with recording(url, spool, retry_seconds=0.01) as made:
        for event in EVENTS:
            made.put(event)
            time.sleep(0.01)
    [failed] = made.events()
    assert isinstance(failed, HistoryFailed)
    assert made.dropped == 0
    assert "unable to open database file" in failed.why
    file.rmdir()
    with spool.open("ab") as cut:
        cut.write(b'{"topic": "/event/g')  # a kill amid a line
    with recording(url, spool) as made:
        made.put(change(1, "watch"))
        until(lambda: not spool.exists())
    assert len(rows(url, "windows")) == 20


@pytest.mark.parametrize(
    "line", ["null", "{}", '{"topic": "/result/window", "time": 1, "payload": {"of": "another version"}}', "\x00", "{"]
)
def test_invalid_spool_lines_are_ignored(tmp_path: Path, line: str) -> None:
    spool = tmp_path / "spool.jsonl"
    spool.write_text(f"{line}\n", encoding="utf-8")
    with recording(sqlite_url(tmp_path), spool) as made:
        made.put(EVENTS[0])
        until(lambda: not spool.exists())
    assert len(rows(sqlite_url(tmp_path), "windows")) == 1
    assert made.problem is None


def test_entries_without_a_writable_spool_are_counted_as_dropped(tmp_path: Path) -> None:
    (tmp_path / "history.sqlite").mkdir()
    (tmp_path / "spool").write_text("a file where a folder should be", encoding="utf-8")
    with recording(sqlite_url(tmp_path), tmp_path / "spool" / "spool.jsonl") as made:
        for event in EVENTS:
            made.put(event)
    assert made.dropped == len(EVENTS)


def test_only_the_oldest_of_frequent_events_are_deleted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A plug that is loose for weeks fills no disk; alarms, their changes, windows and rarer events all stay."""
    monkeypatch.setattr(recorder, "_FORGET", 0.0)
    url = sqlite_url(tmp_path)
    gaps = [Event(topic="/event/gap", time=k, payload={"device": "left"}) for k in range(30)]
    lost = Event(topic="/event/device_failed", time=0, payload={"device": "left"})
    alarms = [change(k, "alarm" if k % 2 else "normal", lasted=None if k % 2 else 1.0) for k in range(1, 21)]
    with recording(url, tmp_path / "spool.jsonl", keep_events=5) as made:
        for event in (lost, *gaps, *alarms, *EVENTS):
            made.put(event)
    assert made.dropped == 0
    kept = [(row["topic"], row["time"]) for row in rows(url, "events")]
    newest = max(event.time for event in EVENTS if event.topic == "/event/gap")
    assert kept == [("/event/device_failed", 0), *(("/event/gap", k) for k in (26, 27, 28, 29, newest))]
    assert (len(rows(url, "alarms")), len(rows(url, "alarm_changes"))) == (11, 20 + 3)
    assert len(rows(url, "windows")) == 20
