"""Progress of long passes over files: readers and writers report it, and a program may listen."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

ProgressListener = Callable[[Path, float], None]  #: called with a file and the share of its pass that is done
_listener: ContextVar[ProgressListener | None] = ContextVar("listener", default=None)


@contextmanager
def progress_reported_to(listener: ProgressListener) -> Iterator[None]:
    """Call a function with the progress of all passes over files in this context; other threads are not included."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def report_progress(path: Path, done: float, total: float) -> None:
    """Report the progress of a pass over a file.

    Parameters
    ----------
    path : of the file
    done, total : in any unit
    """
    listener = _listener.get()
    if listener is not None:
        listener(path, min(done / total, 1.0) if total > 0 else 1.0)
