"""Deletion of recorded files when the disk fills, while recording continues."""

import os
import resource
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from daq import Block, Event, McapWriter, inspect_log, read_log
from daq.log import DiskGuard, PartedLog, ResilientWriter, Retention, RotatingWriter, Rotation, newest_log
from tests.support.daq.blocks import START, contents, make_block

EVERY_FLUSH = Rotation(size=1.0)  # fills a file


def run_of(folder: Path, n: int, started: int) -> list[Path]:
    """Record `n` files of a block each."""
    recorder = RotatingWriter(folder, {}, started, EVERY_FLUSH)
    for k in range(n):
        recorder.write(make_block("a", 250 * k))
        recorder.flush()
    recorder.close()
    return recorder.paths


def test_oldest_run_files_are_deleted_to_meet_size_limit(tmp_path: Path) -> None:
    later = run_of(tmp_path, 3, START + 10**12)
    older = run_of(tmp_path, 3, START)
    McapWriter(tmp_path / "imported.mcap", {}).close()
    (tmp_path / "notes.mcap").write_text("no log")
    size = later[0].stat().st_size
    guard = DiskGuard(tmp_path, Retention(size=3.5 * size))
    gone = []
    while surplus := guard.surplus():
        assert surplus.size == surplus.path.stat().st_size
        assert surplus.why.startswith("the logs use ")
        surplus.path.unlink()
        gone.append(surplus.path)
    assert gone == older


DAY = 86400


def gone(guard: DiskGuard) -> list[tuple[Path, str]]:
    """Delete files as required; return them, and the reason."""
    found = []
    while surplus := guard.surplus():
        surplus.path.unlink()
        found.append((surplus.path, surplus.why))
    return found


def written(paths: list[Path], days: Sequence[float]) -> None:
    """Date files, in days since now."""
    for path, day in zip(paths, days, strict=True):
        os.utime(path, (time.time() + DAY * day,) * 2)


def test_files_older_than_retention_time_are_deleted(tmp_path: Path) -> None:
    paths = run_of(tmp_path, 30, START)
    written(paths, [-0.15 * k for k in range(30, 0, -1)])
    found = gone(DiskGuard(tmp_path, Retention(seconds=2 * DAY)))
    assert [path for path, _ in found] == paths[:16]  # fourteen times 0.15 days are more than 2
    assert found[0][1] == "4.35 days were recorded since, more than 2"


@pytest.mark.parametrize("jump", [5000, -5000])
def test_clock_jump_of_years_deletes_at_most_one_file(tmp_path: Path, jump: int) -> None:
    """Nor does a pause of years: nothing has been recorded that could take its place."""
    paths = run_of(tmp_path, 22, START)
    written(paths, [*(-0.095 * k for k in range(20, 0, -1)), jump, jump])
    found = gone(DiskGuard(tmp_path, Retention(seconds=2 * DAY)))
    assert [path for path, _ in found] == (paths[:1] if jump > 0 else [])


def test_newest_file_is_never_deleted(tmp_path: Path) -> None:
    paths = run_of(tmp_path, 3, START)
    guard = DiskGuard(tmp_path, Retention(size=1.0))
    assert [path for path, _ in gone(guard)] == paths[:2]
    assert guard.surplus(full=True) is None


def test_file_being_written_is_not_deleted(tmp_path: Path) -> None:
    recorder = RotatingWriter(tmp_path, {}, START)
    newest = run_of(tmp_path, 2, START + 10**12)
    guard = DiskGuard(tmp_path, Retention(least_free=1e30))
    surplus = guard.surplus()
    recorder.close()
    assert guard.short
    assert surplus is not None
    assert surplus.path == newest[0]
    assert surplus.why.endswith(" GB are free, less than 1e+21")


def test_deletion_is_logged_before_file_is_deleted(tmp_path: Path) -> None:
    old = run_of(tmp_path, 3, START)
    stated: list[Event] = []

    def tell(event: Event) -> None:
        stated.append(event)
        assert (tmp_path / event.payload.get("file", old[-1].name)).exists()

    recorder = RotatingWriter(tmp_path, {}, START + 10**12)
    keeper = ResilientWriter(recorder, DiskGuard(tmp_path, Retention(least_free=1e30)), tell)
    keeper.write(make_block("a", 0))
    keeper.flush()
    keeper.close()
    assert [path.exists() for path in old] == [False, False, True]
    reported = [(event.topic, event.payload.get("file")) for event in stated]
    assert reported == [("/event/log_deleted", p.name) for p in old[:2]] + [("/event/disk_low", None)]
    assert contents(e for e in read_log(recorder.paths[0]) if isinstance(e, Event)) == contents(stated)
    assert keeper.problem is None


