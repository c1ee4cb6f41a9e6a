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

from daq import error_text

T = TypeVar("T")
_UNFORESEEN = 70  # exit code, as of the program
_READER, _WRITER, _ENDS_WITH_ITS_READER = "_reader", "_writer", "_ignore_epipe"  # of a queue; concurrent.futures too
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8  # as glibc's malloc.h has them


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


@cache
def _c_library() -> ctypes.CDLL:
    """Return the process's own; each that is opened is a circle of objects, which lies until it is found."""
    return ctypes.CDLL(None)


def give_back_memory() -> None:
    """Have glibc's malloc give back what is free, and not keep a heap a thread; others are left as they are.

    By itself it keeps more with every large block that was ever freed: a watch of years would hold what it needed in
    its worst moment, in pieces. To be called before threads are started.
    """
    mallopt = getattr(_c_library(), "mallopt", None)
    if mallopt:
        for option, value in ((_ARENA_MAX, 2), (_MMAP_THRESHOLD, 256 * 1024), (_TRIM_THRESHOLD, 128 * 1024)):
            mallopt(option, value)


def spare_what_is_loaded() -> None:
    """Have the garbage collector never look again at what there is by now: modules stay for good.

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
    """Return what is in use: the number of Python's blocks, and bytes of glibc's heaps where there are such.

    A process has more of the system, since allocators keep pieces between what is in use. A leak shows here, years
    before it shows there.
    """
    held = {"blocks": sys.getallocatedblocks()}
    mallinfo2 = getattr(_c_library(), "mallinfo2", None)
    if mallinfo2:
        mallinfo2.restype = _Malloc
        told = mallinfo2()
        held["heap_bytes"] = told.used + told.mapped
    return held


def trim_memory() -> None:
    """Have glibc's malloc give back now what is free, also in the midst of its heaps; others are left as they are."""
    malloc_trim = getattr(_c_library(), "malloc_trim", None)
    if malloc_trim:
        malloc_trim(0)


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
    """Why a child process ended, sent by itself; its traceback would reach nobody but a terminal."""

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
    room in a pipe that nobody reads, for good, and so would all that waits behind it.
    """
    reader: Connection = getattr(outgoing, _READER)
    reader.close()


def received(inbox: "Queue[T]") -> Iterator[T]:
    """Yield what comes from the parent, for as long as it lives: one that was killed can tell nobody to end.

    The child gives up its copy of the writing end, so that the pipe ends with the parent, amid an item if need be. As
    long as that was open, a child waited for good for the rest of what its parent was saying when it was killed.
    """
    writer: Connection = getattr(inbox, _WRITER)
    writer.close()
    while True:
        try:
            item = inbox.get()
        except (EOFError, OSError):
            return
        yield item
