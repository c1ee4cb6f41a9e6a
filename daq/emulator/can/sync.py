"""SYNC on an emulated CAN bus: its producer, and the order of the frames after it."""

from collections.abc import Sequence

import numpy as np

from daq.emulator.serving import NO_SYNCS, Syncs
from daq.protocol.epson_can import SYNC
from daq.protocol.frames import CanFrames, can_frames, concatenate
from daq.timing.host_clock import HostClock


class SyncProducer:
    """The part of a node that sends SYNC by its own oscillator.

    Parameters
    ----------
    clock : of the world
    clock_error : of the oscillator, 1e-6 = 1 ppm fast
    """

    def __init__(self, clock: HostClock, clock_error: float) -> None:
        self._clock, self._clock_error = clock, clock_error
        self._since: int | None = None
        self._rate, self._sent = 0.0, 0

    def start(self, period: int) -> None:
        """Send from now on, every `period` [us]; none if that is zero."""
        self._since = self._clock.now() if period else None
        self._rate, self._sent = 1e6 / period * (1 + self._clock_error) if period else 0.0, 0

    def stop(self) -> None:
        """Send no more."""
        self._since = None

    def due(self) -> Syncs:
        """Return the frames that are due."""
        if self._since is None:
            return NO_SYNCS
        n = max(0, int((self._clock.now() - self._since) * 1e-9 * self._rate) + 1 - self._sent)
        self._sent += n
        return Syncs(self._since, self._rate, self._sent - n, n)


def synced_frames(n: int, parts: Sequence[CanFrames]) -> CanFrames:
    """Return `n` SYNC frames and, after each, the nodes' answers in the order of arbitration.

    The least identifier goes first: SYNC, TPDO1 of all nodes, TPDO2 of all nodes.

    Parameters
    ----------
    n : SYNC frames
    parts : each node's frames, of scan after scan from the first SYNC on
    """
    frames = concatenate([can_frames([(SYNC, b"")] * n), *parts])
    scan = np.concatenate([np.arange(n), *(np.arange(len(part)) // max(1, len(np.unique(part.ids))) for part in parts)])
    return frames[np.lexsort((frames.ids, scan))]
