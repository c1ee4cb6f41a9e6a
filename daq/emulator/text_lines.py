"""A sensor that sends lines of text, on a pty."""

import numpy as np

from daq.emulator.serial_port import SerialEmulator
from daq.emulator.serving import NO_FAULTS, LineFaults, SampleSource
from daq.protocol.text_line import LONGEST, LineFormat, TextScans, encode_lines
from daq.timing.host_clock import HostClock
from daq.types import IntArray

_CLOCK_BITS = 32  # of the clock, in ms or us


class EmulatedTextLines(SerialEmulator):
    """The device side of one microcontroller: it sends from its start on, and ignores what the host sends.

    Parameters
    ----------
    source : measured signal, in counts of `LineFormat.step`
    clock : simulated clock
    form : format of its lines
    rate : scans per second [Hz]
    checksum : whether its lines have one
    clock_error : of its own oscillator, 1e-6 = 1 ppm fast
    temperature : [degC]
    faults : of its line
    """

    def __init__(
        self,
        source: SampleSource,
        clock: HostClock,
        form: LineFormat,
        *,
        rate: float,
        checksum: bool = False,
        clock_error: float = 0.0,
        temperature: float = 21.0,
        faults: LineFaults = NO_FAULTS,
    ) -> None:
        super().__init__(source, clock, frame_size=LONGEST, clock_error=clock_error, faults=faults)
        self._form, self._rate, self._checksum, self._temperature = form, rate, checksum, temperature
        self.start(rate)

    def receive(self, data: bytes) -> None:
        """Ignore commands of the host."""

    def encode(self, counts: IntArray, first: int) -> bytes:
        """Return the lines of scans (n, 3) from number `first` on; counter and clock wrap."""
        number = first + np.arange(len(counts))
        wrap = {"time_ms": 2**_CLOCK_BITS * 1e-3, "time_us": 2**_CLOCK_BITS * 1e-6}.get(self._form.time or "", np.inf)
        scans = TextScans(
            counts,
            (number % (1 << self._form.counter_bits)).astype(np.intp),
            np.asarray((number / self._rate) % wrap),
            np.full(len(counts), self._temperature),
            number,
        )
        return encode_lines(scans, self._form, checksum=self._checksum)
