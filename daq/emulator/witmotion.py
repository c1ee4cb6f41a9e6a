"""A WitMotion WT901 on a pty."""

import numpy as np

from daq.emulator.line_faults import NO_FAULTS, LineFaults
from daq.emulator.serial_port import SerialEmulator
from daq.emulator.serving import SampleSource
from daq.emulator.wit_settings import WitSettings
from daq.protocol import witmotion as wit
from daq.timing.host_clock import HostClock
from daq.types import IntArray


class EmulatedWitmotion(SerialEmulator):
    """The device side of one WT901: it sends from its start on, and takes settings once it is unlocked.

    Parameters
    ----------
    source : measured signal, in counts of `daq.protocol.witmotion.SCALE`; clipped beyond 16 g
    clock : simulated clock
    clock_error : of its own oscillator, 1e-6 = 1 ppm fast
    temperature : [degC]
    faults : of its line
    """

    def __init__(
        self,
        source: SampleSource,
        clock: HostClock,
        *,
        clock_error: float = 0.0,
        temperature: float = 21.0,
        faults: LineFaults = NO_FAULTS,
    ) -> None:
        super().__init__(
            source, clock, frame_size=wit.N_TYPES * wit.PACKET_SIZE, clock_error=clock_error, faults=faults
        )
        self._settings = WitSettings(temperature)
        self._commands = bytearray()
        self.start(self._settings.rate)

    def receive(self, data: bytes) -> None:
        """Execute commands of the host."""
        self._commands += data
        while len(self._commands) >= wit.COMMAND_SIZE:
            if self._commands[:2] != wit.UNLOCK[:2]:
                del self._commands[0]
                continue
            command = bytes(self._commands[: wit.COMMAND_SIZE])
            del self._commands[: wit.COMMAND_SIZE]
            if self._settings.obey(command):
                self.stop()
                self.start(self._settings.rate, self._settings.delay)

    def encode(self, counts: IntArray, first: int) -> bytes:
        """Return the packets of scans (n, 3), each of all configured types."""
        del first  # they are not numbered
        parts = [
            np.frombuffer(wit.encode_packets(kind, words), np.uint8).reshape(-1, wit.PACKET_SIZE)
            for kind, words in self._settings.packets(counts)
        ]
        return np.stack(parts, axis=1).tobytes() if parts else b""
