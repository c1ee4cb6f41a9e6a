"""The log's thread: nothing blocks a reader, neither a full queue nor a full disk."""

import errno
import resource
import threading
import time
from pathlib import Path

import pytest

from daq import Item, McapWriter, read_log
from daq.log import WriterThread
from tests.support.daq.blocks import contents, some_items


def test_thread_writes_in_order_and_passes_on_each_item(tmp_path: Path) -> None:
    reported: list[Item] = []
    with WriterThread(McapWriter(tmp_path / "log.mcap", {}), reported.append, chunk_seconds=0.01) as thread:
        for item in some_items():
            thread.put(item)
            time.sleep(0.002)
    assert contents(reported) == contents(some_items()) == contents(read_log(tmp_path / "log.mcap"))
    assert (thread.dropped, thread.failure) == (0, None)


def test_items_put_into_full_queue_are_counted_as_dropped(tmp_path: Path) -> None:
    thread = WriterThread(McapWriter(tmp_path / "log.mcap", {}), lambda item: None, capacity=3)
    for item in some_items()[:10]:
        thread.put(item)  # the thread is not started yet: nothing leaves the queue
    assert thread.dropped == 7
    with thread:
        pass
    assert contents(read_log(tmp_path / "log.mcap")) == contents(some_items()[:3])


@pytest.mark.parametrize("failing", ["write", "flush"])
def test_thread_passes_on_items_after_disk_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    writer = McapWriter(tmp_path / "log.mcap", {})
    writer.write(some_items()[0])
    writer.flush()

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writer, failing, fail)
    reported: list[Item] = []
    thread = WriterThread(writer, reported.append, chunk_seconds=0.0)
    turned = thread.turned
    for item in some_items():
        thread.put(item)
    with thread:
        pass
    assert thread.turned == turned  # no sign of life of a disk that takes nothing
    assert contents(reported) == contents(some_items())
    assert thread.failure is not None
    assert thread.failure.errno == 28
    assert contents(read_log(tmp_path / "log.mcap")) == contents(some_items()[:1])


def test_thread_passes_on_items_at_file_size_limit(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    writer = McapWriter(path, {})
    reported: list[Item] = []
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 20_000, hard))
    try:
        with WriterThread(writer, reported.append, chunk_seconds=0.0) as thread:
            for item in some_items():
                thread.put(item)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert contents(reported) == contents(some_items())
    assert thread.failure is not None
    assert thread.failure.errno == errno.EFBIG
    found = contents(read_log(path))
    assert 0 < len(found) < len(reported)
    assert found == contents(reported)[: len(found)]


class _Counted:
    """A writer that counts the items it was given, and those that it has flushed."""

    def __init__(self) -> None:
        self.written = self.flushed = 0

    def write(self, item: Item) -> None:
        self.written += 1

    def hand_over(self) -> None:
        """Give nothing to the disk."""

    def flush(self) -> None:
        self.flushed = self.written

    def close(self) -> None:
        """Keep the count: only flushes in time are tested."""

    abandon = close


def test_items_of_several_threads_are_flushed_without_new_items() -> None:
    writer, items = _Counted(), some_items()

    def put() -> None:
        for item in items:
            thread.put(item)

    with WriterThread(writer, lambda item: None, chunk_seconds=0.02) as thread:
        readers = [threading.Thread(target=put) for _ in range(4)]
        for reader in readers:
            reader.start()
        for reader in readers:
            reader.join()
        end = time.monotonic() + 10
        while writer.flushed < 4 * len(items) and time.monotonic() < end:
            time.sleep(0.01)
        assert writer.flushed == 4 * len(items)
