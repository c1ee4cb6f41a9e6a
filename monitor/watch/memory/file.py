"""The memory's file in the state folder: replaced after each window."""

import contextlib
import os
import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from daq import Event, Item

MEMORY = "memory.json"  #: name in the state folder, and of the attachment to a log that began with it
_SETTLE = 1.0  # s after an item was logged: log, history and notices have it on the disk by then


@dataclass(frozen=True, kw_only=True)
class LoadedState:
    """State of the run before, found at a start."""

    text: str | None = None  #: the memory
    refused: str | None = None  #: why one that is there is of no use


NOTHING = LoadedState()


class MemoryFile:
    """Keeps the newest memory on disk, never ahead of the log, the history and the notices that it rests on.

    A saved state with an unreported alarm would suppress that alarm for good: it is therefore written a second after
    the last result that it depends on was logged.

    Parameters
    ----------
    path : of the file
    """

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, threading.Lock()
        self._handed: deque[Event] = deque()  # results that are not known to be in the log
        self._any = False  # whether one was ever handed to it
        self._expected: deque[tuple[Event, str]] = deque()  # states waiting for one of these results
        self._logged: deque[tuple[float, str]] = deque()  # monotonic time from which on each may be written
        self.problem: str | None = None  #: why the last one is not on the disk

    def after(self, event: Event) -> None:
        """Take note of a result that is handed to the log."""
        with self._lock:
            self._handed.append(event)
            self._any = True

    def expect(self, text: str) -> None:
        """Take a memory that may be written once the newest result is in the log, where it may be by now."""
        with self._lock:
            if self._handed:
                self._expected.append((self._handed[-1], text))
            elif self._any:
                self._logged.append((time.monotonic() + _SETTLE, text))

    def take(self, item: Item) -> None:
        """Add a logged item, in the log's thread."""
        with self._lock:
            if not any(item is event for event in self._handed):
                return
            while self._handed.popleft() is not item:
                pass  # found the log's queue full
            while self._expected and not any(self._expected[0][0] is event for event in self._handed):
                self._logged.append((time.monotonic() + _SETTLE, self._expected.popleft()[1]))

    def write(self) -> None:
        """Write the newest that may be; called now and then."""
        text = None
        while self._logged and time.monotonic() >= self._logged[0][0]:
            text = self._logged.popleft()[1]
        if text is not None:
            self._replace(text)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Write the last that was logged: nothing comes after it."""
        if self._logged:
            self._replace(self._logged.pop()[1])
            self._logged.clear()

    def _replace(self, text: str) -> None:
        unfinished = self._path.with_suffix(".part")
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with unfinished.open("w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            os.replace(unfinished, self._path)
            self._sync_folder()
        except OSError as error:
            self.problem = f"{self._path}: {error.strerror}"
        else:
            self.problem = None

    def _sync_folder(self) -> None:
        with contextlib.suppress(OSError):  # not every file system takes it
            folder = os.open(self._path.parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)
