"""Opening of a serial line."""

import errno
import os

import serial


def open_line(path: str, baud: int, *, timeout: float | None = None) -> serial.Serial:
    """Open a serial line exclusively.

    Parameters
    ----------
    path : of the port
    baud : 8 data bits, no parity [bit/s]
    timeout : of a read [s]; None: none

    Raises
    ------
    OSError
        If it cannot be opened. Its text is the reason alone: messages name the port already.
    """
    try:
        return serial.Serial(path, baud, timeout=timeout, write_timeout=1.0, exclusive=True)
    except serial.SerialException as error:
        number = error.errno
        if number is None and error.__context__ is not None:  # termios.error has the number
            number = next((value for value in error.__context__.args if isinstance(value, int)), None)
        if number in (errno.EAGAIN, errno.EBUSY):  # locked, or opened exclusively
            raise serial.SerialException("the port is in use by another program") from error
        raise serial.SerialException(str(error) if number is None else os.strerror(number)) from error
