"""Child processes: signals, memory, environment, and their end with the parent."""

import ctypes
import gc
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from multiprocessing.connection import Connection
from multiprocessing.queues import Queue
from typing import TypeVar

from daq import Recording
from daq.supervision import error_text

T = TypeVar("T")
_UNFORESEEN = 70  # exit code, as of the program
_READER, _WRITER, _ENDS_WITH_ITS_READER = "_reader", "_writer", "_ignore_epipe"  # of a queue; concurrent.futures too
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8  # as glibc's malloc.h has them
_MAX_INT = (1 << 31) - 1  # bytes: mallopt takes an int
_LARGE_BYTES = 40 << 20  # of a window: 400 s of 12 channels at 1 kHz


@contextmanager
def deaf_to_stop_signals() -> Iterator[None]:
    """Make processes started here ignore SIGINT, SIGTERM and SIGHUP.

    Terminals and service managers send them to the whole group: the parent alone decides when to end.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@cache
def _c_library() -> ctypes.CDLL:
    """Return the process's own; each that is opened is a circle of objects, which lies until it is found."""
    return ctypes.CDLL(None)


def give_back_memory() -> None:
    """Configure glibc's malloc to return free memory, without a heap per thread; other libraries are unchanged.

    By default it keeps more with every large block that was ever freed: a monitor of years would hold its largest past
    demand, in pieces. To be called before threads are started.
    """
    _configure_malloc({_ARENA_MAX: 2, _MMAP_THRESHOLD: 256 * 1024, _TRIM_THRESHOLD: 128 * 1024})


def keep_freed_memory() -> None:
    """Configure glibc's malloc to keep free memory until `trim_memory`: the system clears each page that it provides.

    For a command whose windows need the same memory one after the other; the data of large windows are returned.
    """
    _configure_malloc({_MMAP_THRESHOLD: _LARGE_BYTES, _TRIM_THRESHOLD: _MAX_INT})


def _configure_malloc(options: Mapping[int, int]) -> None:
    mallopt = getattr(_c_library(), "mallopt", None)
    if mallopt:
        for option, value in options.items():
            mallopt(option, value)


def spare_what_is_loaded() -> None:
    """Exclude existing objects from garbage collection: modules stay for good.

    To look at all of it takes 45 ms, in which no thread runs, and so Python waits until a quarter as many objects have
    come since: as long lay garbage.
    """
    gc.collect()
    gc.freeze()


class _Malloc(ctypes.Structure):
    """Result of glibc's mallinfo2."""

    _names = ("arena", "ordblks", "smblks", "hblks", "mapped", "usmblks", "fsmblks", "used", "free", "keepcost")
    _fields_ = tuple((name, ctypes.c_size_t) for name in _names)


def held_memory() -> dict[str, int]:
    """Return the memory in use: the number of Python's blocks, and bytes of glibc's heaps if available.

    A process holds more memory, because allocators keep pieces between used ones. A leak shows here years earlier.
    """
    held = {"blocks": sys.getallocatedblocks()}
    mallinfo2 = getattr(_c_library(), "mallinfo2", None)
    if mallinfo2:
        mallinfo2.restype = _Malloc
        info = mallinfo2()
        held["heap_bytes"] = info.used + info.mapped
    return held


def trim_memory() -> None:
    """Make glibc's malloc return free memory now, also inside its heaps; other libraries are unchanged."""
    malloc_trim = getattr(_c_library(), "malloc_trim", None)
    if malloc_trim:
        malloc_trim(0)


def trim_before(window: Recording) -> None:
    """Return the memory of the blocks that a large window was made of, before it is analysed."""
    if window.data.nbytes > _LARGE_BYTES:
        trim_memory()


@contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """Have processes that are started here find these variables, which libraries read when they are loaded."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


class LastWords:
    """Reason why a child process ended, sent by itself; its traceback would only reach a terminal."""

    def __init__(self) -> None:
        self._receiver, self.sender = multiprocessing.get_context("spawn").Pipe(duplex=False)

    def started(self) -> None:
        """Leave the sending end to the child that has been started with it."""
        self.sender.close()

    def text(self, process: multiprocessing.process.BaseProcess) -> str:
        """Return in one line how a process has ended."""
        try:
            why = str(self._receiver.recv()) if self._receiver.poll() else ""
        except (EOFError, OSError):
            why = ""
        return f"its process ended with code {process.exitcode}{': ' if why else ''}{why}"


def report_end(sender: Connection, target: Callable[..., None], *arguments: object) -> None:
    """Do the work of a child process; an unforeseen exception ends it with its reason sent to the parent."""
    try:
        target(*arguments)
    except Exception as error:  # noqa: BLE001 - the edge of the process
        with suppress(OSError):
            sender.send(error_text(error))
        sys.exit(_UNFORESEEN)


def queue_to_child(capacity: int = 0) -> "Queue[T]":
    """Return a queue that one child alone is to read: see `handed_over`."""
    queue: Queue[T] = multiprocessing.get_context("spawn").Queue(capacity)
    setattr(queue, _ENDS_WITH_ITS_READER, True)
    return queue


def handed_over(outgoing: "Queue[T]") -> None:
    """Leave the reading end of a queue to the child that has been started with it.

    Once the child dies, the thread that feeds the queue ends. As long as the end was open here too, it would wait for
    room in a pipe without a reader, for good, and so would everything behind it.
    """
    reader: Connection = getattr(outgoing, _READER)
    reader.close()


def received(inbox: "Queue[T]") -> Iterator[T]:
    """Yield the items of the parent, as long as it is alive: a killed parent cannot send an end.

    The child closes its copy of the writing end, so that the pipe ends with the parent, inside an item if necessary. As
    long as that was open, a child waited for good for the rest of an item of its killed parent.
    """
    writer: Connection = getattr(inbox, _WRITER)
    writer.close()
    while True:
        try:
            item = inbox.get()
        except (EOFError, OSError):
            return
        yield item
