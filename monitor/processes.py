"""Processes of the monitor's own: what they hear of signals, and when they end."""

import multiprocessing
import queue
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.queues import Queue
from typing import TypeVar

T = TypeVar("T")
_LOOK_SECONDS = 2.0  # between looks at whether the parent lives


@contextmanager
def deaf_to_stop_signals() -> Iterator[None]:
    """Have processes that are started here never hear SIGINT, SIGTERM and SIGHUP, which they inherit.

    Terminals and service managers send them to the whole group: when to end is for the parent alone to say.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def received(inbox: "Queue[T]") -> Iterator[T]:
    """Yield what comes from the parent, for as long as it lives: one that was killed can tell nobody to end."""
    parent = multiprocessing.parent_process()
    while True:
        try:
            item = inbox.get(timeout=_LOOK_SECONDS)
        except queue.Empty:
            if parent is not None and not parent.is_alive():
                return
            continue
        yield item
