"""Common part of the drivers of devices on serial ports and of those that send the same bytes over a network."""

import sys
import time
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import ClassVar, Generic, Protocol, TypeVar

from daq.drivers.base import Scans
from daq.drivers.serial.buffered_port import BufferedPort
from daq.drivers.serial.line import open_line
from daq.errors import DeviceLost, DriverError, system_reason
from daq.types import DeviceIdentity

READ_SECONDS = 0.1  #: time limit of a read for the first byte [s]
if sys.platform == "win32":
    PORT_ERRORS: tuple[type[Exception], ...] = (OSError,)
else:
    import termios

    PORT_ERRORS = (OSError, termios.error)  #: SerialException is an OSError; flushing raises termios.error
_GATHER_SECONDS = 0.19  # with the wait for the next scan a block's 0.2 s
_MIN_RATE = 500.0  # bytes/s: slower devices are read scan by scan


class SerialPort:
    """An open serial port, opened exclusively.

    Parameters
    ----------
    path : of the port
    baud : 8 data bits, no parity [bit/s]
    answer_seconds : that `answer` waits for all of it [s]

    Raises
    ------
    OSError
        If it cannot be opened.
    """

    def __init__(self, path: str, baud: int, answer_seconds: float = READ_SECONDS) -> None:
        self._path = path
        self._line = open_line(path, baud, timeout=answer_seconds)
        self._bites = BufferedPort(self._line.fileno(), most_seconds=_GATHER_SECONDS, least_rate=_MIN_RATE)

    def read(self) -> bytes:
        """Return the received bytes; empty if nothing arrives within `READ_SECONDS`.

        Raises
        ------
        DeviceLost
            If the port is gone.
        """
        try:
            return self._bites.read(READ_SECONDS)
        except PORT_ERRORS as error:
            raise DeviceLost(self._path, f"the port is not available: {error}") from error

    @property
    def age(self) -> int:
        """Time since the last read's bytes were here [ns]."""
        return time.perf_counter_ns() - self._bites.arrived

    def write(self, data: bytes) -> None:
        """Send bytes; OSError if the port is gone."""
        self._line.write(data)

    def answer(self, size: int) -> bytes:
        """Return the requested number of bytes, or those received in time; OSError if the port is gone."""
        answer: bytes = self._line.read(size)
        return answer

    def discard_input(self) -> None:
        """Discard received bytes."""
        self._line.reset_input_buffer()

    def set_baud(self, baud: int) -> None:
        """Continue at another baud rate [bit/s]; OSError if the port is gone."""
        self._line.baudrate = baud

    def close(self) -> None:
        """Free the port."""
        self._line.close()


class Decoder(Protocol):
    """Decoder of a byte stream."""

    bad_bytes: int  #: bytes outside intact frames, so far


class BytePort(Protocol):
    """Open port from which bytes are read."""

    @property
    def age(self) -> int:
        """Time since the last read's bytes were here [ns]."""

    def read(self) -> bytes:
        """Return the received bytes; empty if nothing arrives within `READ_SECONDS`; DeviceLost if the port is gone."""

    def discard_input(self) -> None:
        """Discard received bytes."""

    def close(self) -> None:
        """Free the port."""


D = TypeVar("D", bound=Decoder)
P = TypeVar("P", bound=BytePort)


class SerialDriver(ABC, Generic[D, P]):
    """Driver of one device on a port.

    A subclass has the constants of the device, connects and configures it, and decodes its data.

    Parameters
    ----------
    port : path of the serial port, or its address
    """

    product: ClassVar[str]  #: name of the device in error messages
    scale: float  #: [m/s2 per count]
    modulus = 1 << 16  #: counter values before the counter wraps

    _decoder: D

    def __init__(self, port: str) -> None:
        self._path = port
        self._port: P | None = None

    def open(self) -> DeviceIdentity:
        """Open the port, identify and configure the device, start sampling; return the identity.

        Raises
        ------
        DriverError
            If the port cannot be opened, or the device does not respond as its protocol requires.
        """
        try:
            self._port = self._connect()
            return self._start(self._port)
        except (*PORT_ERRORS, DeviceLost, ValueError) as error:
            self.close()
            raise DriverError(self._path, f"no {self.product} answers: {system_reason(error)}") from error

    def read(self) -> Scans:
        """Return the scans that have arrived; none if nothing arrives within 0.1 s.

        Raises
        ------
        DeviceLost
            If the port is not available, or the device has restarted.
        """
        if self._port is None:
            raise DeviceLost(self._path, "is not open")
        before = self._decoder.bad_bytes
        found = self._decode(self._port.read())
        return replace(found, bad_bytes=found.bad_bytes + self._decoder.bad_bytes - before, age=self._port.age)

    def close(self) -> None:
        """Stop the device if it still receives, and free the port."""
        port, self._port = self._port, None
        if port is not None:
            try:
                self._stop(port)
            except PORT_ERRORS:
                pass  # the device is no longer there
            finally:
                port.close()

    @abstractmethod
    def _connect(self) -> P:
        """Open the port of the device."""

    @abstractmethod
    def _start(self, port: P) -> DeviceIdentity:
        """Identify and configure the device, start sampling; return the identity."""

    @abstractmethod
    def _decode(self, data: bytes) -> Scans:
        """Return the scans in received bytes; `bad_bytes` only of frames that the decoder accepts."""

    def _stop(self, port: P) -> None:
        """Stop sampling."""
