"""A run in many files: each is complete, together they contain every item once, and the cut makes no gap."""

from pathlib import Path

import numpy as np
import pytest

from daq import (
    AnyLog,
    Assembler,
    Block,
    Channel,
    LogError,
    McapWriter,
    inspect_log,
    load_recordings,
    read_attachments,
    read_log,
)
from daq.log import PartedLog, RotatingWriter, Rotation, WriterThread, as_logs, files_of, log_info, newest_log
from tests.support.daq.blocks import START, contents, make_block, some_items

ATTACHED = {"site.toml": "state = 'x'\n"}
CHANNELS = (Channel(name="a_z", device="a", axis=2),)


def record(folder: Path, blocks: list[Block], rotation: Rotation, started: int = START) -> AnyLog:
    """Record blocks, flushing after each fourth; return the log."""
    folder.mkdir(exist_ok=True)
    recorder = RotatingWriter(folder, ATTACHED, started, rotation)
    for k, block in enumerate(blocks):
        recorder.write(block)
        if k % 4 == 3:
            recorder.flush()
    recorder.close()
    return newest_log(folder)


def sine(n_blocks: int) -> list[Block]:
    """Return 20 Hz at 1000 Hz on all axes, from blocks of a quarter of a second."""
    made = []
    for k in range(n_blocks):
        bare = make_block("a", 250 * k)
        wave = np.rint(1e6 * np.sin(2 * np.pi * 0.02 * np.arange(250 * k, 250 * k + 250))).astype(np.int32)
        made.append(Block(**{**vars(bare), "counts": np.repeat(wave[:, None], 3, 1)}))
    return made


@pytest.mark.parametrize("rotation", [Rotation(size=20_000), Rotation(seconds=2.0)], ids=["size", "time"])
def test_rotated_files_are_complete_and_hold_each_item_once(tmp_path: Path, rotation: Rotation) -> None:
    blocks = [make_block("a", 250 * k) for k in range(40)]
    log = record(tmp_path / "log", blocks, rotation)
    files = files_of(log)
    assert len(files) in {4, 5}  # of eight blocks or twelve: a quarter of a second of noise takes 3.7 kB
    assert contents(read_log(log)) == contents(blocks)
    for path in files:
        assert inspect_log(path).whole
        assert read_attachments(path) == ATTACHED
        assert log_info(path).devices["a"].missing == 0
    assert list(files) == sorted(files)  # named by the time of their first data
    info = log_info(log).devices["a"]
    assert (info.n_scans, info.missing, info.gaps) == (10_000, 0, 0)


def test_windows_across_rotated_files_equal_those_of_one_file(tmp_path: Path) -> None:
    blocks = sine(80)
    one = record(tmp_path / "one", blocks, Rotation())
    many = record(tmp_path / "many", blocks, Rotation(seconds=3.0))
    assert isinstance(one, Path)
    assert isinstance(many, PartedLog)
    (expected,) = load_recordings(one, channels=CHANNELS)
    (found,) = load_recordings(many, channels=CHANNELS)
    assert found.gaps == ()
    np.testing.assert_array_equal(found.data, expected.data)
    assert (found.start, found.rate) == (expected.start, expected.rate)
    alone = Assembler(CHANNELS, {"a": 1000.0}, window_seconds=2.0, step_seconds=2.0)
    live = [window for block in blocks for window in alone.push(block)]
    for window, logged in zip(live, load_recordings(many, window_seconds=2.0, channels=CHANNELS), strict=False):
        np.testing.assert_array_equal(logged.data, window.data)


def test_files_in_any_order_are_grouped_into_runs(tmp_path: Path) -> None:
    first = record(tmp_path / "log", sine(24), Rotation(seconds=2.0))
    second = record(tmp_path / "log", sine(24), Rotation(seconds=2.0), START + 60 * 10**9)
    single = tmp_path / "log" / "imported.mcap"
    McapWriter(single, ATTACHED).close()
    files = [*reversed(files_of(second)), single, *reversed(files_of(first))]
    assert as_logs(files) == [second, single, first]
    assert set(map(str, as_logs([tmp_path]))) == {str(first), str(second), str(single)}
    assert as_logs([files_of(first)[1]]) == [files_of(first)[1]]


def test_runs_started_in_same_second_get_different_file_names(tmp_path: Path) -> None:
    names = {files_of(record(tmp_path, sine(4), Rotation()))[0].name for _ in range(3)}
    assert names == {"20260101T000000Z.mcap", "20260101T000000Z_0001.mcap", "20260101T000000Z_0002.mcap"}


def test_missing_file_of_a_run_is_a_gap(tmp_path: Path) -> None:
    log = record(tmp_path, sine(40), Rotation(seconds=2.0))
    files = files_of(log)
    lost = log_info(files[1]).devices["a"].n_scans
    files[1].unlink()
    info = log_info(newest_log(tmp_path)).devices["a"]
    assert (info.n_scans, info.missing, info.gaps) == (10_000 - lost, lost, 1)


def test_folder_without_logs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"holds no log: expected \*\.mcap"):
        as_logs([tmp_path])


def test_writer_thread_rotates_files_at_flushes(tmp_path: Path) -> None:
    recorder = RotatingWriter(tmp_path, ATTACHED, START, Rotation(size=1.0))  # every flush fills a file
    with WriterThread(recorder, lambda item: None, chunk_seconds=0.0) as thread:
        for item in some_items():
            thread.put(item)
    assert thread.failure is None
    assert len(recorder.paths) == len(some_items())
    assert contents(read_log(PartedLog(tuple(recorder.paths)))) == contents(some_items())
