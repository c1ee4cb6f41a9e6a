"""Journal of a run: one line for every result and event, for people or for programs.

Lines are made in the log's thread and written in one of their own, so that a blocked terminal blocks nothing. Of
repeated events, such as the gaps of a loose plug, some per minute are printed and the others counted.
"""

import json
import logging
import queue
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from logging.handlers import QueueHandler
from typing import Any, TextIO

from daq import Block, Event, Item
from daq.supervision import SupervisedThread
from monitor.results.windows import AlarmResult, ReferenceResult, Result, SelfTestResult, WindowResult, event_result
from monitor.text.causes import change_text
from monitor.text.events import field_value
from monitor.text.quantities import counted
from monitor.text.sensors import health_text

_A_MINUTE = 10  # lines of a kind, of one device
_MINUTE = 60.0  # s
_ROUTINE = (  # endings of topics of normal operation
    "_recovered",
    "_restored",
    "_open",
    "_deleted",
    "acknowledge",
    "accept",
    "accept_undone",
    "stopped",
    "reloaded",
)


def line(result: Result) -> str:
    """Return one result as a line of text."""
    if isinstance(result, ReferenceResult):
        return (
            f"reference: {counted(len(result.modes), 'mode')}, "
            + ", ".join(f"{m.frequency:.2f}" for m in result.modes)
            + " Hz"
        )
    if isinstance(result, AlarmResult):
        return f"{result.state:>7}: {result.text.removeprefix('ALARM: ')}"
    if isinstance(result, SelfTestResult):
        return result.text
    return _window_line(result)


def _window_line(window: WindowResult) -> str:
    start = f"window {window.index + 1:>3} {window.phase:<8}"
    if window.problem:
        return f"{start} {window.problem}"
    text = f"{start} {counted(len(window.modes), 'mode')}"
    if window.novelty:
        text += f", novelty {window.novelty.t2:6.2f} of {window.novelty.limit:.2f}"
    if window.faults:
        text += f"; no data: {', '.join(window.faults)}"
    if window.sensors:
        text += f"; {health_text(window.sensors)}"
    learning = window.learning
    if learning and learning.windows >= learning.target:  # a calibration of the model takes seconds to minutes
        text += f"; computing the reference from {learning.windows} windows ..."
    return f"{text}, {change_text(window.diagnosis)}" if window.diagnosis else text


class Journal:
    """Console lines of everything in the log except signals.

    Parameters
    ----------
    logger : that takes the lines
    """

    def __init__(self, logger: logging.Logger) -> None:
        self._logger = logger
        self._minute: dict[tuple[str, str], tuple[float, int]] = {}  # kind and device -> since when, how many lines

    def take(self, item: Item) -> None:
        """Add a logged item; never blocks."""
        if isinstance(item, Block):
            return
        result = event_result(item)
        if result is not None:
            is_alarm = isinstance(result, AlarmResult) and result.state == "alarm"
            fields = {"what": item.topic.rpartition("/")[2], "at": item.time}
            self._say(logging.WARNING if is_alarm else logging.INFO, line(result), fields)
        elif item.topic.startswith("/event/"):
            self._event(item)

    def _event(self, event: Event) -> None:
        what = event.topic.removeprefix("/event/")
        omitted = self._omitted((what, str(event.payload.get("device", ""))))
        if omitted is None:
            return
        fields = {"what": what, "at": event.time, **event.payload} | ({"omitted": omitted} if omitted else {})
        given = {name: field_value(name, value) for name, value in fields.items() if name not in {"what", "at"}}
        values = " ".join(f"{name}={_brief(value)}" for name, value in given.items())
        level = logging.INFO if what.endswith(_ROUTINE) else logging.WARNING
        self._say(level, f"{what} {values}".rstrip(), fields)

    def _omitted(self, kind: tuple[str, str]) -> int | None:
        """Return the number of omitted lines of a kind before this one; None if this one is omitted too."""
        since, lines = self._minute.get(kind, (-_MINUTE, 0))
        over = time.monotonic() - since >= _MINUTE
        self._minute[kind] = (time.monotonic(), 1) if over else (since, lines + 1)
        if not over:
            return None if lines >= _A_MINUTE else 0
        return max(0, lines - _A_MINUTE)

    def _say(self, level: int, text: str, fields: dict[str, Any]) -> None:
        self._logger.log(level, "%s", text, extra={"fields": fields})


@contextmanager
def journal(*, as_json: bool, stream: TextIO | None = None) -> Iterator[Journal]:
    """Have lines written for as long as the context lasts.

    Parameters
    ----------
    as_json : an object a line, instead of text
    stream : output of the lines. Default: standard output
    """
    logger = logging.Logger("modalwatch")
    handler = logging.StreamHandler(stream or sys.stdout)
    handler.setFormatter(_JsonLines() if as_json else _Lines())
    lines: queue.SimpleQueue[logging.LogRecord | None] = queue.SimpleQueue()
    writer = SupervisedThread("journal", lambda: _write(lines, handler))
    logger.addHandler(QueueHandler(lines))
    writer.start()
    try:
        yield Journal(logger)
    finally:
        lines.put(None)
        writer.ending.set()
        writer.join()


def _write(lines: "queue.SimpleQueue[logging.LogRecord | None]", handler: logging.Handler) -> None:
    """Write lines until there are no more."""
    while (record := lines.get()) is not None:
        handler.handle(record)


class _Lines(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        """Return time and text."""
        return f"{_utc(record)} {record.getMessage()}"


class _JsonLines(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        """Return time, level, text and all fields as one object; `at` is the time of the data [ns UTC]."""
        known = {"time": _utc(record), "level": record.levelname.lower(), "text": record.getMessage().strip()}
        return json.dumps(known | {"fields": record.__dict__["fields"]}, default=str)


def _utc(record: logging.LogRecord) -> str:
    return datetime.fromtimestamp(record.created, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _brief(value: object) -> str:
    text = value if isinstance(value, str) else json.dumps(value, default=str)
    return json.dumps(text) if isinstance(value, str) and (" " in text or not text) else text
