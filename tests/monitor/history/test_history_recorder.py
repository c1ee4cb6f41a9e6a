"""A database in trouble never stops the loop: what it cannot take waits on disk, and it is said."""

import sqlite3
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from history_helpers import change, rows, run_events, sqlite_url

from monitor.history import HistoryRecorder, store
from monitor.history.recorder import TOPIC_BACK, TOPIC_DOWN

EVENTS = run_events()


def until(condition: Callable[[], object], seconds: float = 5.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.01)


def test_what_is_put_in_is_there_at_the_end(tmp_path: Path) -> None:
    with HistoryRecorder(sqlite_url(tmp_path), tmp_path / "spool.jsonl") as recorder:
        for event in EVENTS:
            recorder.put(event)
    assert len(rows(sqlite_url(tmp_path), "windows")) == 20
    assert (list(recorder.said()), recorder.dropped) == ([], 0)
    assert not (tmp_path / "spool.jsonl").exists()


def test_locked_database_is_waited_for_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "_BUSY_SECONDS", 0.02)
    url, spool = sqlite_url(tmp_path), tmp_path / "spool.jsonl"
    store.HistoryStore(url).__exit__()
    lock = sqlite3.connect(tmp_path / "history.sqlite", isolation_level=None)
    lock.execute("BEGIN EXCLUSIVE")
    with HistoryRecorder(url, spool, retry_seconds=0.05) as recorder:
        for event in EVENTS:
            recorder.put(event)
        until(spool.exists)
        assert recorder.problem is not None
        assert "locked" in recorder.problem
        lock.execute("ROLLBACK")
        lock.close()
        until(lambda: recorder.problem is None)
        assert not spool.exists()
    assert len(rows(url, "windows")) == 20
    (down, why), (back, brought) = recorder.said()
    assert (down, back, brought) == (TOPIC_DOWN, TOPIC_BACK, {"brought_in": len(EVENTS)})
    assert "locked" in why["why"]


def test_damaged_database_is_said_once_and_the_next_start_goes_on(tmp_path: Path) -> None:
    url, spool, file = sqlite_url(tmp_path), tmp_path / "spool.jsonl", tmp_path / "history.sqlite"
    file.write_bytes(b"this is no database, and long enough not to be taken for an empty one" * 40)
    with HistoryRecorder(url, spool, retry_seconds=0.01) as recorder:
        for event in EVENTS:
            recorder.put(event)
            time.sleep(0.01)
    [(topic, payload)] = recorder.said()
    assert (topic, recorder.dropped) == (TOPIC_DOWN, 0)
    assert "file is not a database" in payload["why"]
    file.unlink()
    with spool.open("ab") as cut:
        cut.write(b'{"topic": "/event/g')  # a kill amid a line
    with HistoryRecorder(url, spool) as recorder:
        recorder.put(change(1, "watch"))
        until(lambda: not spool.exists())
    assert len(rows(url, "windows")) == 20


@pytest.mark.parametrize(
    "line", ["null", "{}", '{"topic": "/result/window", "time": 1, "payload": {"of": "another version"}}', "\x00", "{"]
)
def test_spool_that_holds_nonsense_does_no_harm(tmp_path: Path, line: str) -> None:
    spool = tmp_path / "spool.jsonl"
    spool.write_text(f"{line}\n", encoding="utf-8")
    with HistoryRecorder(sqlite_url(tmp_path), spool) as recorder:
        recorder.put(EVENTS[0])
        until(lambda: not spool.exists())
    assert len(rows(sqlite_url(tmp_path), "windows")) == 1
    assert recorder.problem is None


def test_what_finds_no_room_on_disk_is_counted(tmp_path: Path) -> None:
    (tmp_path / "history.sqlite").write_bytes(b"no database" * 100)
    (tmp_path / "spool").write_text("a file where a folder should be", encoding="utf-8")
    with HistoryRecorder(sqlite_url(tmp_path), tmp_path / "spool" / "spool.jsonl") as recorder:
        for event in EVENTS:
            recorder.put(event)
    assert recorder.dropped == len(EVENTS)
