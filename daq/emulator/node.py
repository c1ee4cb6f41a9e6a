"""A home-built node on a pty."""

import numpy as np

from daq.emulator.serial_port import SerialEmulator
from daq.emulator.serving import NO_FAULTS, LineFaults, SampleSource
from daq.protocol import node
from daq.timing.host_clock import HostClock
from daq.types import IntArray

ADXL355_SCALE = 9.80665 * 3.9e-6  #: m/s2 per count, in its range of 2 g


class EmulatedNode(SerialEmulator):
    """The device side of one node, as docs/howto/rig/node.md describes it.

    Parameters
    ----------
    source : measured signal
    clock : simulated clock
    serial_number : at most 12 characters
    rate : fixed rate of a node that ignores the host: it sends scans from the start, and its hello once per second.
        Default: set by the host
    scale : m/s2 per count
    axes : that it measures
    clock_error : of its own oscillator, 1e-6 = 1 ppm fast
    temperature : [degC], None without a sensor
    faults : of its line
    """

    def __init__(
        self,
        source: SampleSource,
        clock: HostClock,
        *,
        serial_number: str,
        rate: float | None = None,
        scale: float = ADXL355_SCALE,
        axes: tuple[int, ...] = (0, 1, 2),
        clock_error: float = 0.0,
        temperature: float | None = 21.0,
        faults: LineFaults = NO_FAULTS,
    ) -> None:
        super().__init__(source, clock, frame_size=node.SCAN_SIZE, clock_error=clock_error, faults=faults)
        self._serial_number, self._scale, self._axes = serial_number, scale, axes
        self._temperature = node.NO_TEMPERATURE if temperature is None else round(100 * temperature)
        self._decoder = node.CommandDecoder()
        self._listens = rate is None
        self._rate = rate or 1000.0
        if not self._listens:
            self.start(self._rate)

    def receive(self, data: bytes) -> None:
        """Execute commands of the host, if the node receives them."""
        for command, rate in self._decoder.feed(data) if self._listens else []:
            if command == node.STOP:
                self.stop()
            elif command == node.WHO:
                self._introduce()
            elif command == node.START and rate > 0:
                self._rate = rate
                self.stop()
                self._introduce()
                self.start(rate)

    def encode(self, counts: IntArray, first: int) -> bytes:
        """Return the frames of scans (n, 3) from number `first` on; a hello before every second, if it does not listen.

        The clock and the sampling of the device have the same error: one oscillator drives both.
        """
        if not self._listens and first // self._rate != (first + len(counts)) // self._rate:
            self._introduce()
        number = first + np.arange(len(counts))
        time = np.floor(number * (1e6 / self._rate))
        return node.encode_scans(
            node.NodeScans(
                counts,
                (number % 2**32).astype(np.uint32),
                (time % 2**32).astype(np.uint32),
                np.full(len(counts), self._temperature, np.int16),
            )
        )

    def _introduce(self) -> None:
        hello = node.Hello(
            product="emulated", serial=self._serial_number, axes=self._axes, scale=self._scale, rate=self._rate
        )
        self.say(node.encode_hello(hello))
