"""Epson M-A352 (and alike M-A370, M-A552AR1) over a serial line."""

import sys
import time
from typing import Any

import numpy as np
import serial

from daq.bites import Bites
from daq.drivers.base import Scans
from daq.drivers.rates import known_rate
from daq.drivers.serial_port import bites_of
from daq.errors import DeviceLost, DriverError
from daq.found import Found, PortAnswer
from daq.protocol import epson

BAUD = 460800
_STALL = 400e-6  # s between commands, at least 350 us
_REPLY_SECONDS = 1.0
_SEARCH_SECONDS = 0.3  # that a port is given to answer where nobody knows who is there
_READ_SECONDS = 0.1
_FILTER_SECONDS = 2.0
if sys.platform == "win32":
    _PORT_ERRORS: tuple[type[Exception], ...] = (OSError,)
else:
    import termios

    _PORT_ERRORS = (OSError, termios.error)  # SerialException is an OSError, what flushing raises is not


class EpsonUart:
    """Driver of one device.

    Parameters
    ----------
    port : path of the serial port
    rate : scans a second, one of 50, 100, 200, 500, 1000 [Hz]

    Raises
    ------
    ValueError
        If the device has no such rate.
    """

    scale = epson.SCALE
    modulus = 1 << 16

    def __init__(self, port: str, rate: float) -> None:
        self._port, self._rate = port, known_rate(rate, epson.RATES, port)
        self._serial: serial.Serial | None = None
        self._bites: Bites | None = None
        self._decoder = epson.BurstDecoder()

    def open(self) -> dict[str, Any]:
        """Open the port, check who answers, set rate, filter and burst format, start sampling."""
        try:
            self._serial = serial.Serial(self._port, BAUD, timeout=_REPLY_SECONDS, write_timeout=1.0, exclusive=True)
            identity = self._configure()
        except (*_PORT_ERRORS, ValueError) as error:
            self.close()
            raise DriverError(self._port, f"no M-A352 answers: {error}") from error
        self._decoder = epson.BurstDecoder()
        self._bites = bites_of(self._serial)
        return identity

    def identify(self) -> dict[str, Any]:
        """Ask who answers, and free the port; a device that was sampling stops."""
        try:
            self._serial = serial.Serial(self._port, BAUD, timeout=_SEARCH_SECONDS, write_timeout=1.0, exclusive=True)
            return self._identify()
        except (*_PORT_ERRORS, ValueError) as error:
            raise DriverError(self._port, f"no M-A352 answers: {error}") from error
        finally:
            self.close()

    def _identify(self) -> dict[str, Any]:
        self._write(0, epson.MODE_CTRL, epson.MODE_CONFIG)
        time.sleep(0.02)  # a frame that was on its way ends
        self._line.reset_input_buffer()
        found = self._read(0, epson.ID)
        if found != epson.IDENTITY:
            raise ValueError(f"identity: expected {epson.IDENTITY:#06x}, found {found:#06x}")
        return {
            "product": self._text(epson.PRODUCT),
            "serial": self._text(epson.SERIAL),
            "version": f"{self._read(1, epson.VERSION):04x}",
        }

    def _configure(self) -> dict[str, Any]:
        identity = self._identify()
        self._write(1, epson.SMPL_CTRL, epson.RATES[self._rate])
        self._write(1, epson.FILTER_CTRL, 8)
        self._wait_for_filter()
        self._write(1, epson.BURST_CTRL_LOW, epson.BURST_ALL & 0xFF)
        self._write(1, epson.BURST_CTRL_HIGH, epson.BURST_ALL >> 8)
        self._write(1, epson.UART_CTRL, epson.UART_AUTO)
        self._write(0, epson.MODE_CTRL, epson.MODE_SAMPLING)
        return identity

    def _wait_for_filter(self) -> None:
        time.sleep(0.1)
        end = time.monotonic() + _FILTER_SECONDS
        while self._read(1, epson.FILTER_CTRL) & epson.FILTER_BUSY:
            if time.monotonic() > end:
                raise ValueError("the filter was not set within 2 s")

    @property
    def _line(self) -> serial.Serial:
        if self._serial is None:
            raise DeviceLost(self._port, "is not open")
        return self._serial

    def _write(self, window: int, address: int, value: int) -> None:
        for command in (epson.write_register(epson.WINDOW, window), epson.write_register(address, value)):
            self._line.write(command)
            time.sleep(_STALL)

    def _read(self, window: int, address: int) -> int:
        self._line.write(epson.write_register(epson.WINDOW, window))
        time.sleep(_STALL)
        self._line.write(epson.read_register(address))
        value = epson.parse_reply(self._line.read(4), address)
        time.sleep(_STALL)
        return value

    def _text(self, registers: range) -> str:
        """Return what registers spell, two characters each, low byte first."""
        raw = b"".join(self._read(1, address).to_bytes(2, "little") for address in registers)
        return raw.decode("ascii", "replace").strip("\0 ")

    def read(self) -> Scans:
        """Return the scans that have arrived; none if nothing came within 0.1 s."""
        if self._bites is None:
            raise DeviceLost(self._port, "is not open")
        try:
            data = self._bites.read(_READ_SECONDS)
        except _PORT_ERRORS as error:
            raise DeviceLost(self._port, f"the port is gone: {error}") from error
        before = self._decoder.bad_bytes
        frames = self._decoder.feed(data)
        celsius = epson.temperature_celsius(frames.temperature)
        return Scans(
            counts=frames.counts,
            counter=frames.counter.astype(np.int32),
            temperature=float(celsius.mean()) if len(celsius) else float("nan"),
            bad_bytes=self._decoder.bad_bytes - before,
            age=time.perf_counter_ns() - self._bites.arrived,
        )

    def close(self) -> None:
        """Stop sampling if the device still listens, and free the port."""
        if self._serial is None:
            return
        try:
            self._write(0, epson.MODE_CTRL, epson.MODE_CONFIG)
            self._serial.close()
        except _PORT_ERRORS:
            self._serial.close()  # it is gone: nothing to stop
        self._serial = self._bites = None


def search(path: str, _: int) -> PortAnswer | None:
    """Ask for such a device at a port."""
    try:
        identity = EpsonUart(path, max(epson.RATES)).identify()
    except DriverError:
        return None
    found = Found(driver="epson-uart", place=path, identity=identity)
    return PortAnswer(who=f"{identity['product']} {identity['serial']}", devices=(found,))
