"""Common part of drivers on serial lines."""

import errno
import sys
import time

import serial

from daq.drivers.serial.buffered_port import BufferedPort
from daq.errors import DeviceLost

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
        try:
            self._line = serial.Serial(path, baud, timeout=answer_seconds, write_timeout=1.0, exclusive=True)
        except serial.SerialException as error:
            if error.errno in (errno.EAGAIN, errno.EBUSY):  # locked, or opened exclusively
                raise serial.SerialException("the port is in use by another program") from error
            raise
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
