"""Writer of logged items to the database in its own thread, with a spool on disk."""

import json
import queue
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Self

from daq import Event, Item
from daq.events import EventPayload
from daq.supervision import SupervisedThread
from monitor.outputs.history.engines import HistoryError, file_of, shown_url
from monitor.outputs.history.sites import ONLY_SITE, SiteState, StateSchedule, Writer
from monitor.outputs.history.sqlite.renewal import Takeover, renew_file
from monitor.outputs.history.store import HistoryStore
from monitor.outputs.spool import Spool
from monitor.results.service_events import HistoryFailed, HistoryRecovered

_CHECK = 1.0  # s between looks at whether the file is still the one that was opened
_RENEW = 10.0  # s between new files: a disk that damages each of them is not to be filled with them
_CAPACITY = 10_000  # items that may wait in memory
_BATCH = 500  # items a transaction
_POLL = 0.5  # s
_MUTE = 15.0  # s that a database may take over a batch: longer than it may be locked, or gone
_FORGET = 3600.0  # s between looks at whether there are too many events or diagnoses
_LAST = 5.0  # s that an end waits for it


class HistoryRecorder:
    """Puts results and events into the history; nothing here ever waits for the database but its own thread.

    Parameters
    ----------
    url : of the database
    spool : file for items that the database cannot store; items of an earlier run go in first
    keep_events : newest events of each kind that stay
    keep_days : newest days whose windows stay one by one; None for all
    writer : site that the rows belong to
    retry_seconds : between looks at a database in trouble
    """

    def __init__(
        self,
        url: str,
        spool: Path,
        *,
        keep_events: int,
        keep_days: float | None = None,
        writer: Writer = ONLY_SITE,
        retry_seconds: float = 10.0,
    ) -> None:
        self._url, self._spool, self._retry_seconds = url, Spool(spool), retry_seconds
        self._keep_events, self._keep_days, self._forget_due = keep_events, keep_days, 0.0
        self._writer = writer
        self._state: SiteState | None = None  # the newest
        self._schedule = StateSchedule()
        self._queue: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
        self._events: queue.SimpleQueue[EventPayload] = queue.SimpleQueue()
        self._thread = SupervisedThread("history", self._run)
        self._store: HistoryStore | None = None
        self._due = 0.0  # monotonic time of the next look at the database
        self._failed: str | None = None  # reason of the last failure
        self._asked: float | None = None  # monotonic time since which it has owed an answer [s]
        self._down = False  # whether it was reported
        self._at_hand: list[Event] = []  # the batch that is being brought
        self._check_due = self._renew_due = 0.0  # monotonic times of the next look at the file, and of a new one [s]
        self._unproven: deque[Event] = deque(maxlen=_CAPACITY)  # written since the file was known to be whole
        self._takeover = Takeover(file_of(url))
        self._given_up = False  # the items have been put on disk by another thread
        self.dropped = 0  #: items that found no room, in memory or on disk, or that no database takes

    def put(self, item: Item) -> None:
        """Add a logged item, from any thread; measured values are not for the history."""
        if isinstance(item, Event) and not item.topic.startswith("/measured/"):
            if self._queue.qsize() < _CAPACITY:
                self._queue.put(item)
            else:
                self.dropped += 1

    def put_state(self, state: SiteState) -> None:
        """Replace the present state of the site, from any thread; only the newest one is written, none is spooled."""
        self._state = state

    @property
    def problem(self) -> str | None:
        """Why the database takes nothing now; None if it does."""
        asked = self._asked
        mute = 0.0 if asked is None else time.monotonic() - asked
        return f"{shown_url(self._url)}: no answer for {mute:.0f} s" if mute > _MUTE else self._failed

    def events(self) -> Iterator[EventPayload]:
        """Yield the events of the database since the last call."""
        if problem := self.problem:
            self._say_down(problem)
        while not self._events.empty():
            yield self._events.get()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def stop(self) -> None:
        """Request the thread to write the waiting items, and to end."""
        self._thread.ending.set()
        self._queue.put(None)

    def __exit__(self, *_: object) -> None:
        """Write the waiting items, or leave them on disk for the next start if the database does not respond."""
        self.stop()
        self._thread.join(_LAST)
        if self._thread.is_alive():
            self._given_up = True
            kept = list(self._at_hand)  # the database may have them already: they are stored once in any case
            while not self._queue.empty():
                kept += filter(None, (self._queue.get(),))
            self._keep(kept)

    def _run(self) -> None:
        self._keep(self._at_hand)  # a batch that an unforeseen exception has interrupted
        self._at_hand = []
        going = True
        while going and not self._given_up:
            self._at_hand, going = self._gather()
            self._check(whole=not going)
            if self._store and self._takeover.pending:
                self._keep(self._at_hand)
                done = self._takeover.advance(_POLL)
                if done:
                    self._events.put(done)
                    self._due = 0.0
            else:
                self._bring(self._at_hand)
                self._write_state()
            self._at_hand = []
        if self._store:
            self._store.__exit__()

    def _check(self, *, whole: bool) -> None:
        """Check the file once per second; items written since the last intact check are kept for a new file."""
        if self._store is None or not (whole or time.monotonic() >= self._check_due):
            return
        self._check_due = time.monotonic() + _CHECK
        try:
            if self._store.check(whole=whole):
                self._unproven.clear()
        except HistoryError as error:
            self._fail(error)

    def _renew(self, why: str) -> None:
        """Begin a new file in the place of one that cannot be used any more."""
        path = file_of(self._url)
        if path is None or time.monotonic() < self._renew_due:
            return
        self._renew_due = time.monotonic() + _RENEW
        store, self._store = self._store, None
        try:
            renewed = renew_file(path, store, why)
        except OSError as error:
            self._failed = f"{why}; it cannot be renamed: {error}"
            return
        self._keep(list(self._unproven))
        self._unproven.clear()
        self._events.put(renewed)
        self._due = 0.0

    def _gather(self) -> tuple[list[Event], bool]:
        """Return the items that arrive within a moment, and whether more may come."""
        batch: list[Event] = []
        if self._thread.ending.is_set() and self._queue.empty():
            return batch, False
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
        """Write a batch, after the items on disk; or put it there too."""
        waiting = self._spool.waiting or self._takeover.pending
        if not batch and not (waiting and time.monotonic() >= self._due):
            return
        if self._failed and time.monotonic() < self._due:
            self._keep(batch)
            return
        try:
            if self._opened():
                self._keep(batch)
                return
            kept = self._spool.deliver(lambda lines: self._write(_from_lines(lines)), _BATCH)
            if batch:
                self._write(batch)
        except (HistoryError, OSError) as error:
            if not self._given_up:
                self._fail(error)
                self._keep(batch)
        else:
            if self._down or kept:  # by an earlier run, maybe
                self._events.put(HistoryRecovered(brought_in=kept))
            self._failed, self._down = None, False

    def _write(self, items: list[Event]) -> None:
        self._asked = time.monotonic()
        try:
            store = self._store = self._store or HistoryStore(self._url, self._writer)
            self.dropped += store.write(items)
            if file_of(self._url):  # no server's database is checked as a file: nothing would end its list
                self._unproven.extend(items)
            if time.monotonic() >= self._forget_due:
                store.forget(self._keep_events, self._keep_days)
                self._forget_due = time.monotonic() + _FORGET
        finally:
            self._asked = None
        if self._given_up:
            raise HistoryError(shown_url(self._url), "it arrived too late")  # so that the spool stays as it is

    def _write_state(self) -> None:
        """Write the state if it has changed, or after a while; not while the database is in trouble."""
        state = self._state
        if state is None or self._given_up or (self._failed and time.monotonic() < self._due):
            return
        if not self._schedule.is_due(state.content):
            return
        self._asked = time.monotonic()
        try:
            self._store = self._store or HistoryStore(self._url, self._writer)
            self._store.write_state(state)
        except HistoryError as error:
            self._fail(error)
        else:
            self._schedule.note_written(state.content)
        finally:
            self._asked = None

    def _opened(self) -> bool:
        """Open a database that must first copy rows of another one; return whether it must.

        Raises
        ------
        HistoryError
            If it cannot be opened.
        """
        if self._takeover.pending:
            self._store = self._store or HistoryStore(self._url, self._writer)
        return self._takeover.pending

    def _say_down(self, why: str) -> None:
        if not self._down:
            self._down = True
            self._events.put(HistoryFailed(why=why))

    def _fail(self, error: Exception) -> None:
        self._failed = str(error)
        self._say_down(self._failed)
        self._due = time.monotonic() + self._retry_seconds
        if isinstance(error, HistoryError) and error.unusable:
            self._renew(self._failed)
        if self._store and not self._store.displaced:  # a displaced file is only there while it is open
            self._store.__exit__()
            self._store = None

    def _keep(self, batch: list[Event]) -> None:
        self.dropped += self._spool.append(
            json.dumps({"topic": item.topic, "time": item.time, "payload": item.payload}) for item in batch
        )


def _from_lines(lines: list[str]) -> list[Event]:
    """Return the items in complete lines; lines of other programs are left out."""
    found = [json.loads(line) for line in lines]
    return [Event(**fields) for fields in found if fields.keys() == {"topic", "time", "payload"}]
