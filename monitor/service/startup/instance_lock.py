"""One monitor per site: two would share its memory and its history, and each would send a part of its messages."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from monitor.errors import StartError

_PROCESS = "running"  #: file of a state folder with the number of the process that watches


@contextmanager
def only_one(state: Path) -> Iterator[None]:
    """Hold the lock of a state folder during the context, as its only monitor.

    The folder itself is locked, so that no deleted file lets a second monitor start. A folder that cannot be opened is
    reported elsewhere, and is no reason not to watch.

    Raises
    ------
    StartError
        If another one runs.
    """
    try:
        state.mkdir(parents=True, exist_ok=True)
        folder = os.open(state, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:
        yield
        return
    try:
        _lock(folder, state)
        yield
    finally:
        os.close(folder)


def _lock(folder: int, state: Path) -> None:
    process = state / _PROCESS
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        process.write_text(f"{os.getpid()}\n", encoding="utf-8")
    except BlockingIOError:
        raise StartError(f"{state}: a monitor of this site runs already{_named(process)}") from None
    except OSError:
        return  # not every file system can, and a full or read-only one is reported elsewhere


def _named(process: Path) -> str:
    try:
        return f", process {process.read_text(encoding='utf-8').strip()}"
    except OSError:
        return ""
