"""Answers computed once per second for all clients."""

import asyncio
import math
import time
from collections.abc import Callable
from typing import Generic, TypeVar

from starlette.concurrency import run_in_threadpool

_FRESH = 1.0  # s, after which an answer is computed again
_USABLE = 3.0  # s for which the last answer is given while the next one is computed

T = TypeVar("T")


class Snapshot(Generic[T]):
    """The last value of a function that reads files or the database, computed in a thread, one call at a time.

    Nothing is computed without requests. A value older than three seconds is never returned: a file system that hangs
    must not appear healthy.

    Parameters
    ----------
    compute : returns the value
    """

    def __init__(self, compute: Callable[[], T]) -> None:
        self._compute = compute
        self._task: asyncio.Task[T] | None = None
        self._value: tuple[float, T] | None = None  # time of the last request [s, monotonic]

    async def get(self) -> T:
        """Return the value; an error of the function is raised to all who wait for it."""
        age = time.monotonic() - self._value[0] if self._value else math.inf
        if age > _FRESH and (self._task is None or self._task.done()):
            self._task = asyncio.create_task(self._renew())
            self._task.add_done_callback(lambda task: task.cancelled() or task.exception())  # is raised below or again
        if self._value and age <= _USABLE:
            return self._value[1]
        assert self._task is not None
        return await asyncio.shield(self._task)

    async def _renew(self) -> T:
        asked = time.monotonic()
        value = await run_in_threadpool(self._compute)
        self._value = asked, value
        return value
