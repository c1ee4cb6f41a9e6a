"""The log's thread: a slow disk never stops a reader."""

import queue
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, Self

from daq.supervision import FAILURES, SupervisedThread
from daq.types import Item

_LONGEST_PAUSE_SECONDS = 5.0  # before the thread is restarted: the queue holds a little more than that
_SYNC_SECONDS = 0.15  # maximum time between flushes to the disk [s]: more frequent ones wear out memory cards
_PAUSE = 0.05  # s between looks at the queue: to be woken by every item costs more than to write it


class ItemWriter(Protocol):
    """Writer of items to a disk: a `McapWriter` or a `RotatingWriter`."""

    def write(self, item: Item) -> None:
        """Take an item."""

    def hand_over(self) -> None:
        """Pass the data to the system: they survive a kill of this process."""

    def flush(self) -> None:
        """Write the data to the disk."""

    def close(self) -> None:
        """Bring it all to the disk; nothing more comes."""

    def abandon(self) -> None:
        """Leave it as it is: the disk takes no more."""


@dataclass(frozen=True, eq=False)
class _Switch:
    """From here on another log."""

    writer: ItemWriter
    then: Callable[[], None]


class WriterThread:
    """Writes a log in a thread of its own, so that a slow disk never stops a reader.

    Parameters
    ----------
    writer : the log; closed at the end
    on_written : called in the writer's thread with every item once it is in the log, in the log's order
    chunk_seconds : wall time from the first item of a chunk until the system has it, so that a kill loses nothing of it
        [s]; the disk has it at most 0.15 s later
    capacity : items of the queue; further items are dropped and counted
    """

    def __init__(
        self,
        writer: ItemWriter,
        on_written: Callable[[Item], None],
        *,
        chunk_seconds: float = 0.05,
        capacity: int = 20_000,
    ) -> None:
        self._writer, self._on_written, self._chunk_seconds = writer, on_written, chunk_seconds
        self._queue: queue.Queue[Item | _Switch] = queue.Queue(capacity)
        self._waits: float | None = None  # since when an item waits for a flush [s, monotonic]
        self._flushed = time.monotonic()
        self._sync_due = 0.0  # time of the next flush to the disk [s, monotonic]
        self._thread = SupervisedThread("log", self._run, longest_pause=_LONGEST_PAUSE_SECONDS, daemon=False)
        self.dropped = 0  #: items that found the queue full
        self.turned = time.monotonic()  #: time of the last completed disk operation [s, monotonic]
        #: reason why writing stopped for good; items are still passed to `on_written`
        self.failure: OSError | None = None

    def put(self, item: Item) -> None:
        """Take one item from any thread; never blocks."""
        try:
            self._queue.put_nowait(item)
        except queue.Full:
            self.dropped += 1
        if self._waits is None:  # tested after the put: `_flush_if_due` does it in the opposite order
            self._waits = time.monotonic()

    def switch(self, writer: ItemWriter, then: Callable[[], None]) -> None:
        """Write all later items to another log; earlier ones go to the old one.

        Parameters
        ----------
        writer : the other log
        then : called in the log's thread between the last item of the old log and the first of the new one
        """
        self._queue.put(_Switch(writer, then))

    @property
    def waiting(self) -> int:
        """Items that are not written yet."""
        return self._queue.qsize()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write the queued items and finish the file."""
        self._thread.ending.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._thread.ending.wait(min(_PAUSE, max(0.0, self._due - time.monotonic()))):
            self._write_queued()
            self._flush_if_due()
        self._write_queued()
        self._guarded(self._writer.close)

    @property
    def _due(self) -> float:
        """Time of the next flush [s, monotonic]; twice as late if there are no data."""
        waits = self._waits
        return self._flushed + 2 * self._chunk_seconds if waits is None else waits + self._chunk_seconds

    def _write_queued(self) -> None:
        for _ in range(self._queue.qsize()):
            item = self._queue.get_nowait()
            if isinstance(item, _Switch):
                self._guarded(self._writer.close)
                item.then()
                self._writer, self.failure = item.writer, None
                continue
            self._guarded(self._writer.write, item)
            FAILURES.attempt("log readers", self._on_written, item)
            self._flush_if_due(self._chunk_seconds)  # of very many

    def _flush_if_due(self, late: float = 0.0) -> None:
        """Flush if that is due for some seconds."""
        if time.monotonic() >= self._due + late:
            self._waits = None
            if not self._queue.empty():
                self._waits = time.monotonic()
            if time.monotonic() < self._sync_due:
                self._guarded(self._writer.hand_over)
            else:
                self._guarded(self._writer.flush)
                self._sync_due = time.monotonic() + min(3 * self._chunk_seconds, _SYNC_SECONDS)
            self._flushed = time.monotonic()
            if self.failure is None:
                self.turned = self._flushed

    def _guarded(self, action: Callable[..., None], *arguments: Item) -> None:
        """Do something to the file unless the disk has failed already: a full disk must not stop the watch."""
        if self.failure is None:
            try:
                action(*arguments)
            except OSError as error:
                self.failure = error
                self._writer.abandon()
            except Exception as error:  # noqa: BLE001 - one item or one flush, not the thread
                FAILURES.add("log", error)
