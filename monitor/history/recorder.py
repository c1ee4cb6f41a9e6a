"""What is logged goes into the database in a thread of its own; what it cannot take waits on disk."""

import json
import queue
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

from daq import Event, Item
from monitor.history.errors import HistoryError
from monitor.history.store import HistoryStore
from monitor.spool import Spool

TOPIC_DOWN, TOPIC_BACK = "/event/history_down", "/event/history_back"
_CAPACITY = 10_000  # items that may wait in memory
_BATCH = 500  # items a transaction
_POLL = 0.5  # s


class HistoryRecorder:
    """Puts results and events into the history; nothing here ever waits for the database but its own thread.

    Parameters
    ----------
    url : of the database
    spool : file for what the database cannot take; what an earlier run left there goes in first
    retry_seconds : between looks at a database in trouble
    """

    def __init__(self, url: str, spool: Path, *, retry_seconds: float = 10.0) -> None:
        self._url, self._spool, self._retry_seconds = url, Spool(spool), retry_seconds
        self._queue: queue.Queue[Event | None] = queue.Queue(_CAPACITY)
        self._said: queue.SimpleQueue[tuple[str, dict[str, Any]]] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="history")
        self._store: HistoryStore | None = None
        self._due = 0.0  # monotonic time of the next look at the database
        self.problem: str | None = None  #: why the database takes nothing now
        self.dropped = 0  #: items that found no room, in memory or on disk, or that no database takes

    def put(self, item: Item) -> None:
        """Take what was logged, from any thread; what was measured is not for the history."""
        if isinstance(item, Event) and not item.topic.startswith("/measured/"):
            try:
                self._queue.put_nowait(item)
            except queue.Full:
                self.dropped += 1

    def said(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield topic and payload of what befell the database since the last time."""
        while True:
            try:
                yield self._said.get_nowait()
            except queue.Empty:
                return

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Bring in what waits, or leave it on disk for the next start."""
        self._queue.put(None)
        self._thread.join()

    def _run(self) -> None:
        going = True
        while going:
            batch, going = self._gather()
            self._bring(batch)
        if self._store:
            self._store.__exit__()

    def _gather(self) -> tuple[list[Event], bool]:
        """Return what has come within a moment, and whether more may come."""
        batch: list[Event] = []
        try:
            item = self._queue.get(timeout=_POLL)
            while item is not None:
                batch.append(item)
                if len(batch) >= _BATCH:
                    return batch, True
                item = self._queue.get_nowait()
        except queue.Empty:
            return batch, True
        return batch, False

    def _bring(self, batch: list[Event]) -> None:
        """Write a batch, after what waits on disk; or put it there too."""
        if not batch and not (self._spool.waiting and time.monotonic() >= self._due):
            return
        if self.problem and time.monotonic() < self._due:
            self._keep(batch)
            return
        try:
            store = self._open()
            kept = self._spool.deliver(lambda lines: self._write(store, _from_lines(lines)), _BATCH)
            if batch:
                self._write(store, batch)
        except (HistoryError, OSError) as error:
            self._fail(error)
            self._keep(batch)
        else:
            if self.problem:
                self._said.put((TOPIC_BACK, {"brought_in": kept}))
            self.problem = None

    def _write(self, store: HistoryStore, items: list[Event]) -> None:
        self.dropped += store.write(items)

    def _open(self) -> HistoryStore:
        if self._store is None:
            self._store = HistoryStore(self._url)
        return self._store

    def _fail(self, error: Exception) -> None:
        if self.problem is None:
            self._said.put((TOPIC_DOWN, {"why": str(error)}))
        self.problem = str(error)
        self._due = time.monotonic() + self._retry_seconds
        if self._store:
            self._store.__exit__()
            self._store = None

    def _keep(self, batch: list[Event]) -> None:
        self.dropped += self._spool.append(_to_line(item) for item in batch)


def _to_line(item: Event) -> str:
    return json.dumps({"topic": item.topic, "time": item.time, "payload": item.payload})


def _from_lines(lines: list[str]) -> list[Event]:
    """Return the items that whole lines stand for; what somebody else wrote there is left out."""
    found = [json.loads(line) for line in lines]
    return [Event(**fields) for fields in found if fields.keys() == {"topic", "time", "payload"}]
