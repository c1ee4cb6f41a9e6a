"""Emulated sensor on a CAN bus that sends unprompted, described by a DBC file."""

import numpy as np

from daq.drivers.base import DbcSensor
from daq.drivers.can.dbc_file import read_layout
from daq.emulator.serving import NO_SYNCS, Frame, SampleSource, SilentNode, Syncs
from daq.protocol.can_scan import encode_scans
from daq.protocol.frames import CanFrames
from daq.timing.host_clock import HostClock

_BYTES_A_FRAME = 27  # of the longest line


class EmulatedDbc(SilentNode):
    """One sensor, which samples from its creation on.

    Parameters
    ----------
    source : measured signal, in counts of the layout's scale (`scale`)
    clock : simulated clock
    sensor : its signals
    rate : scans per second [Hz]
    clock_error : of its own oscillator, 1e-6 = 1 ppm fast
    lost, repeated : shares of its frames that are lost, and that are repeated, at random
    seed : of that

    Raises
    ------
    DbcError
        If the file cannot be used.
    """

    def __init__(
        self,
        source: SampleSource,
        clock: HostClock,
        sensor: DbcSensor,
        *,
        rate: float,
        clock_error: float = 0.0,
        lost: float = 0.0,
        repeated: float = 0.0,
        seed: int = 0,
    ) -> None:
        self._layout = read_layout(sensor)
        self.scale = self._layout.scale  #: m/s2 per count of the source
        self.bytes_a_scan = _BYTES_A_FRAME * len(self._layout.messages)
        self._source, self._clock, self._rate = source, clock, rate * (1 + clock_error)
        self._lost, self._repeated, self._random = lost, repeated, np.random.default_rng(seed)
        self._began, self._due = clock.now(), 0
        source.start(self._began, self._rate)
        self.sent = 0  #: scans handed to the adapter
        self.dropped = 0  #: scans that found it full, after the first that did not

    def receive(self, can_id: int, data: bytes) -> list[Frame]:
        """Take a frame from the bus; answer nothing."""
        return []

    def scans(self, room: int, syncs: Syncs = NO_SYNCS) -> CanFrames:
        """Return the frames that are due, of as many scans as there is room for; the others are dropped."""
        del syncs  # it has a timer
        first = self._due
        n = max(0, int((self._clock.now() - self._began) * 1e-9 * self._rate) + 1 - first)
        axes = len(self._layout.axes)
        counts = self._source.read(first, n)[:room, :axes] if n else np.empty((0, axes), np.int32)
        self._due += n
        self.sent += len(counts)
        self.dropped += n - len(counts) if self.sent else 0
        return encode_scans(self._layout, counts, first)

    def disturbed(self, frames: CanFrames) -> CanFrames:
        """Return the frames of a bus that arrive: some of its own are lost, some are repeated."""
        if not (self._lost or self._repeated) or not len(frames):
            return frames
        chance = self._random.random(len(frames))
        times = np.where(chance < self._lost, 0, np.where(chance > 1 - self._repeated, 2, 1))
        times[~np.isin(frames.ids, list(self._layout.all_identifiers))] = 1
        return frames[np.repeat(np.arange(len(frames)), times)]
