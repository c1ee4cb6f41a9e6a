"""Reads from a port in few large pieces: the cost of a read is the wake-up, not the number of bytes."""

import math
import os
import select
import time

_ENOUGH = 5000  # bytes a read should bring
_ROOM = 2600  # bytes that may wait in the port: a pty holds 4 kB, a real port more
_FIRST = 0.005  # s that bytes gather at first; then twice as long each time
_SHORTEST = 0.002  # s of gathering below which there is nothing to gain: sleeping is not that exact
_PART, _FULL = 8192, 4000  # bytes requested at once, and length of a read after which more may be available
_MAX = 1 << 16  # bytes a read


class BufferedPort:
    """Reads a port that is open and does not block; for one thread.

    If bytes arrive fast enough, they accumulate while the reader sleeps; it is woken early only if the port disappears.
    It then reads the available bytes and waits for the next byte, so that the arrival time of the last byte is exact.
    Bytes waiting in a port that disappears are lost, `_ROOM` bytes at most.

    Parameters
    ----------
    descriptor : of the port
    most_seconds : that bytes gather at the most [s]
    least_rate : bytes per second below which nothing is gained, and nothing gathered
    """

    def __init__(self, descriptor: int, *, most_seconds: float, least_rate: float) -> None:
        self._descriptor, self._most_seconds, self._least_rate = descriptor, most_seconds, least_rate
        self._gone, self._here = select.poll(), select.poll()
        self._gone.register(descriptor, 0)  # a hang-up is reported without a requested event, too
        self._here.register(descriptor, select.POLLIN)
        self._pauses, self._pause = 0, 0.0  # of gathering: number, length [s]
        self.arrived = self._taken = time.perf_counter_ns()  #: when the last read's bytes were here

    def read(self, seconds: float | None, *, batch: bool = True) -> bytes:
        """Return the available bytes; after accumulation, nothing if nothing arrives within some seconds.

        Parameters
        ----------
        seconds : to wait for the next byte, None for as long as it takes [s]
        batch : let bytes gather before

        Raises
        ------
        OSError
            If the port is gone.
        """
        data = b""
        for _ in range(self._pauses if batch else 0):
            if self._gone.poll(1e3 * self._pause):
                break
            data += self._take()
        if self._here.poll(None if seconds is None else 1e3 * seconds):
            last = self._take()
            if not (last or data):  # poll reported data
                raise OSError("it was unplugged")
            data += last
        self._adapt(len(data))
        return data

    def _take(self) -> bytes:
        """Return the available bytes."""
        data = part = self._part()
        while len(part) >= _FULL and len(data) < _MAX:
            part = self._part()
            data += part
        if data:
            self._taken = time.perf_counter_ns()
        return data

    def _part(self) -> bytes:
        try:
            return os.read(self._descriptor, _PART)
        except OSError:
            return b""  # nothing available, or port gone: the next read shows which

    def _adapt(self, n: int) -> None:
        """Let bytes gather for as long as they need to be enough, without filling the port."""
        now = self._taken if n else time.perf_counter_ns()
        rate = 1e9 * n / max(1, now - self.arrived)
        # after opening, the pauses become longer step by step
        longest = min(self._most_seconds, 2 * self._pauses * self._pause + _FIRST)
        seconds = min(longest, _ENOUGH / rate) if rate > self._least_rate else 0.0
        self._pauses = math.ceil(seconds * rate / _ROOM) if seconds > _SHORTEST else 0
        self._pause = seconds / max(1, self._pauses)
        self.arrived = now
