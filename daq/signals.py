"""Signals of the operating system as events of threads."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

STOP_SIGNALS = signal.SIGINT, signal.SIGTERM


@contextmanager
def signal_event(*numbers: signal.Signals) -> Iterator[threading.Event]:
    """Set an event when a signal arrives, for as long as the context lasts; main thread only.

    A thread sets it, not the handler: a handler interrupts the main thread anywhere, also where it holds the lock of
    the event that it waits for, and would wait for this lock for ever. Contexts may be nested.

    Parameters
    ----------
    numbers : signals that set the event
    """
    requested = threading.Event()
    reading, writing = os.pipe()
    os.set_blocking(writing, False)  # as set_wakeup_fd demands
    outer = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)

    def listen() -> None:
        while received := os.read(reading, 1):
            if received[0] in numbers:
                requested.set()
            elif outer != -1:
                os.write(outer, received)

    thread = threading.Thread(target=listen, name="signals", daemon=True)
    thread.start()
    before = {number: signal.signal(number, lambda *_: None) for number in numbers}
    try:
        yield requested
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(outer)
        os.close(writing)
        thread.join()
        os.close(reading)
