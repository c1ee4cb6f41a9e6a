"""One monitor a site: two would share its memory, its history and its words, and each would have half of them."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from monitor.errors import StartError


@contextmanager
def only_one(state: Path) -> Iterator[None]:
    """Be the only monitor of a state folder for as long as the context lasts, and the process lives.

    A folder that takes nothing is told elsewhere, and no reason not to watch.

    Raises
    ------
    StartError
        If another one runs.
    """
    try:
        state.mkdir(parents=True, exist_ok=True)
        file = (state / "running").open("a+", encoding="utf-8")
    except OSError:
        yield
        return
    with file:
        _lock(file, state)
        yield


def _lock(file: IO[str], state: Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.seek(0)
        raise StartError(f"{state}: a monitor of this site runs already, process {file.read().strip()}") from None
    except OSError:
        return  # not every file system can
    file.truncate(0)
    file.write(f"{os.getpid()}\n")
    file.flush()
