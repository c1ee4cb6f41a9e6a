"""SQLite files that are damaged, moved, deleted or replaced: noticed, reported, and nothing is lost."""

import shutil
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path

import pytest
from sqlalchemy.exc import OperationalError

from daq import Event
from daq.events import EventPayload
from monitor.outputs.history import HistoryRecorder, HistoryStore, Reader, Span, Writer, recorder
from monitor.outputs.history.sqlite import file as sqlite_file
from monitor.outputs.history.sqlite.renewal import salvage
from monitor.results.service_events import HistoryFailed, HistoryRecovered, HistoryRenewed, HistoryRestored
from tests.support.monitor.history import make_old, rows, run_events, sqlite_url

EVENTS = run_events()
N_GAPS = 1000
GAPS = [Event(topic="/event/gap", time=k, payload={"device": "left", "missing": k}) for k in range(N_GAPS)]
LATER = [Event(topic="/event/gap", time=N_GAPS + k, payload={"device": "left"}) for k in range(100)]
recording = partial(HistoryRecorder, keep_events=10**6, retry_seconds=0.2)


def until(condition: Callable[[], object], seconds: float = 10.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.01)


@contextmanager
def attacked(
    folder: Path, attack: Callable[[Path], None], monkeypatch: pytest.MonkeyPatch
) -> Iterator[list[EventPayload]]:
    """Record a run and many gaps, change the file, record more; yield the events, once it has ended."""
    monkeypatch.setattr(sqlite_file, "_CHECK_SECONDS", 0.3)
    monkeypatch.setattr(recorder, "_CHECK", 0.1)
    reported: list[EventPayload] = []
    file = folder / "history.sqlite"
    HistoryStore(sqlite_url(folder)).__exit__()

    def back() -> bool:
        reported.extend(made.events())
        return any(isinstance(event, HistoryRecovered) for event in reported)

    with recording(sqlite_url(folder), folder / "spool.jsonl") as made:
        for event in (*EVENTS, *GAPS):
            made.put(event)
        until(lambda: len(rows(sqlite_url(folder), "events")) > N_GAPS)
        attack(file)
        for event in LATER:
            made.put(event)
            time.sleep(0.002)
        until(back)
    reported += made.events()
    assert made.problem is None
    assert made.dropped == 0
    assert not (folder / "spool.jsonl").exists()
    yield reported


def _empty_journal(file: Path) -> None:
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def _overwrite(file: Path) -> None:
    """Damage four pages amid the file, as a failing disk does."""
    _empty_journal(file)
    pages = file.stat().st_size // 4096
    with file.open("r+b") as raw:
        raw.seek(pages // 2 * 4096)
        raw.write(b"\xa5" * 4 * 4096)


def _begin_with_nonsense(file: Path) -> None:
    """Damage the page that lists the tables."""
    _empty_journal(file)
    with file.open("r+b") as raw:
        raw.write(b"no database" * 100)


def _delete(file: Path) -> None:
    for path in file.parent.glob("history.sqlite*"):
        path.unlink()


def _move(file: Path) -> None:
    file.rename(file.with_name("moved.sqlite"))


def _replace(file: Path) -> None:
    other = file.with_name("other.sqlite")
    HistoryStore(f"sqlite:///{other}").__exit__()
    other.replace(file)


def _times(folder: Path) -> set[int]:
    return {row["time"] for row in rows(sqlite_url(folder), "events") if row["topic"] == "/event/gap"}


ALL = {event.time for event in (*EVENTS, *GAPS, *LATER) if event.topic == "/event/gap"}


@pytest.mark.parametrize("attack", [_delete, _move, _replace])
def test_removed_file_is_rewritten_with_all_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, attack: Callable[[Path], None]
) -> None:
    """It is still open, and is copied; data written into it before the deletion was noticed are there, too."""
    with attacked(tmp_path, attack, monkeypatch) as reported:
        assert isinstance(reported[0], HistoryFailed)
        assert "the file was" in reported[0].why
        assert any(isinstance(event, HistoryRenewed) for event in reported)
        assert _times(tmp_path) == ALL
        assert len(rows(sqlite_url(tmp_path), "windows")) == 20
    assert _whole(tmp_path / "history.sqlite")


