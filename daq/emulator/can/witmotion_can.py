"""A WitMotion WT901 on an emulated CAN bus."""

import math

import numpy as np

from daq.emulator.serving import NO_SYNCS, Frame, SampleSource, SilentNode, Syncs
from daq.emulator.witmotion import WitSettings
from daq.protocol import witmotion as wit
from daq.protocol.frames import NO_FRAMES, CanFrames, concatenate
from daq.timing.host_clock import HostClock

_BYTES_A_FRAME = 22  # of SLCAN lines


class EmulatedWitmotionCan(SilentNode):
    """One device: it sends from its start on, and takes settings once it is unlocked.

    Parameters
    ----------
    source : measured signal, in counts of `daq.protocol.witmotion.SCALE`; clipped beyond 16 g
    clock : simulated clock
    node : its identifier
    clock_error : of its own oscillator, 1e-6 = 1 ppm fast
    """

    bytes_a_scan = _BYTES_A_FRAME * wit.N_TYPES  #: size of SLCAN lines, at most

    def __init__(
        self, source: SampleSource, clock: HostClock, *, node: int = wit.NODE, clock_error: float = 0.0
    ) -> None:
        self._node, self._source, self._clock, self._clock_error = node, source, clock, clock_error
        self._settings = WitSettings(temperature=0.0)  # which no frame has room for
        self.sent = 0  #: scans handed to the adapter
        self.dropped = 0  #: scans that found it full or closed
        self._start()

    def _start(self) -> None:
        self._started, self._due = self._clock.now(), 0
        self._rate = self._settings.rate * (1 + self._clock_error)
        self._source.start(self._started, self._rate)

    def receive(self, can_id: int, data: bytes) -> list[Frame]:
        """Take a frame from the bus; answer nothing."""
        if can_id == self._node and len(data) == wit.COMMAND_SIZE and self._settings.obey(data):
            self._start()
        return []

    def scans(self, room: int, syncs: Syncs = NO_SYNCS) -> CanFrames:
        """Return the frames that are due, of as many scans as there is room for; the others are dropped."""
        del syncs  # it has a timer
        elapsed = (self._clock.now() - self._started) * 1e-9 - self._settings.delay
        n = max(0, math.floor(elapsed * self._rate) + 1 - self._due)
        counts = self._source.read(self._due, n)[:room] if n else np.empty((0, 3), np.int32)
        self._due += n
        self.dropped += n - len(counts)
        self.sent += len(counts)
        parts = [wit.encode_frames(self._node, kind, words) for kind, words in self._settings.packets(counts)]
        frames = concatenate([NO_FRAMES, *parts])
        return frames[np.arange(len(frames)).reshape(len(parts), -1).T.ravel()] if parts else frames

    def disturbed(self, frames: CanFrames) -> CanFrames:
        """Return all frames: it has no faults."""
        return frames
