"""Files of a log that others move, delete or cut while it is written: a new one is begun, and the loss is reported."""

import shutil
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from daq import Block, Event, McapWriter, inspect_log, read_log
from daq.log import DiskGuard, ResilientWriter, Retention, RotatingWriter, WriterThread, resilient_writer
from tests.support.daq.blocks import make_block
from tests.support.monitor.notices import until

START = 10**18


def _delete(folder: Path) -> None:
    next(folder.glob("*.mcap")).unlink()


def _delete_folder(folder: Path) -> None:
    shutil.rmtree(folder)


def _move(folder: Path) -> None:
    file = next(folder.glob("*.mcap"))
    file.rename(folder.parent / "moved.mcap")


def _move_folder(folder: Path) -> None:
    folder.rename(folder.parent / "moved")


def _replace(folder: Path) -> None:
    file = next(folder.glob("*.mcap"))
    shutil.copy(file, folder.parent / "copy")
    (folder.parent / "copy").replace(file)


def _cut(folder: Path) -> None:
    """As a rotation of logs does that copies a file and empties it."""
    with next(folder.glob("*.mcap")).open("r+b") as file:
        file.truncate(600)


@pytest.mark.parametrize(
    ("attack", "how"),
    [
        (_delete, "deleted"),
        (_delete_folder, "deleted"),
        (_move, "moved"),
        (_move_folder, "moved"),
        (_replace, "deleted"),
        (_cut, "cut short"),
    ],
)
def test_new_log_file_is_started_and_loss_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, attack: Callable[[Path], None], how: str
) -> None:
    """Every scan is in a file, once, or counted as lost."""
    monkeypatch.setattr(resilient_writer, "_LOOK_SECONDS", 0.05)
    folder, reported = tmp_path / "logs", list[Event]()
    folder.mkdir()
    recorder = RotatingWriter(folder, {}, START)
    keeper = ResilientWriter(recorder, DiskGuard(folder, Retention()), reported.append)
    put = 0
    with WriterThread(keeper, lambda item: None, chunk_seconds=0.02) as log:

        def record(n_blocks: int) -> None:
            nonlocal put
            for _ in range(n_blocks):
                block = make_block("left", put)
                log.put(block)
                put = block.end_index
                time.sleep(0.002)

        record(30)
        until(lambda: recorder.size > 1000)
        attack(folder)
        record(60)
        until(lambda: len(recorder.paths) == 2)
        record(30)
    [lost] = [event.payload for event in reported if event.topic == "/event/log_file_lost"]
    assert lost["how"] == how
    files = [path for path in tmp_path.rglob("*") if path.is_file() and path.suffix == ".mcap"]
    kept = Counter(
        index
        for path in files
        for item in read_log(path)
        if isinstance(item, Block)
        for index in range(item.first_index, item.end_index)
    )
    copies = 2 if attack is _replace else 1  # what was deleted had been copied
    assert max(kept.values()) <= copies
    missing = set(range(put)) - set(kept)
    if how == "moved":
        assert (missing, Path(lost["to"]).exists(), keeper.problem) == (set(), True, None)
    else:
        assert len(missing) <= lost["lost"]["left"] == put - len(_after(recorder.paths[1]))
        assert keeper.problem == f"lost: {lost['lost']['left']} of left"
    assert all(inspect_log(path).whole for path in recorder.paths if path.exists() and attack is not _replace)


def test_truncated_log_file_is_detected_after_further_writes(tmp_path: Path) -> None:
    """The look may come only after further writes."""
    log = McapWriter(tmp_path / "a.mcap", {})
    for k in range(20):
        log.write(make_block("left", 100 * k))
    log.flush()
    size = log.size
    _cut(tmp_path)
    for k in range(20, 100):
        log.write(make_block("left", 100 * k))
        log.flush()
    assert (log.size > 2 * size, log.cut_short) == (True, True)
    log.forsake()


def _after(path: Path) -> set[int]:
    """Return the scans of the file that was begun then."""
    found = [item for item in read_log(path) if isinstance(item, Block)]
    return {index for block in found for index in range(block.first_index, block.end_index)}
