"""An Epson M-A352 on a pty."""

from daq.emulator.serial_port import SerialEmulator
from daq.emulator.serving import NO_FAULTS, LineFaults, SampleSource
from daq.protocol import epson
from daq.protocol.epson_filters import TAPS, group_delay
from daq.timing.host_clock import HostClock
from daq.types import IntArray

_SERIAL_LENGTH = 8


class EmulatedEpson(SerialEmulator):
    """The device side of one M-A352: it answers registers and streams burst frames with the delay of its filter.

    Parameters
    ----------
    source : measured signal
    clock : simulated clock
    serial_number : eight characters
    clock_error : of its own oscillator, 1e-6 = 1 ppm fast
    temperature : [degC]
    faults : of its line
    """

    def __init__(
        self,
        source: SampleSource,
        clock: HostClock,
        *,
        serial_number: str,
        clock_error: float = 0.0,
        temperature: float = 21.0,
        faults: LineFaults = NO_FAULTS,
    ) -> None:
        super().__init__(source, clock, frame_size=epson.FRAME_SIZE, clock_error=clock_error, faults=faults)
        self._temperature = epson.temperature_raw(temperature)
        self._registers = _registers(serial_number)
        self._window = 0
        self._commands = bytearray()
        self._rate = 1000.0

    def receive(self, data: bytes) -> None:
        """Execute commands of the host."""
        self._commands += data
        while len(self._commands) >= 3:
            address, value, end = self._commands[:3]
            if end != epson.DELIMITER:
                del self._commands[0]
                continue
            del self._commands[:3]
            if address & 0x80:
                self._written(address & 0x7F, value)
            else:
                self.say(epson.register_reply(address, self._registers.get((self._window, address & ~1), 0)))

    def encode(self, counts: IntArray, first: int) -> bytes:
        """Return the burst frames of scans (n, 3) from number `first` on."""
        return epson.encode_frames(counts, first, self._temperature)

    def _written(self, address: int, value: int) -> None:
        if address == epson.WINDOW:
            self._window = value
            return
        key, high = (self._window, address & ~1), address & 1
        old = self._registers.get(key, 0)
        self._registers[key] = (old & 0x00FF | value << 8) if high else (old & 0xFF00 | value)
        if (self._window, address) == (0, epson.MODE_CTRL):
            self._mode(value)
        elif (self._window, address) == (1, epson.SMPL_CTRL):
            self._rate = next((float(r) for r, code in epson.RATES.items() if code == value), self._rate)

    def _mode(self, value: int) -> None:
        self._registers[0, epson.MODE_CTRL & ~1] = (value & epson.MODE_CONFIG) << 9  # MODE_STAT: configuring
        if value == epson.MODE_SAMPLING and self.sampling_since is None:
            number = self._registers.get((1, epson.FILTER_CTRL), 0)
            self.start(self._rate, group_delay(number) if number in TAPS else 0.0)
        elif value == epson.MODE_CONFIG:
            self.stop()


def _registers(serial_number: str) -> dict[tuple[int, int], int]:
    """Return the registers of an M-A352 after reset, by (window, address)."""
    text = [("A352AD10", epson.PRODUCT), (serial_number.ljust(_SERIAL_LENGTH)[:_SERIAL_LENGTH], epson.SERIAL)]
    values = {
        (1, address): int.from_bytes(word[2 * i : 2 * i + 2].encode(), "little")
        for word, registers in text
        for i, address in enumerate(registers)
    }
    return {**values, (0, epson.ID): epson.IDENTITY, (1, epson.VERSION): 0x0100, (0, 2): epson.MODE_CONFIG << 9}
