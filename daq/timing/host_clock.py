"""The host's clock, passed in and never read from the wall inside."""

import time
from dataclasses import dataclass
from typing import Protocol


class HostClock(Protocol):
    """Clock for the times of data."""

    @property
    def speed(self) -> float:
        """Seconds of data a second of wall time."""
        ...

    def now(self) -> int:
        """Return the time [ns UTC]."""
        ...


class SystemClock:
    """The wall clock as of the last reading; from then on it runs evenly, whether it is set or not.

    Scans get their time from their arrivals. A clock that is set by hours in between would split them, or place their
    arrival before their sampling. Small corrections by NTP are included; only steps are not.
    """

    def __init__(self) -> None:
        self.speed = 1.0
        self.follow()

    def now(self) -> int:
        """Return the time [ns UTC]."""
        return time.monotonic_ns() + self._ahead

    @property
    def off(self) -> int:
        """By how much the wall clock is ahead of this one, as it has been set since [ns]."""
        return time.time_ns() - self.now()

    def follow(self) -> None:
        """Continue from the present wall clock."""
        self._ahead = time.time_ns() - time.monotonic_ns()


@dataclass(frozen=True, kw_only=True)
class ScaledClock:
    """A clock faster than the wall clock, by one scale shared by emulator and monitor."""

    speed: float  #: seconds of data a second of wall time
    origin_wall: int  #: wall time [ns UTC] at which ...
    origin: int  #: ... this clock showed this time [ns UTC]

    def now(self) -> int:
        """Return the time [ns UTC]."""
        return self.origin + round(self.speed * (time.time_ns() - self.origin_wall))
