"""Notices brought to one target by a thread of its own: on disk until delivered, and only so many an hour."""

import json
import math
import queue
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

from daq import FAILURES, Block, Item, SupervisedThread, error_text
from monitor.notice_text import Notice
from monitor.notices.news import News
from monitor.notices.senders import NoticeError, make_sender
from monitor.settings import NotifySettings
from monitor.spool import Spool
from monitor.words import utc

TOPIC_FAILED, TOPIC_BACK = "/event/notice_failed", "/event/notice_back"
_TICK = 0.2  # s
_HOUR = 3600.0  # s
_RETRY_FIRST, _RETRY_LONGEST = 10.0, 600.0  # s
_ASKED_LONGEST = _HOUR  # that a target may have us wait: one that asks for years is tried all the same
_AT_ONCE = 10**6  # notices that go out together: all that wait
_MUCH = 500_000  # bytes that wait, from which on troubles are only counted: there stays room for alarms
_DATA_SECONDS = 5.0  # without data, after which the heart no longer beats


class Courier:
    """Tells one target.

    Parameters
    ----------
    target : whom, and of what
    spool : file for what is not delivered yet; what an earlier run left there goes out first
    site : name of what is watched
    retry_seconds : before the second try; doubled with each
    """

    def __init__(self, target: NotifySettings, spool: Path, site: str, *, retry_seconds: float = _RETRY_FIRST) -> None:
        self._target, self._spool, self._site, self._first_retry = target, Spool(spool), site, retry_seconds
        self._send, self._news = make_sender(target), News(site)
        self._queue: queue.SimpleQueue[Notice] = queue.SimpleQueue()
        self._said: queue.SimpleQueue[tuple[str, dict[str, Any]]] = queue.SimpleQueue()
        self._thread = SupervisedThread(f"notices {spool.stem}", self._run)
        self._sent: deque[float] = deque()  # when messages went out in the last hour [s, monotonic]
        self._retry, self._beat_due = retry_seconds, 0.0
        self.due = 0.0  #: when what waits is tried again [s, monotonic]
        self._data_seen = -math.inf
        self._urgent = False  # an alarm waits
        self._left = self._spool.waiting  # what an earlier run could not deliver
        self.problem: str | None = None  #: why nothing goes out now
        self.dropped = 0  #: notices that were not kept, since the last that went out

    def go_on_from(self, before: "Courier") -> None:
        """Know what another one has told: that is no news any more."""
        self._news = before._news

    def put(self, item: Item) -> None:
        """Take what was logged, in the log's order; never waits."""
        if isinstance(item, Block):
            self._data_seen = time.monotonic()
            return
        notice = self._news.of(item)
        if notice is not None and notice.kind in self._target.on:
            self._queue.put(notice)

    def said(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield topic and payload of what befell the deliveries since the last time."""
        while not self._said.empty():
            yield self._said.get()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Try once more, for no longer than one delivery may take; what is left waits on disk for the next start."""
        self._thread.ending.set()
        self._thread.join(self._target.timeout_seconds + 1.0)

    def _run(self) -> None:
        going = True
        while going:
            going = not self._thread.ending.wait(_TICK)
            self._keep()
            self._deliver(last=not going)
            self._beat()

    def _keep(self) -> None:
        """Put what has come on disk before anything else: a kill from here on loses nothing."""
        while not self._queue.empty():
            notice = self._queue.get()
            if notice.kind == "trouble" and self._spool.size > _MUCH:
                self.dropped += 1
                continue
            if notice.kind == "alarm":
                self._urgent, self.due = True, 0.0  # tried at once, however long nothing has been taken
            self.dropped += self._spool.append([json.dumps(notice.values())])

    def _deliver(self, *, last: bool) -> None:
        now = time.monotonic()
        while self._sent and now - self._sent[0] > _HOUR:
            self._sent.popleft()
        enough = len(self._sent) >= self._target.per_hour and not self._urgent  # an alarm never waits for the hour
        if not self._spool.waiting or enough or (now < self.due and not last):
            return
        try:
            self._spool.deliver(self._send_lines, _AT_ONCE)
        except Exception as error:  # noqa: BLE001 - tried again, whatever it is
            self._fail(self._known(error))
            asked = min(error.wait, _ASKED_LONGEST) if isinstance(error, NoticeError) else 0.0
            self.due = time.monotonic() + max(self._retry, asked)
            self._retry = min(2 * self._retry, _RETRY_LONGEST)
        else:
            self._succeed()
            self._retry, self.due, self._urgent = self._first_retry, 0.0, False

    def _send_lines(self, lines: list[str]) -> None:
        notices = [Notice(**fields) for line in lines if (fields := json.loads(line)).keys() == _FIELDS]
        if notices:
            self._send(notices, self.dropped)
            self.dropped = 0
            self._sent.append(time.monotonic())

    def _fail(self, why: str) -> None:
        if self.problem is None:
            self._said.put((TOPIC_FAILED, {"to": self._where(), "why": why}))
        self.problem = why

    def _known(self, error: Exception) -> str:
        """Return why a delivery failed; what no sender should raise is counted."""
        if isinstance(error, NoticeError | OSError):
            return str(error)
        FAILURES.add(self._thread.name, error)
        return error_text(error)

    def _succeed(self) -> None:
        if self.problem is not None or self._left:
            self._said.put((TOPIC_BACK, {"to": self._where()}))
        self.problem, self._left = None, False

    def _where(self) -> str:
        """Name the target without what may be a secret in its address."""
        return "webhook" if self._target.webhook else "command" if self._target.command else "mqtt"

    def _beat(self) -> None:
        """Give a sign of life, but only while data flow: whoever waits for it is to miss it otherwise."""
        minutes, now = self._target.heartbeat_minutes, time.monotonic()
        if minutes is None or now < self._beat_due or now - self._data_seen > _DATA_SECONDS:
            return
        self._beat_due = now + 60 * minutes
        at = time.time_ns()
        beat = Notice(kind="heartbeat", site=self._site, time=at, utc=utc(at), state="", text="data flow")
        try:
            self._send([beat], 0)
        except Exception as error:  # noqa: BLE001 - likewise
            self._fail(self._known(error))
        else:
            if not self._spool.waiting:
                self._succeed()


_FIELDS = Notice.__dataclass_fields__.keys()
