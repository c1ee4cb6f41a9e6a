"""Epson M-A352 (and alike M-A370, M-A552AR1) over a serial line."""

from typing import Any

import numpy as np

from daq.drivers.addresses import Found, PortAnswer
from daq.drivers.base import Scans
from daq.drivers.rates import known_rate
from daq.drivers.serial.epson_registers import EpsonRegisters
from daq.drivers.serial.port import PORT_ERRORS, SerialPort
from daq.errors import DeviceLost, DriverError
from daq.protocol import epson
from daq.protocol.epson_filters import FILTERS, group_delay

BAUD = 460800
_REPLY_SECONDS = 1.0
_SEARCH_SECONDS = 0.3  # that a port is given to answer where nobody knows who is there


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
        self._path, self._rate = port, known_rate(rate, epson.RATES, port)
        self.delay = group_delay(FILTERS[self._rate])  #: of its filter [s]
        self._port: SerialPort | None = None
        self._decoder = epson.BurstDecoder()

    def open(self) -> dict[str, Any]:
        """Open the port, check who answers, set rate, filter and burst format, start sampling."""
        try:
            self._port = SerialPort(self._path, BAUD, _REPLY_SECONDS)
            registers = EpsonRegisters(self._port)
            identity = registers.identify()
            registers.configure(self._rate)
            registers.start()
        except (*PORT_ERRORS, ValueError) as error:
            self.close()
            raise DriverError(self._path, f"no M-A352 answers: {error}") from error
        self._decoder = epson.BurstDecoder()
        return identity

    def read(self) -> Scans:
        """Return the scans that have arrived; none if nothing came within 0.1 s."""
        if self._port is None:
            raise DeviceLost(self._path, "is not open")
        before = self._decoder.bad_bytes
        frames = self._decoder.feed(self._port.read())
        celsius = epson.temperature_celsius(frames.temperature)
        return Scans(
            counts=frames.counts,
            counter=frames.counter.astype(np.int32),
            temperature=float(celsius.mean()) if len(celsius) else float("nan"),
            bad_bytes=self._decoder.bad_bytes - before,
            age=self._port.age,
        )

    def close(self) -> None:
        """Stop sampling if the device still listens, and free the port."""
        port, self._port = self._port, None
        if port is None:
            return
        try:
            EpsonRegisters(port).stop()
        except PORT_ERRORS:
            pass  # it is gone: nothing to stop
        finally:
            port.close()


def search(path: str, _: int) -> PortAnswer | None:
    """Ask for such a device at a port, and free it; one that was sampling stops."""
    try:
        port = SerialPort(path, BAUD, _SEARCH_SECONDS)
    except PORT_ERRORS:
        return None
    try:
        identity = EpsonRegisters(port).identify()
    except (*PORT_ERRORS, ValueError):
        return None
    finally:
        port.close()
    found = Found(driver="epson-uart", place=path, identity=identity)
    return PortAnswer(who=f"{identity['product']} {identity['serial']}", devices=(found,))
