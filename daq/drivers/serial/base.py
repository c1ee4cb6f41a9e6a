"""Common part of the drivers of devices on serial ports and of those that send the same bytes over a network."""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import ClassVar, Generic, Protocol, TypeVar

from daq.drivers.base import Scans
from daq.drivers.serial.port import PORT_ERRORS
from daq.errors import DeviceLost, DriverError
from daq.types import DeviceIdentity


class Decoder(Protocol):
    """Decoder of a byte stream."""

    bad_bytes: int  #: bytes outside intact frames, so far


class BytePort(Protocol):
    """Open port from which bytes are read."""

    @property
    def age(self) -> int:
        """Time since the last read's bytes were here [ns]."""
        ...

    def read(self) -> bytes:
        """Return the received bytes; empty if nothing arrives within `READ_SECONDS`; DeviceLost if the port is gone."""
        ...

    def discard_input(self) -> None:
        """Discard received bytes."""
        ...

    def close(self) -> None:
        """Free the port."""
        ...


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
            raise DriverError(self._path, f"no {self.product} answers: {error}") from error

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
