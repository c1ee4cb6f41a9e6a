"""The host's clock, passed in and never read from the wall inside."""

import errno
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np

_SHARED_SIZE = 8 * (3 + 2 * 1024)  # bytes: some seconds of steps


class HostClock(Protocol):
    """Clock for the times of data."""

    @property
    def speed(self) -> float:
        """Seconds of data per second of wall time."""

    def now(self, age: int = 0) -> int:
        """Return the time [ns UTC].

        Parameters
        ----------
        age : how long ago [ns of wall time]
        """


class SystemClock:
    """The wall clock at its last reading, continued by the monotonic clock: it does not follow steps of the wall clock.

    Scans get their time from their arrivals. A clock that is set by hours in between would split them, or place their
    arrival before their sampling. Small corrections by NTP are included; only steps are not.
    """

    def __init__(self) -> None:
        self.speed = 1.0
        self.follow()

    def now(self, age: int = 0) -> int:
        """Return the time, or that of `age` ns ago [ns UTC]."""
        return time.monotonic_ns() - age + self._ahead

    @property
    def off(self) -> int:
        """Time by which the wall clock is ahead of this one, because it was set since the last reading [ns]."""
        return time.time_ns() - self.now()

    def follow(self) -> None:
        """Continue from the present wall clock."""
        self._ahead = time.time_ns() - time.monotonic_ns()


class SharedTime:
    """Times of an emulated system, which advances in steps, shared by processes in a file; the last steps are kept.

    Parameters
    ----------
    path : of the file
    initial : time with which the only process that writes creates the file [ns UTC]; None: it exists

    Raises
    ------
    OSError
        If the file cannot be made or read.
    """

    NEVER = 2**63 - 1  #: later than all times

    def __init__(self, path: Path, initial: int | None = None) -> None:
        if initial is not None:
            path.write_bytes(bytes(_SHARED_SIZE))
        if path.stat().st_size != _SHARED_SIZE:
            raise OSError(errno.EINVAL, "not a file of shared time", str(path))
        words = np.memmap(path, dtype=np.int64, mode="r+")
        # steps so far; until which wall time the world is held, and at which time; (wall time, time) of the last steps
        self._count, self._held, self._steps = words[:1], words[1:3], words[3:].reshape(-1, 2)
        if initial is not None:
            self.step(initial)

    def step(self, time_then: int) -> None:
        """Advance to a time [ns UTC]."""
        count = int(self._count[0])
        self._steps[count % len(self._steps)] = time.monotonic_ns(), time_then
        self._count[0] = count + 1  # last: a reader does not find half a step

    def hold(self, seconds: float, at: int = 0) -> None:
        """Request that the writer makes no step for some seconds of wall time from `at` [ns UTC] on; 0 s: none."""
        self._held[:] = time.monotonic_ns() + round(1e9 * seconds) if seconds else 0, at

    @property
    def held(self) -> bool:
        """True while the writer must make no step."""
        until, at = self._held.tolist()
        return bool(time.monotonic_ns() < until and self._steps[(int(self._count[0]) - 1) % len(self._steps), 1] >= at)

    def at(self, wall: int) -> int:
        """Return the time at a monotonic wall time [ns], as far as it is kept [ns UTC]."""
        count, kept = int(self._count[0]), len(self._steps)
        for k in range(count - 1, max(count - kept, 0), -1):
            if self._steps[k % kept, 0] <= wall:
                break
        else:
            k = max(count - kept, 0)
        return int(self._steps[k % kept, 1])


@dataclass(frozen=True, kw_only=True)
class ScaledClock:
    """A clock faster than the wall clock, by one scale shared by emulator and monitor."""

    speed: float  #: seconds of data per second of wall time
    origin_wall: int  #: wall time [ns UTC] at which ...
    origin: int  #: ... this clock showed this time [ns UTC]
    shared: str | None = None  #: file of a `SharedTime` that this clock does not pass: that of an emulated world

    def now(self, age: int = 0) -> int:
        """Return the time, or that of `age` ns of wall time ago [ns UTC].

        Raises
        ------
        OSError
            If the shared file cannot be read.
        """
        even = self.origin + round(self.speed * (time.time_ns() - age - self.origin_wall))
        return even if self._world is None else min(even, self._world.at(time.monotonic_ns() - age))

    @cached_property
    def _world(self) -> SharedTime | None:
        return None if self.shared is None else SharedTime(Path(self.shared))
