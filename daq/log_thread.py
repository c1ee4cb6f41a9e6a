"""The log's thread: a slow disk never stops a reader."""

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, Self

from daq.log import Item

_PAUSE = 0.05  # s between looks at the queue: to be woken by every item costs more than to write it


class ItemWriter(Protocol):
    """What takes items to a disk: a `LogWriter` or a `LogRecorder`."""

    def write(self, item: Item) -> None:
        """Take an item."""

    def flush(self) -> None:
        """Bring what was taken to the disk."""

    def close(self) -> None:
        """Bring it all to the disk; nothing more comes."""

    def abandon(self) -> None:
        """Leave it as it is: the disk takes no more."""


@dataclass(frozen=True, eq=False)
class _Switch:
    """From here on another log."""

    writer: ItemWriter
    then: Callable[[], None]


class LogThread:
    """Writes a log in a thread of its own, so that a slow disk never stops a reader.

    Parameters
    ----------
    writer : the log; closed at the end
    on_written : called in the writer's thread with every item once it is in the log, in the log's order
    chunk_seconds : of wall time between flushes
    capacity : items the queue holds; what comes when it is full is dropped and counted
    """

    def __init__(
        self,
        writer: ItemWriter,
        on_written: Callable[[Item], None],
        *,
        chunk_seconds: float = 0.2,
        capacity: int = 20_000,
    ) -> None:
        self._writer, self._on_written, self._chunk_seconds = writer, on_written, chunk_seconds
        self._queue: queue.Queue[Item | _Switch] = queue.Queue(capacity)
        self._ending = threading.Event()
        self._due = time.monotonic() + chunk_seconds  # of the next flush
        self._thread = threading.Thread(target=self._run, name="log")
        self.dropped = 0  #: items that found the queue full
        self.turned = time.monotonic()  #: when the disk was last done with what it was asked [s, monotonic]
        self.failure: OSError | None = None  #: why writing stopped; items go on to `on_written`

    def put(self, item: Item) -> None:
        """Take one item from any thread; never blocks."""
        try:
            self._queue.put_nowait(item)
        except queue.Full:
            self.dropped += 1

    def switch(self, writer: ItemWriter, then: Callable[[], None]) -> None:
        """Have all that is put from now on written to another log; what was put before goes to the old one.

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
        """Write what is queued, finish the file."""
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ending.wait(min(_PAUSE, max(0.0, self._due - time.monotonic()))):
            self._write_queued()
            self._flush_if_due()
        self._write_queued()
        self._guarded(self._writer.close)

    def _write_queued(self) -> None:
        for _ in range(self._queue.qsize()):
            item = self._queue.get_nowait()
            if isinstance(item, _Switch):
                self._turn_to(item)
                continue
            self._guarded(self._writer.write, item)
            self._on_written(item)
            self._flush_if_due()

    def _flush_if_due(self) -> None:
        if time.monotonic() >= self._due:
            self._guarded(self._writer.flush)
            self.turned = time.monotonic()
            self._due = time.monotonic() + self._chunk_seconds

    def _turn_to(self, switch: _Switch) -> None:
        """Finish the log and go on with another."""
        self._guarded(self._writer.close)
        self._writer, self.failure = switch.writer, None
        switch.then()

    def _guarded(self, action: Callable[..., None], *arguments: Item) -> None:
        """Do something to the file unless the disk has failed already: a full disk must not stop the watch."""
        if self.failure is None:
            try:
                action(*arguments)
            except OSError as error:
                self.failure = error
                self._writer.abandon()
