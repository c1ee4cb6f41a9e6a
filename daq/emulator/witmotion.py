"""A WitMotion WT901 on a pty."""

import numpy as np
import numpy.typing as npt

from daq.emulator.serial_port import SerialEmulator
from daq.emulator.serving import NO_FAULTS, LineFaults, SampleSource
from daq.protocol import witmotion as wit
from daq.timing.host_clock import HostClock
from daq.types import IntArray

_AS_BOUGHT = 0b11110  # accelerations, turning rates, angles and field
_LARGEST = 2**15 - 1


class WitSettings:
    """Registers, which are written once they are unlocked.

    Parameters
    ----------
    temperature : that it sends with its accelerations [degC]
    """

    def __init__(self, temperature: float) -> None:
        self._temperature = round(100 * temperature)
        self._content, self._unlocked = _AS_BOUGHT, False
        self.rate = 10.0  #: scans per second [Hz]
        self.delay = 0.0  #: group delay of the filter [s]; a new device has none

    def obey(self, command: bytes) -> bool:
        """Execute a command of five bytes; return whether sampling restarts at another rate."""
        if command == wit.UNLOCK:
            self._unlocked = True
        if command == wit.UNLOCK or not self._unlocked:
            return False
        address, value = command[2], command[3] | command[4] << 8
        if address == wit.CONTENT:
            self._content = value
        elif address == wit.BANDWIDTH:
            self.delay = wit.DELAY.get(value, 0.0)
        rates = [rate for rate, (code, _) in wit.RATES.items() if (address, value) == (wit.RATE, code)]
        self.rate = float(rates[0]) if rates else self.rate
        return bool(rates)

    def packets(self, counts: IntArray) -> list[tuple[int, npt.NDArray[np.int16]]]:
        """Return the types of packets that it sends, in their order, and the words (n, 4) of each for scans (n, 3)."""
        words = np.zeros((len(counts), 4), np.int16)
        words[:, :3] = np.clip(counts, -_LARGEST - 1, _LARGEST)
        words[:, 3] = self._temperature
        kinds = [wit.FIRST_TYPE + bit for bit in range(wit.N_TYPES) if self._content >> bit & 1]
        return [(kind, words if kind == wit.ACCELERATION else 0 * words) for kind in kinds]


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
