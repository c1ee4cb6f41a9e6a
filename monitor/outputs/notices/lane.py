"""Notices of one target that wait together: on disk until delivered, in a thread of their own."""

import json
import queue
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

from daq.supervision import FAILURES, Backoff, SupervisedThread, error_text
from monitor.outputs.notices.transports import NoticeError, Sender
from monitor.outputs.spool import Spool
from monitor.text.notices import Notice

_TICK = 0.2  # s
_HOUR = 3600.0  # s
_RETRY_LONGEST = 600.0  # s
_ASKED_LONGEST = _HOUR  # longest wait requested by a target: a target that requests years is tried nevertheless
_AT_ONCE = 10**6  # notices that go out together: all that wait
_MUCH = 500_000  # bytes that wait, from which on troubles are only counted
_MAX_IN_MEMORY = 10_000  # notices that no disk takes


class Quota:
    """Messages to one target within the last hour.

    Parameters
    ----------
    per_hour : most of them
    """

    def __init__(self, per_hour: int) -> None:
        self._per_hour = per_hour
        self._sent: deque[float] = deque()  # [s, monotonic]

    @property
    def used(self) -> bool:
        """True if no more may go out now."""
        sent, since = list(self._sent), time.monotonic() - _HOUR
        return sum(time > since for time in sent) >= self._per_hour

    def count(self) -> None:
        """Count a message that has gone out."""
        self._sent.append(time.monotonic())
        while len(self._sent) > self._per_hour:
            self._sent.popleft()


class Lane:
    """Queue of notices with a thread, a file and a back-off of its own: no other lane waits for it.

    Parameters
    ----------
    send : delivers notices
    spool : file for undelivered notices; those of an earlier run are sent first
    quota : of the target, common to its lanes
    retry_seconds : before the second try; doubled with each
    on_change : called with the lane, from its thread, after each delivery that has failed or succeeded
    heartbeat : returns a sign of life if one is due; it is not repeated where it fails
    """

    def __init__(
        self,
        send: Sender,
        spool: Path,
        quota: Quota,
        retry_seconds: float,
        on_change: Callable[["Lane"], None],
        heartbeat: Callable[[], Notice | None] = lambda: None,
    ) -> None:
        self._heartbeat = heartbeat
        self._send, self._spool, self._quota = send, Spool(spool), quota
        self._backoff = Backoff(retry_seconds, _RETRY_LONGEST)
        self._on_change = on_change
        self._queue: queue.SimpleQueue[Notice] = queue.SimpleQueue()
        self._in_memory: deque[str] = deque()  # notices that the disk did not accept
        self._urgent = False  # an alarm waits
        self._before: tuple[SupervisedThread, ...] = ()  # of lanes that have the same file, until they have ended
        self.thread = SupervisedThread(f"notices {spool.stem}", self._run)
        self.due = 0.0  #: time of the next attempt [s, monotonic]
        self.left = self._spool.waiting  #: whether an earlier run left undelivered notices
        self.problem: str | None = None  #: why nothing goes out now
        self.dropped = 0  #: notices that were not kept, since the last that went out

    def put(self, notice: Notice) -> None:
        """Take a notice; never waits."""
        self._queue.put(notice)

    def wait_for(self, before: "Lane") -> None:
        """Deliver nothing until another lane, which is ending and has the same file, has ended."""
        self._before = (before.thread, *(thread for thread in before._before if thread.is_alive()))

    @property
    def idle(self) -> bool:
        """True if nothing waits."""
        return not (self._spool.waiting or self._in_memory)

    def _run(self) -> None:
        going = True
        while going:
            going = not self.thread.ending.wait(_TICK)
            self._keep()
            self._deliver(last=not going)
            self._beat()

    def _beat(self) -> None:
        beat = self._heartbeat()
        if beat is not None:
            self._attempt(lambda: self._send([beat], 0), repeated=False)

    def _keep(self) -> None:
        """Write new notices to disk before anything else: a kill from here on loses nothing."""
        while not self._queue.empty():
            notice = self._queue.get()
            if notice.kind == "trouble" and self._spool.size > _MUCH:
                self.dropped += 1
                continue
            if notice.kind == "alarm":
                self._urgent, self.due = True, 0.0  # tried at once, however long nothing has been taken
            line = json.dumps(notice.values())
            if self._spool.append([line]):
                if len(self._in_memory) < _MAX_IN_MEMORY:
                    self._in_memory.append(line)
                else:
                    self.dropped += 1

    def _deliver(self, *, last: bool) -> None:
        enough = self._quota.used and not self._urgent  # an alarm never waits for the hour
        if self.idle or enough or (time.monotonic() < self.due and not last):
            return
        if any(thread.is_alive() for thread in self._before):
            return
        if self._attempt(self._deliver_all):
            self.due, self._urgent = 0.0, False
            self._backoff.reset()

    def _deliver_all(self) -> None:
        """Send the notices in memory even if the file cannot be read or removed."""
        try:
            self._spool.deliver(self._send_lines, _AT_ONCE)
        finally:
            if self._in_memory:
                self._send_lines(list(self._in_memory))
                self._in_memory.clear()

    def _attempt(self, send: Callable[[], None], *, repeated: bool = True) -> bool:
        """Send something; return whether it was delivered. Unforeseen exceptions of a sender are counted.

        Parameters
        ----------
        send : raises if it fails
        repeated : whether it is tried again, after a back-off
        """
        try:
            send()
        except Exception as error:  # noqa: BLE001 - the alarms that follow must go out
            known = isinstance(error, NoticeError | OSError)
            if not known:
                FAILURES.add(self.thread.name, error)
            self._report(str(error) if known else error_text(error))
            if repeated:
                asked = min(error.wait, _ASKED_LONGEST) if isinstance(error, NoticeError) else 0.0
                self.due = time.monotonic() + max(self._backoff.next(), asked)
            return False
        if repeated or self.idle:
            self._report(None)
        return True

    def _report(self, problem: str | None) -> None:
        self.problem = problem
        self._on_change(self)
        if problem is None:
            self.left = False

    def _send_lines(self, lines: list[str]) -> None:
        notices = [Notice(**fields) for line in lines if (fields := json.loads(line)).keys() == _FIELDS]
        if notices:
            self._send(notices, self.dropped)
            self.dropped = 0
            self._quota.count()


_FIELDS = Notice.__dataclass_fields__.keys()