@pytest.mark.parametrize(("attack", "lost"), [(_overwrite, 4 * 4096 // 40), (_begin_with_nonsense, N_GAPS)])
def test_damaged_file_is_set_aside_and_readable_rows_are_copied(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, attack: Callable[[Path], None], lost: int
) -> None:
    """Of pages that are overwritten their rows are lost, no others; later events and windows are all there."""
    with attacked(tmp_path, attack, monkeypatch) as reported:
        found = {type(event): event for event in reported}
        assert set(found) == {HistoryFailed, HistoryRenewed, HistoryRestored, HistoryRecovered}
        why = found[HistoryFailed].payload()["why"]
        assert "damaged" in why or "not a database" in why
        missing = ALL - _times(tmp_path)
        print(f"{attack.__name__}: {len(missing)} of {len(ALL)} gaps lost, {found[HistoryRestored]}")
        assert len(missing) <= lost
        assert not missing & {event.time for event in LATER}
    assert _whole(tmp_path / "history.sqlite")
    [aside] = tmp_path.glob("history_before_*.sqlite")
    assert aside.name == found[HistoryRestored].payload()["of"]


def _whole(file: Path) -> bool:
    with closing(sqlite3.connect(file)) as connection:
        return bool(connection.execute("PRAGMA integrity_check").fetchone()[0] == "ok")


def test_uncopied_rows_are_copied_at_the_next_start(tmp_path: Path) -> None:
    url = sqlite_url(tmp_path)
    with recording(url, tmp_path / "spool.jsonl") as made:
        for event in EVENTS:
            made.put(event)
    shutil.move(tmp_path / "history.sqlite", sqlite_file.unread_name(tmp_path / "history.sqlite"))
    with recording(url, tmp_path / "spool.jsonl") as made:
        until(lambda: not list(tmp_path.glob("*_unread*")))
    assert len(rows(url, "windows")) == 20
    assert [type(event) for event in made.events()] == [HistoryRestored]


def test_file_deleted_twice_within_the_retry_interval_is_restored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A new file is begun only each 10 s: until then the deleted one stays open, as it is only there so."""
    monkeypatch.setattr(recorder, "_CHECK", 0.1)
    monkeypatch.setattr(recorder, "_RENEW", 1.0)
    file = tmp_path / "history.sqlite"

    def all_gaps_are_there() -> bool:
        try:
            return file.exists() and len(rows(sqlite_url(tmp_path), "events")) == N_GAPS
        except OperationalError:  # the file is begun, its tables are not
            return False

    with recording(sqlite_url(tmp_path), tmp_path / "spool.jsonl") as made:
        for event in GAPS:
            made.put(event)
        until(all_gaps_are_there)
        for _ in range(2):
            file.unlink()
            until(file.exists)
            until(all_gaps_are_there)


def test_file_deleted_before_its_identity_is_read_is_reported_missing(tmp_path: Path) -> None:
    """As where it is deleted while it is being opened."""
    found = sqlite_file.SqliteFile(tmp_path / "history.sqlite")
    assert found.displacement() == "the file was moved or deleted"


def test_rows_written_to_a_server_are_not_held_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are written again into a new file only: a server's database is none."""
    HistoryStore(sqlite_url(tmp_path)).__exit__()
    with recording(sqlite_url(tmp_path), tmp_path / "spool.jsonl") as made:
        monkeypatch.setattr(recorder, "file_of", lambda _url: None)
        for event in GAPS:
            made.put(event)
        until(lambda: len(rows(sqlite_url(tmp_path), "events")) == N_GAPS)
    assert not made._unproven


def test_file_check_uses_at_most_two_percent_of_a_core(tmp_path: Path) -> None:
    """Looks are so far apart that they take 2 % of a core at most, however large the file."""
    HistoryStore(sqlite_url(tmp_path)).__exit__()
    file = sqlite_file.SqliteFile(tmp_path / "history.sqlite")
    assert (file.due, file.displacement(), file.damage()) == (False, None, None)
    assert 1 / sqlite_file._CHECK_SHARE <= 0.02


def test_rows_of_another_file_keep_their_sites_by_name(tmp_path: Path) -> None:
    """The numbers of the sites differ; rows of an earlier version belong to the site of the monitor."""
    source, target, old = tmp_path / "source.sqlite", tmp_path / "target.sqlite", tmp_path / "old.sqlite"
    gap = {
        name: Event(topic="/event/gap", time=k, payload={"device": name}) for k, name in enumerate(("tower", "bridge"))
    }
    for name, event in gap.items():
        with HistoryStore(f"sqlite:///{source}", Writer(site=name)) as store:
            store.write([event])
    HistoryStore(f"sqlite:///{target}", Writer(site="bridge")).__exit__()
    row = {"time": 7, "topic": "/event/gap", "device": "old", "json": "{}"}
    make_old(f"sqlite:///{old}", 2, {"events": row})
    assert sum(salvage(source, target)) == 2
    assert sum(salvage(old, target)) == 1
    for name, times in {"tower": [0], "bridge": [1, 7]}.items():
        with Reader(f"sqlite:///{target}", name) as reader:
            assert [found.time for found in reader.events(Span(start=0, end=10))] == times
