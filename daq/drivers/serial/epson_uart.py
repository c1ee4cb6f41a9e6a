"""Epson M-A352 (and alike M-A370, M-A552AR1) over a serial line."""

import numpy as np

from daq.drivers.addresses import Found, PortAnswer
from daq.drivers.base import Scans, known_rate
from daq.drivers.serial.base import SerialDriver
from daq.drivers.serial.epson_registers import EpsonRegisters
from daq.drivers.serial.port import PORT_ERRORS, SerialPort
from daq.protocol import epson
from daq.protocol.epson_filters import FILTERS, group_delay
from daq.types import DeviceIdentity

BAUD = 460800
_REPLY_SECONDS = 1.0
_SEARCH_SECONDS = 0.3  # time limit of a reply at a port with an unknown device [s]


class EpsonUart(SerialDriver[epson.BurstDecoder, SerialPort]):
    """Driver of one device.

    Parameters
    ----------
    port : path of the serial port
    rate : one of 50, 100, 200, 500, 1000 scans per second [Hz]

    Raises
    ------
    ValueError
        If the device has no such rate.
    """

    product = "M-A352"
    scale = epson.SCALE

    def __init__(self, port: str, rate: float) -> None:
        super().__init__(port)
        self._rate = known_rate(rate, epson.RATES, port)
        self.delay = group_delay(FILTERS[self._rate])  #: group delay of the filter [s]
        self._decoder = epson.BurstDecoder()

    def _connect(self) -> SerialPort:
        return SerialPort(self._path, BAUD, _REPLY_SECONDS)

    def _start(self, port: SerialPort) -> DeviceIdentity:
        registers = EpsonRegisters(port)
        identity = registers.identify()
        registers.configure(self._rate)
        registers.start()
        self._decoder = epson.BurstDecoder()
        return identity

    def _decode(self, data: bytes) -> Scans:
        frames = self._decoder.feed(data)
        celsius = epson.temperature_celsius(frames.temperature)
        return Scans(
            counts=frames.counts,
            counter=frames.counter.astype(np.int32),
            temperature=float(celsius.mean()) if len(celsius) else float("nan"),
            bad_bytes=0,
        )

    def _stop(self, port: SerialPort) -> None:
        EpsonRegisters(port).stop()


def search(path: str, _: int) -> PortAnswer | None:
    """Search for such a device at a port, and free the port; a sampling device stops."""
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
    return PortAnswer(who=str(identity), devices=(found,))
