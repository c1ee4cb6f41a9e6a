"""An Epson M-A352 on a pty."""

import os
import tty

from daq.emulator.serving import PORT_BUFFER, SampleSource
from daq.hostclock import HostClock
from daq.protocol import epson

_SERIAL_LENGTH = 8


class EmulatedEpson:
    """The device side of one M-A352.

    It answers registers and streams burst frames. It never waits for a reader: beyond the pty's own buffer it holds
    as much as the kernel would of a real port's bytes, and then drops whole frames and counts them.

    Parameters
    ----------
    source : what it measures
    clock : of the world it lives in
    serial_number : eight characters
    clock_error : of its own oscillator, 1e-6 = 1 ppm fast
    temperature : [degC]
    """

    def __init__(
        self,
        source: SampleSource,
        clock: HostClock,
        *,
        serial_number: str,
        clock_error: float = 0.0,
        temperature: float = 21.0,
    ) -> None:
        self._source, self._clock, self._clock_error = source, clock, clock_error
        self._temperature = epson.temperature_raw(temperature)
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)  #: path to open on the host's side
        self._registers = _registers(serial_number)
        self._window = 0
        self._unplugged = False
        self._commands = bytearray()
        self._pending = bytearray()
        self._started: int | None = None
        self._rate = 1000.0
        self._due = 0
        self.sent = 0  #: frames handed to the pty
        self.dropped = 0  #: frames that found it full

    @property
    def sampling_since(self) -> int | None:
        """Time of the first scan [ns UTC], None while it is not sampling."""
        return self._started

    def close(self) -> None:
        """Unplug: the host's side reads an error from now on; once is enough."""
        if not self._unplugged:
            self._unplugged = True
            os.close(self._slave)
            os.close(self._master)

    def serve(self) -> None:
        """Answer commands and send what is due; returns at once. Does nothing once unplugged."""
        if self._unplugged:
            return
        self._listen()
        if self._started is not None:
            self._sample(self._started)
        self._drain()

    def _listen(self) -> None:
        try:
            self._commands += os.read(self._master, 256)
        except OSError:
            return  # nothing said, or nobody has the port open
        while len(self._commands) >= 3:
            address, value, end = self._commands[:3]
            if end != epson.DELIMITER:
                del self._commands[0]
                continue
            del self._commands[:3]
            if address & 0x80:
                self._written(address & 0x7F, value)
            else:
                self._pending += epson.register_reply(address, self._registers.get((self._window, address & ~1), 0))

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
        if value == epson.MODE_SAMPLING and self._started is None:
            self._started, self._due = self._clock.now(), 0
            self._source.start(self._started, self._rate * (1 + self._clock_error))
        elif value == epson.MODE_CONFIG:
            self._started = None
            self._pending.clear()

    def _sample(self, started: int) -> None:
        due = int((self._clock.now() - started) * 1e-9 * self._rate * (1 + self._clock_error)) + 1
        n = due - self._due
        if n <= 0:
            return
        counts = self._source.read(self._due, n)
        room = max(0, (PORT_BUFFER - len(self._pending)) // epson.FRAME_SIZE)
        self.dropped += max(0, n - room)
        if room:
            self._pending += epson.encode_frames(counts[:room], self._due, self._temperature)
            self.sent += min(n, room)
        self._due = due

    def _drain(self) -> None:
        if self._pending:
            try:
                del self._pending[: os.write(self._master, self._pending)]
            except OSError:
                return  # full: a real line would hold it too


def _registers(serial_number: str) -> dict[tuple[int, int], int]:
    """Return what an M-A352 holds after reset, by (window, address)."""
    text = [("A352AD10", epson.PRODUCT), (serial_number.ljust(_SERIAL_LENGTH)[:_SERIAL_LENGTH], epson.SERIAL)]
    values = {
        (1, address): int.from_bytes(word[2 * i : 2 * i + 2].encode(), "little")
        for word, registers in text
        for i, address in enumerate(registers)
    }
    return {**values, (0, epson.ID): epson.IDENTITY, (1, epson.VERSION): 0x0100, (0, 2): epson.MODE_CONFIG << 9}
