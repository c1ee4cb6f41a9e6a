"""The registers of an Epson M-A352 (and alike M-A370, M-A552AR1) behind an open serial port."""

import time

from daq.drivers.serial.port import SerialPort
from daq.protocol import epson
from daq.protocol.epson_filters import FILTERS
from daq.types import DeviceIdentity

_STALL = 400e-6  # s between commands, at least 350 us
_FILTER_SECONDS = 2.0


class EpsonRegisters:
    """Access to the registers of a device that does not sample.

    Each call may raise OSError if the port is gone, or ValueError if the reply is invalid.

    Parameters
    ----------
    port : open
    """

    def __init__(self, port: SerialPort) -> None:
        self._port = port

    def identify(self) -> DeviceIdentity:
        """Identify the device; it stops sampling."""
        self.stop()
        time.sleep(0.02)  # a frame that was on its way ends
        self._port.discard_input()
        found = self._read(0, epson.ID)
        if found != epson.IDENTITY:
            raise ValueError(f"identity: expected {epson.IDENTITY:#06x}, found {found:#06x}")
        return DeviceIdentity(
            product=self._text(epson.PRODUCT),
            serial=self._text(epson.SERIAL),
            version=f"{self._read(1, epson.VERSION):04x}",
        )

    def configure(self, rate: int) -> None:
        """Set a rate of `epson.RATES` [Hz], the filter that fits it, and burst frames."""
        self._write(1, epson.SMPL_CTRL, epson.RATES[rate])
        self._write(1, epson.FILTER_CTRL, FILTERS[rate])
        self._wait_for_filter()
        self._write(1, epson.BURST_CTRL_LOW, epson.BURST_ALL & 0xFF)
        self._write(1, epson.BURST_CTRL_HIGH, epson.BURST_ALL >> 8)
        self._write(1, epson.UART_CTRL, epson.UART_AUTO)

    def start(self) -> None:
        """Let it sample."""
        self._write(0, epson.MODE_CTRL, epson.MODE_SAMPLING)

    def stop(self) -> None:
        """Let it sample no more."""
        self._write(0, epson.MODE_CTRL, epson.MODE_CONFIG)

    def _wait_for_filter(self) -> None:
        time.sleep(0.1)
        end = time.monotonic() + _FILTER_SECONDS
        while self._read(1, epson.FILTER_CTRL) & epson.FILTER_BUSY:
            if time.monotonic() > end:
                raise ValueError("the filter was not set within 2 s")

    def _write(self, window: int, address: int, value: int) -> None:
        for command in (epson.write_register(epson.WINDOW, window), epson.write_register(address, value)):
            self._port.write(command)
            time.sleep(_STALL)

    def _read(self, window: int, address: int) -> int:
        self._port.write(epson.write_register(epson.WINDOW, window))
        time.sleep(_STALL)
        self._port.write(epson.read_register(address))
        value = epson.parse_reply(self._port.answer(4), address)
        time.sleep(_STALL)
        return value

    def _text(self, registers: range) -> str:
        """Return the text in registers, two characters each, low byte first."""
        raw = b"".join(self._read(1, address).to_bytes(2, "little") for address in registers)
        return raw.decode("ascii", "replace").strip("\0 ")
