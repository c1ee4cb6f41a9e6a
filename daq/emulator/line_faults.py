"""Transmission faults of a poor serial line, applied to the bytes of an emulated device."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

What = Literal["lost", "repeated", "cut", "silent"]


@dataclass(frozen=True, kw_only=True)
class LineSpell:
    """Fault of all frames for a while."""

    what: What  #: the frame is lost; repeated; cut in half; or the device is silent and ignores commands
    at: float  #: time since the first sample of the device [s of data]
    seconds: float  #: duration [s of data]

    def __post_init__(self) -> None:
        """Refuse invalid values."""
        if self.what not in ("lost", "repeated", "cut", "silent"):
            raise ValueError(f"what: expected lost, repeated, cut or silent, found {self.what!r}")
        if self.at < 0 or self.seconds <= 0:
            raise ValueError(f"at, seconds: expected a time and a length, found {self.at:g}, {self.seconds:g}")


@dataclass(frozen=True, kw_only=True)
class LineFaults:
    """Faults of one line; faults of bytes and frames affect samples, not replies to the host."""

    flipped: float = 0.0  #: share of bytes with one wrong bit
    lost: float = 0.0  #: share of bytes that never arrive
    babble: int = 0  #: random bytes before anything else, as at power-on
    latency: float = 0.0  #: wall time between transfers [s]; USB adapters have 0.001 or 0.016
    spells: tuple[LineSpell, ...] = ()  #: faults of frames over time; if two overlap, the first one applies
    counter: int = 0  #: initial value of the device counter, to test its wrap
    baud: int | None = None  #: baud rate of the device; a host at another rate receives noise, and so does the device
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse invalid shares and times."""
        for name in ("flipped", "lost"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name}: expected a share of 0 to 1, found {getattr(self, name):g}")
        if self.babble < 0 or self.latency < 0 or self.counter < 0:
            found = f"{self.babble}, {self.latency:g}, {self.counter}"
            raise ValueError(f"babble, latency, counter: expected none negative, found {found}")


NO_FAULTS = LineFaults()


class FaultyLine:
    """A line on which faults happen."""

    def __init__(self, faults: LineFaults) -> None:
        self._faults = faults
        self._random = np.random.default_rng(faults.seed)
        self._next = 0.0  # hand-over, by time.monotonic [s]
        self.harmed = 0  #: bytes that were flipped or lost, so far
        self.missing = 0  #: scans of which no whole frame arrived for a spell, so far

    def babble(self) -> bytes:
        """Return the random bytes at power-on."""
        return self._random.bytes(self._faults.babble)

    @property
    def counter(self) -> int:
        """Number of the first scan of all."""
        return self._faults.counter

    @property
    def baud(self) -> int | None:
        """Baud rate of the device, None if it is that of the host [bit/s]."""
        return self._faults.baud

    def noise(self, n: int) -> bytes:
        """Return the bytes received at another baud rate."""
        return self._random.bytes(n)

    def happening(self, scan: int, rate: float) -> What | None:
        """Return the fault of a scan, counted since the first sample, at a rate [Hz]."""
        spells = (s for s in self._faults.spells if round(s.at * rate) <= scan < round((s.at + s.seconds) * rate))
        return next((s.what for s in spells), None)

    def runs(self, first: int, n: int, rate: float) -> Iterator[tuple[int, int, What | None]]:
        """Yield (start, stop, fault) of scans `first` + start .. stop - 1, of n in all.

        Parameters
        ----------
        first : scans since the device first sampled
        n : how many
        rate : of them [Hz]
        """
        if not self._faults.spells:
            yield 0, n, None
            return
        what = [self.happening(first + k, rate) for k in range(n)]
        start = 0
        for stop in range(1, n + 1):
            if stop == n or what[stop] != what[start]:
                self.missing += (stop - start) * (what[start] not in (None, "repeated"))
                yield start, stop, what[start]
                start = stop

    def carried(self, data: bytes) -> bytes:
        """Return the part of sampled data that arrives."""
        if not self._faults.flipped and not self._faults.lost:
            return data
        line = np.frombuffer(data, np.uint8).copy()
        flipped = self._random.random(len(line)) < self._faults.flipped
        line[flipped] ^= (1 << self._random.integers(0, 8, len(line)))[flipped].astype(np.uint8)
        lost = self._random.random(len(line)) < self._faults.lost
        self.harmed += int(np.count_nonzero(flipped | lost))
        return line[~lost].tobytes()

    def hands_over(self) -> bool:
        """Return whether the received bytes are due to be forwarded."""
        if time.monotonic() < self._next:
            return False
        self._next = time.monotonic() + self._faults.latency
        return True
