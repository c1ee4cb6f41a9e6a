"""Common part of emulated devices on serial lines: a pty, scans that are due, and a line that may be full."""

import math
import os
import termios
from abc import ABC, abstractmethod

from daq.emulator.serving import PORT_BUFFER, FaultyLine, LineFaults, Pty, SampleSource
from daq.timing.host_clock import HostClock
from daq.types import IntArray

_SPEED = 5  # termios index of the output speed of the host


class SerialEmulator(Pty, ABC):
    """The device side of one serial line.

    It never waits for a reader: beyond the pty's own buffer it holds as much as the kernel would of a real port's
    bytes, and then drops whole frames and counts them.

    Parameters
    ----------
    source : measured signal
    clock : simulated clock
    frame_size : bytes per scan, at most
    clock_error : of its own oscillator, 1e-6 = 1 ppm fast
    faults : of the line
    """

    def __init__(
        self, source: SampleSource, clock: HostClock, *, frame_size: int, clock_error: float, faults: LineFaults
    ) -> None:
        super().__init__()
        self._source, self._clock = source, clock
        self._frame_size, self._clock_error = frame_size, clock_error
        self.line = FaultyLine(faults)  #: counts the damaged frames
        self._pending += self.line.babble()
        self.sampling_since: int | None = None  #: time of the first scan [ns UTC], None while it is not sampling
        self._first_started: int | None = None
        self._delay = 0.0  # of the filter: scans are sent that much after the motion [s]
        self._true_rate = 0.0  # of the scans, by the world's clock [Hz]
        self._due = 0
        self.sent = 0  #: frames handed to the pty
        self.dropped = 0  #: frames that found it full

    @abstractmethod
    def receive(self, data: bytes) -> None:
        """Process bytes from the host."""

    @abstractmethod
    def encode(self, counts: IntArray, first: int) -> bytes:
        """Return the frames of scans (n, 3) from number `first` on."""

    def close(self) -> None:
        """Unplug: the host's side reads an error from now on; once is enough."""
        if not self._unplugged:
            self._unplugged = True
            os.close(self._master)

    def serve(self) -> None:
        """Answer commands and send data that are due, without blocking. No effect once unplugged."""
        if self._unplugged:
            return
        understood = self._understood()
        self._listen(understood)
        if self.sampling_since is not None:
            self._sample(self.sampling_since)
        if not understood:
            self._pending = bytearray(self.line.noise(len(self._pending)))
        if self._pending and self.line.hands_over():
            self._drain()

    def say(self, data: bytes) -> None:
        """Send bytes after those already sent."""
        self._pending += data

    def start(self, rate: float, delay: float = 0.0) -> None:
        """Sample from now on, at a nominal rate [Hz], behind a filter with a delay [s]."""
        self._delay = delay
        self.sampling_since, self._due = self._clock.now(), 0
        self._first_started = self._first_started or self.sampling_since
        self._true_rate = rate * (1 + self._clock_error)
        self._source.start(self.sampling_since, self._true_rate)

    def stop(self) -> None:
        """Stop sampling, and discard unsent data."""
        self.sampling_since = None
        self._pending.clear()

    def _understood(self) -> bool:
        """Return whether the host has set its side of the line to the device's baud rate."""
        return self.line.baud is None or termios.tcgetattr(self._slave)[_SPEED] == getattr(
            termios, f"B{self.line.baud}"
        )

    def _scans_until(self, time: int) -> int:
        """Return how many scans there could have been since the device first sampled."""
        return 0 if self._first_started is None else round(1e-9 * (time - self._first_started) * self._true_rate)

    def _listen(self, understood: bool) -> None:
        try:
            received = os.read(self._master, 256)
        except OSError:
            return  # no reply, or the port is not open
        if understood and self.line.happening(self._scans_until(self._clock.now()), self._true_rate) != "silent":
            self.receive(received)

    def _sample(self, started: int) -> None:
        due = math.floor(((self._clock.now() - started) * 1e-9 - self._delay) * self._true_rate) + 1
        n = due - self._due
        if n <= 0:
            return
        counts = self._source.read(self._due, n)
        room = max(0, (PORT_BUFFER - len(self._pending)) // self._frame_size)
        self.dropped += max(0, n - room)
        if room:
            self.say(self.line.carried(self._framed(counts[:room], started)))
            self.sent += min(n, room)
        self._due = due

    def _framed(self, counts: IntArray, started: int) -> bytes:
        """Return the frames of the scans that are due, as far as the line transmits them."""
        parts = []
        number = self.line.counter + self._due
        first = self._scans_until(started) + self._due
        for start, stop, what in self.line.runs(first, len(counts), self._true_rate):
            if what is None:
                parts.append(self.encode(counts[start:stop], number + start))
            elif what in ("repeated", "cut"):
                frames = [self.encode(counts[k : k + 1], number + k) for k in range(start, stop)]
                parts += [2 * frame if what == "repeated" else frame[: len(frame) // 2] for frame in frames]
        return b"".join(parts)
