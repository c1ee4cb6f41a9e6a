"""A WitMotion WT901 on a pty."""

import numpy as np

from daq.emulator.line_faults import NO_FAULTS, LineFaults
from daq.emulator.serial_port import SerialEmulator
from daq.emulator.serving import SampleSource
from daq.hostclock import HostClock
from daq.protocol import witmotion as wit
from daq.recording import IntArray

_AS_BOUGHT = 0b11110  #: accelerations, turning rates, angles and field
_LARGEST = 2**15 - 1


class EmulatedWitmotion(SerialEmulator):
    """The device side of one WT901: it sends from its start on, and takes settings once it is unlocked.

    Parameters
    ----------
    source : what it measures, in counts of `daq.protocol.witmotion.SCALE`; beyond 16 g it clips
    clock : of the world it lives in
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
        self._temperature = round(100 * temperature)
        self._content = _AS_BOUGHT
        self._unlocked = False
        self._commands = bytearray()
        self.start(10.0)

    def hear(self, data: bytes) -> None:
        """Obey the host."""
        self._commands += data
        while len(self._commands) >= wit.COMMAND_SIZE:
            if self._commands[:2] != wit.UNLOCK[:2]:
                del self._commands[0]
                continue
            command = bytes(self._commands[: wit.COMMAND_SIZE])
            del self._commands[: wit.COMMAND_SIZE]
            if command == wit.UNLOCK:
                self._unlocked = True
            elif self._unlocked:
                self._written(command[2], command[3] | command[4] << 8)

    def _written(self, address: int, value: int) -> None:
        if address == wit.CONTENT:
            self._content = value
        elif address == wit.RATE:
            rates = [rate for rate, (code, _) in wit.RATES.items() if code == value]
            if rates:
                self.stop()
                self.start(float(rates[0]))

    def encode(self, counts: IntArray, first: int) -> bytes:
        """Return the packets of scans (n, 3), each of all types that it was told to send."""
        del first  # they are not numbered
        words = np.zeros((len(counts), 4), np.int16)
        words[:, :3] = np.clip(counts, -_LARGEST - 1, _LARGEST)
        words[:, 3] = self._temperature
        kinds = [wit.FIRST_TYPE + bit for bit in range(wit.N_TYPES) if self._content >> bit & 1]
        parts = [
            np.frombuffer(wit.encode_packets(kind, words if kind == wit.ACCELERATION else 0 * words), np.uint8)
            for kind in kinds
        ]
        return np.stack([part.reshape(-1, wit.PACKET_SIZE) for part in parts], axis=1).tobytes() if parts else b""
