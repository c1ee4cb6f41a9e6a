"""Parts of logs: exactly the scans and events of a range, from the chunks near it alone."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from daq import Channel, Event, LogError, LogExcerpt, McapWriter, load_recordings, read_events, read_log
from daq.log import END, PartedLog, RotatingWriter, Rotation, log_info, log_span, newest_log
from tests.support.daq.blocks import START, contents, make_block

SECOND = 10**9
CHANNELS = (Channel(name="a", device="a", axis=0), Channel(name="b", device="b", axis=0))


def excerpt(log: Path | PartedLog, first: float, last: float) -> LogExcerpt:
    return LogExcerpt(log=log, start=START + round(first * SECOND), stop=START + round(last * SECOND), text="")


def write(folder: Path, seconds: int, rotation: Rotation | None = None) -> Path | PartedLog:
    """Write a log of one device, an event at each second, a chunk per second."""
    recorder = RotatingWriter(folder, {}, START, rotation)
    for k in range(seconds):
        recorder.write(Event(topic="/event/tick", time=START + k * SECOND, payload={"second": k}))
        for quarter in range(4):
            recorder.write(make_block("a", 1000 * k + 250 * quarter))
        recorder.flush()
    recorder.close()
    return newest_log(folder)


@pytest.mark.parametrize("rotation", [Rotation(), Rotation(seconds=7.0)], ids=["file", "run"])
def test_excerpt_holds_the_scans_and_events_of_its_range(tmp_path: Path, rotation: Rotation) -> None:
    log = write(tmp_path, 40, rotation)
    assert log_span(log) == (START, START + 40 * SECOND) == (log_info(log).start, log_info(log).end)
    part = excerpt(log, 12.1, 26.6)
    blocks = [item for item in read_log(part) if not isinstance(item, Event)]
    assert (blocks[0].first_index, blocks[-1].end_index) == (12_100, 26_600)
    assert all(a.end_index == b.first_index for a, b in pairwise(blocks))
    whole = np.concatenate([block.counts for block in read_log(log) if not isinstance(block, Event)])
    np.testing.assert_array_equal(np.concatenate([block.counts for block in blocks]), whole[12_100:26_600])
    assert [event.payload["second"] for event in read_events(part)] == list(range(13, 27))
    everything = LogExcerpt(log=log, stop=END, text="")
    assert contents(read_log(everything)) == contents(read_log(log))


def test_late_written_event_does_not_exclude_scans_from_excerpt(tmp_path: Path) -> None:
    """A file of a run begins with a result of 40 s before."""
    recorder = RotatingWriter(tmp_path, {}, START, Rotation(seconds=60.0))
    for k in range(80):
        if k == 61:
            recorder.write(Event(topic="/result/window", time=START + (k - 40) * SECOND, payload={"k": k}))
        for quarter in range(4):
            recorder.write(make_block("a", 1000 * k + 250 * quarter))
        recorder.flush()
    recorder.close()
    log = newest_log(tmp_path)
    for first, last in ((10, 55), (30, 50), (50, 58), (52, 70)):
        items = list(read_log(excerpt(log, first, last)))
        assert sum(item.n_scans for item in items if not isinstance(item, Event)) == 1000 * (last - first)
        assert sum(isinstance(item, Event) for item in items) == (first <= 21 < last)


def test_chunks_outside_the_excerpt_are_not_read(tmp_path: Path) -> None:
    log = write(tmp_path, 40)
    assert isinstance(log, Path)
    expected = contents(read_log(excerpt(log, 30, 35)))
    content = bytearray(log.read_bytes())
    content[len(content) * 4 // 10] ^= 1  # in the chunk of second 15 or 16; all have the same size
    log.write_bytes(content)
    with pytest.raises(LogError, match="is damaged before byte"):
        list(read_log(log))
    assert contents(read_log(excerpt(log, 30, 35))) == expected
    assert log_span(log) == (START, START + 40 * SECOND)
    with pytest.raises(LogError, match="is damaged before byte"):
        list(read_log(excerpt(log, 14, 18)))


def test_log_without_index_is_read_from_its_beginning(tmp_path: Path) -> None:
    log = write(tmp_path, 40)
    assert isinstance(log, Path)
    expected = contents(read_log(excerpt(log, 12.1, 26.6)))
    log.write_bytes(log.read_bytes()[: log.stat().st_size * 3 // 4])
    assert contents(read_log(excerpt(log, 12.1, 26.6))) == expected
    assert log_span(log) == (START, log_info(log).end)


def test_device_lost_before_the_excerpt_does_not_delay_its_start(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    writer = McapWriter(path, {})
    for first in range(0, 30_000, 250):
        writer.write(make_block("a", first))
        if not 5_000 <= first < 20_000:
            writer.write(make_block("b", first))
        if first == 6_000:
            writer.write(Event(topic="/event/device_failed", time=START + 6 * SECOND, payload={"device": "b"}))
    writer.close()
    (found,) = load_recordings(excerpt(path, 10, 28), channels=CHANNELS)
    assert abs(found.start - START - 10 * SECOND) < SECOND // 10
    assert abs(found.end - START - 28 * SECOND) < SECOND // 10
    assert np.isfinite(found.data[:, 0]).all()
    there = np.flatnonzero(np.isfinite(found.data[:, 1]))
    assert abs(there[0] - 10_000) < 100  # it is back at 20 s
