"""Notices brought to one target: alarms in a lane of their own, everything else in another."""

import math
import queue
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Self

from daq import Block, Item
from daq.events import EventPayload
from monitor.outputs.notices.filter import NoticeFilter
from monitor.outputs.notices.lane import Lane, Quota
from monitor.outputs.notices.transports import make_sender
from monitor.results.service_events import NoticeFailed, NoticeRecovered
from monitor.settings import NotifySettings
from monitor.text.notices import Notice
from monitor.text.quantities import utc

_RETRY_FIRST = 10.0  # s
_DATA_SECONDS = 5.0  # without data, after which the heart no longer beats
_OTHERS = ("trouble", "trend")  # kinds of notices that are no change of an alarm


class NoticeSender:
    """Delivers notices to one target; the deliveries of its lanes never wait for each other.

    Parameters
    ----------
    target : settings of the target
    spool : file for alarms that are not delivered yet, with another one for other notices next to it; notices of an
        earlier run are sent first
    site : name of the site
    retry_seconds : before the second try; doubled with each
    """

    def __init__(self, target: NotifySettings, spool: Path, site: str, *, retry_seconds: float = _RETRY_FIRST) -> None:
        self._target, self._site, self._news = target, site, NoticeFilter(site)
        self._events: queue.SimpleQueue[EventPayload] = queue.SimpleQueue()
        self._lock, self._failing = threading.Lock(), False
        quota = Quota(target.max_per_hour)
        common = quota, retry_seconds, self._report
        self.alarms = Lane(make_sender(target), spool, *common)  #: lane of changes of an alarm
        other = spool.with_stem(f"{spool.stem}_other")
        self.others = Lane(make_sender(target), other, *common, self._heartbeat)  #: lane of all the rest
        self._lanes = self.alarms, self.others
        self._beat_due = 0.0
        self._data_seen = -math.inf

    def continue_from(self, before: "NoticeSender") -> None:
        """Take over from another one that is ending: its notices are not sent again."""
        self._news = before._news
        for lane, former in zip(self._lanes, before._lanes, strict=True):
            lane.wait_for(former)

    def put(self, item: Item) -> None:
        """Add a logged item, in the log's order; never blocks."""
        if isinstance(item, Block):
            self._data_seen = time.monotonic()
            return
        notice = self._news.of(item)
        if notice is not None and notice.kind in self._target.events:
            (self.others if notice.kind in _OTHERS else self.alarms).put(notice)

    def events(self) -> Iterator[EventPayload]:
        """Yield the events of the deliveries since the last call."""
        while not self._events.empty():
            yield self._events.get()

    @property
    def problem(self) -> str | None:
        """Why nothing goes out now."""
        return next((lane.problem for lane in self._lanes if lane.problem), None)

    def __enter__(self) -> Self:
        for lane in self._lanes:
            lane.thread.start()
        return self

    def stop(self) -> None:
        """Request both lanes to try once more, and to end; the rest waits on disk for the next start."""
        for lane in self._lanes:
            lane.thread.ending.set()

    def __exit__(self, *_: object) -> None:
        """End, after no longer than one delivery may take."""
        self.stop()
        end = time.monotonic() + self._target.timeout_seconds + 1.0
        for lane in self._lanes:
            lane.thread.join(max(0.0, end - time.monotonic()))

    def _report(self, changed: Lane) -> None:
        """Report once that deliveries fail, and once that they all succeed again; from the lanes' threads."""
        if changed.problem is None:
            for lane in self._lanes:
                lane.due = 0.0  # the target takes something again
        with self._lock:
            problem, before = self.problem, self._failing
            self._failing = problem is not None
            if problem is not None and not before:
                self._events.put(NoticeFailed(to=self._where(), why=problem))
            if problem is None and (before or changed.left):
                self._events.put(NoticeRecovered(to=self._where()))

    def _where(self) -> str:
        """Name the target without possible secrets in its address."""
        return "webhook" if self._target.webhook else "command" if self._target.command else "mqtt"

    def _heartbeat(self) -> Notice | None:
        """Return a sign of life if one is due and data flow: whoever waits for it is to miss it otherwise."""
        minutes, now = self._target.heartbeat_minutes, time.monotonic()
        if minutes is None or now < self._beat_due or now - self._data_seen > _DATA_SECONDS:
            return None
        self._beat_due = now + 60 * minutes
        at = time.time_ns()
        return Notice(kind="heartbeat", site=self._site, time=at, utc=utc(at), state="", text="data flow")
