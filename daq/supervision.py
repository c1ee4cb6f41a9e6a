"""Background threads that are restarted after an unforeseen exception, and the record of such exceptions."""

import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from daq.events import EventPayload, ThreadFailed, ThreadRecovered

_FIRST_PAUSE_SECONDS, _LONGEST_PAUSE_SECONDS = 0.5, 60.0  # before a restart; doubled with each in a row
_CALM_SECONDS = 2 * _LONGEST_PAUSE_SECONDS  # without another failure, after which a part works again


def error_text(error: BaseException) -> str:
    """Return the type of an exception and the place where it was raised; its message may quote secrets."""
    text = f": {error.strerror}" if isinstance(error, OSError) and error.strerror else ""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}{text}{place}"


def short_line(text: str, most: int) -> str:
    """Return a text as one line of limited length; unprintable characters become question marks."""
    printed = "".join(letter if letter.isprintable() else "?" for letter in " ".join(text.split()))
    return printed if len(printed) <= most else f"{printed[: most // 2]} .. {printed[-most // 2 :]}"


@dataclass(frozen=True)
class Failure:
    """Last failure of a part."""

    why: str
    ends: float  #: monotonic time at which the part counts as working again [s]


class Failures:
    """Record of unforeseen exceptions in the background parts of a process; may be used from any thread."""

    def __init__(self, calm_seconds: float = _CALM_SECONDS) -> None:
        self._lock, self._calm_seconds = threading.Lock(), calm_seconds
        self._current: dict[str, Failure] = {}
        self._counts: dict[str, int] = {}
        self._events: deque[EventPayload] = deque(maxlen=1000)

    def add(self, part: str, error: BaseException) -> None:
        """Count an exception; an event is due if the part worked before."""
        why = error_text(error)
        with self._lock:
            self._counts[part] = self._counts.get(part, 0) + 1
            if part not in self._current:
                self._events.append(ThreadFailed(thread=part, why=why))
            self._current[part] = Failure(why, time.monotonic() + self._calm_seconds)

    def attempt(self, part: str, action: Callable[..., object], *arguments: object) -> bool:
        """Call an action; return False if it raised, which is counted. No part may stop its caller."""
        try:
            action(*arguments)
        except Exception as error:  # noqa: BLE001 - the edge of the daemon
            self.add(part, error)
            return False
        return True

    @property
    def counts(self) -> dict[str, int]:
        """Number of exceptions of each part that ever raised one."""
        with self._lock:
            return dict(self._counts)

    @property
    def problem(self) -> str | None:
        """Parts that fail now, and why; None if all work."""
        with self._lock:
            self._expire()
            texts = [f"{part}: {failure.why}, {self._counts[part]} times" for part, failure in self._current.items()]
        return "; ".join(texts) or None

    def events(self) -> Iterator[EventPayload]:
        """Yield the failures and recoveries since the last call."""
        with self._lock:
            self._expire()
            due = list(self._events)
            self._events.clear()
        yield from due

    def _expire(self) -> None:
        """Take parts for working again that have not failed for a while."""
        now = time.monotonic()
        for part in [part for part, failure in self._current.items() if now >= failure.ends]:
            del self._current[part]
            self._events.append(ThreadRecovered(thread=part, failures=self._counts[part]))


FAILURES = Failures()  #: failures of this process


class Backoff:
    """Pauses before repeated attempts, each twice as long as the one before.

    Parameters
    ----------
    first, longest : pause [s]
    """

    def __init__(self, first: float, longest: float) -> None:
        self._first, self._longest = first, longest
        self._pause = min(first, longest)

    def next(self) -> float:
        """Return the pause before the next attempt [s]."""
        pause = self._pause
        self._pause = min(2 * pause, self._longest)
        return pause

    def reset(self) -> None:
        """Start again with the first pause."""
        self._pause = min(self._first, self._longest)


class SupervisedThread(threading.Thread):
    """Background thread whose work is restarted after an unforeseen exception, with a pause that doubles.

    Parameters
    ----------
    name : of the thread, as events and health report it
    work : returns once `ending` is set; may be called again after it has raised
    longest_pause : before a restart [s]
    failures : record that counts exceptions
    daemon : whether the process may end while the thread works
    """

    def __init__(
        self,
        name: str,
        work: Callable[[], None],
        *,
        longest_pause: float = _LONGEST_PAUSE_SECONDS,
        failures: Failures = FAILURES,
        daemon: bool = True,
    ) -> None:
        super().__init__(name=name, daemon=daemon)
        self.ending = threading.Event()  #: set when the work is to return
        self._work, self._failures = work, failures
        self._backoff = Backoff(_FIRST_PAUSE_SECONDS, longest_pause)

    def run(self) -> None:
        """Work until that returns; once `ending` is set there is one more attempt to end in order."""
        last = False
        while True:
            begun = time.monotonic()
            try:
                self._work()
            except BaseException as error:  # noqa: BLE001 - a thread that ends silently is the worst of all failures
                self._failures.add(self.name, error)
            else:
                return
            if last:
                return
            if time.monotonic() - begun > _CALM_SECONDS:
                self._backoff.reset()
            last = self.ending.wait(self._backoff.next())