def all_blocks(paths: list[Path]) -> list[Block]:
    return [item for item in read_log(PartedLog(tuple(paths))) if isinstance(item, Block)]


def test_new_file_is_started_without_loss_at_file_size_limit(tmp_path: Path) -> None:
    blocks = [make_block("a", 250 * k) for k in range(60)]  # 3.7 kB each
    stated: list[Event] = []
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, hard))
    try:
        recorder = RotatingWriter(tmp_path, {}, START)
        keeper = ResilientWriter(recorder, DiskGuard(tmp_path, Retention()), stated.append)
        for k, block in enumerate(blocks):
            keeper.write(block)
            if k % 4 == 3:
                keeper.flush()
        keeper.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert contents(all_blocks(recorder.paths)) == contents(blocks)
    assert len(recorder.paths) > 3
    topics = [event.topic for event in stated]
    assert topics == ["/event/recording_failed", "/event/recording_recovered"] * (len(recorder.paths) - 1)
    assert {event.payload["why"] for event in stated[::2]} == {"[Errno 27] File too large"}
    for path in recorder.paths:
        assert inspect_log(path).lost_bytes == 0  # cut back to its last flush


def test_scans_beyond_memory_buffer_are_counted_as_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorder = RotatingWriter(tmp_path, {"site.toml": "x = 1"}, START)
    stated: list[Event] = []
    keeper = ResilientWriter(recorder, DiskGuard(tmp_path, Retention()), stated.append, kept=10)
    monkeypatch.setattr("daq.log.resilient_writer._RETRY_SECONDS", 0.0)
    with monkeypatch.context() as failing:
        failing.setattr(os, "fdatasync", no_space)
        for k in range(20):
            keeper.write(make_block("a", 250 * k))
            keeper.flush()
        stopped = keeper.problem
    for k in range(20, 24):
        keeper.write(make_block("a", 250 * k))
        keeper.flush()
    keeper.close()
    assert stopped == "[Errno 28] No space left on device; lost: 2750 of a"
    assert keeper.problem == "lost: 3000 of a"  # nine blocks and an event were kept; the 21st came before the next try
    assert stated[-1].payload == {"kept": 10, "lost": {"a": 3000}}
    indices = [block.first_index // 250 for block in all_blocks(recorder.paths)]
    assert indices == [*range(9), 21, 22, 23]
    assert newest_log(tmp_path) == PartedLog(tuple(recorder.paths))
    assert all(inspect_log(path).whole for path in recorder.paths)


@pytest.mark.parametrize(("number", "left"), [(28, 0), (122, 0), (5, 3), (27, 3), (30, 3)])
def test_old_files_are_deleted_only_for_disk_full_errors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, left: int
) -> None:
    """A disk that is full or a quota that is used up, not one that is broken, read-only or takes no longer files."""
    old = run_of(tmp_path, 3, START)
    recorder = RotatingWriter(tmp_path, {}, START + 10**12)
    keeper = ResilientWriter(recorder, DiskGuard(tmp_path, Retention()), lambda event: None)

    def refused(_: int) -> None:
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as failing:
        failing.setattr(os, "fdatasync", refused)
        keeper.write(make_block("a", 0))
        keeper.flush()
    assert keeper.problem == f"[Errno {number}] {os.strerror(number)}"
    assert sum(path.exists() for path in old) == left
    keeper.close()
    assert keeper.problem is None
    assert contents(all_blocks(recorder.paths)) == contents([make_block("a", 0)])


def test_items_not_written_at_close_are_counted_as_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keeper = ResilientWriter(RotatingWriter(tmp_path, {}, START), DiskGuard(tmp_path, Retention()), lambda event: None)
    for k in range(2):
        keeper.write(make_block("a", 250 * k))
        keeper.flush()
    monkeypatch.setattr(os, "fdatasync", no_space)
    keeper.write(make_block("a", 500))
    keeper.close()
    assert keeper.problem == "[Errno 28] No space left on device; lost: 250 of a, 1 of events"
    assert len(all_blocks(list(tmp_path.glob("*.mcap")))) == 2


def no_space(number: int) -> None:
    raise OSError(28, "No space left on device")
