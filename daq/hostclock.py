"""The host's clock, passed in and never read from the wall inside."""

import time
from dataclasses import dataclass
from typing import Protocol


class HostClock(Protocol):
    """What tells the time of data."""

    @property
    def speed(self) -> float:
        """Seconds of data a second of wall time."""
        ...

    def now(self) -> int:
        """Return the time [ns UTC]."""
        ...


@dataclass(frozen=True)
class SystemClock:
    """The wall clock."""

    speed: float = 1.0

    def now(self) -> int:
        """Return the time [ns UTC]."""
        return time.time_ns()


@dataclass(frozen=True, kw_only=True)
class ScaledClock:
    """A clock that runs faster than the wall's, by one scale told to emulator and monitor alike."""

    speed: float  #: seconds of data a second of wall time
    origin_wall: int  #: wall time [ns UTC] at which ...
    origin: int  #: ... this clock showed this time [ns UTC]

    def now(self) -> int:
        """Return the time [ns UTC]."""
        return self.origin + round(self.speed * (time.time_ns() - self.origin_wall))
