"""What a poor serial line does to the bytes of an emulated device."""

import time
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class LineFaults:
    """Faults of one line; those of bytes hit what is sampled, answers to the host come through."""

    flipped: float = 0.0  #: share of bytes with one wrong bit
    lost: float = 0.0  #: share of bytes that never arrive
    babble: int = 0  #: random bytes before anything else, as at power-on
    latency: float = 0.0  #: of wall time between hand-overs [s]; USB adapters have 0.001 or 0.016
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what is no share or time."""
        for name in ("flipped", "lost"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name}: expected a share of 0 to 1, found {getattr(self, name):g}")
        if self.babble < 0 or self.latency < 0:
            raise ValueError(f"babble, latency: expected none negative, found {self.babble}, {self.latency:g}")


NO_FAULTS = LineFaults()


class FaultyLine:
    """A line on which faults happen."""

    def __init__(self, faults: LineFaults) -> None:
        self._faults = faults
        self._random = np.random.default_rng(faults.seed)
        self._next = 0.0  # hand-over, by time.monotonic [s]
        self.harmed = 0  #: bytes that were flipped or lost, so far

    def babble(self) -> bytes:
        """Return what comes at power-on."""
        return self._random.bytes(self._faults.babble)

    def carried(self, data: bytes) -> bytes:
        """Return what arrives of sampled data."""
        if not self._faults.flipped and not self._faults.lost:
            return data
        line = np.frombuffer(data, np.uint8).copy()
        flipped = self._random.random(len(line)) < self._faults.flipped
        line[flipped] ^= (1 << self._random.integers(0, 8, len(line)))[flipped].astype(np.uint8)
        lost = self._random.random(len(line)) < self._faults.lost
        self.harmed += int(np.count_nonzero(flipped | lost))
        return line[~lost].tobytes()

    def hands_over(self) -> bool:
        """Tell whether it is time to hand on what has arrived."""
        if time.monotonic() < self._next:
            return False
        self._next = time.monotonic() + self._faults.latency
        return True
