"""Epson M-A352 (and alike M-A370, M-A552AR1) over a serial line."""

import time

import numpy as np

from daq.drivers.base import Found, PortAnswer, Scans, known_rate
from daq.drivers.serial.base import PORT_ERRORS, SerialDriver, SerialPort
from daq.protocol import epson
from daq.protocol.epson_filters import FILTERS, group_delay
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
    scale = epson.EPSON_SCALE

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
