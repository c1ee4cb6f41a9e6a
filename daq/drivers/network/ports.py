"""Ports on a network: a connection to a device, and datagrams from one."""

import errno
import select
import socket
import time
from collections.abc import Callable
from functools import partial
from urllib.parse import urlsplit

from daq.drivers.serial.buffered_port import BufferedPort
from daq.drivers.serial.port import READ_SECONDS
from daq.errors import DeviceLost

_CONNECT_SECONDS = 3.0
_GATHER_SECONDS = 0.1  # the kernel holds far more than these bytes
_MIN_RATE = 500.0  # bytes/s: slower devices are read as they send
_DATAGRAM = 65_536  # bytes, at most
_RECEIVE_BUFFER = 1 << 20  # bytes, for a host that is busy
_AT_ONCE = 200  # datagrams a read

NetworkPort = Callable[[], "TcpPort | UdpPort"]


def network_port(address: str) -> NetworkPort | None:
    """Return the function that opens `tcp://HOST:PORT` or `udp://[HOST]:PORT`, None for the path of a serial port.

    Raises
    ------
    ValueError
        If it is an address without a port, or of another kind.
    """
    if "://" not in address:
        return None
    try:
        parts = urlsplit(address)
        host, port = parts.hostname or "", parts.port
    except ValueError:
        host, port = "", None
    if port and parts.scheme == "tcp" and host:
        return partial(TcpPort, address, host, port)
    if port and parts.scheme == "udp":
        return partial(UdpPort, address, host, port)
    raise ValueError(f"port: expected tcp://HOST:PORT or udp://:PORT, found {address!r}")


class TcpPort:
    """A connection to a device that is a server.

    Parameters
    ----------
    address : for errors
    host, port : of the device

    Raises
    ------
    OSError
        If it does not accept.
    """

    def __init__(self, address: str, host: str, port: int) -> None:
        self._address = address
        self._socket = socket.create_connection((host, port), _CONNECT_SECONDS)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self._socket.setblocking(False)
        self._bites = BufferedPort(self._socket.fileno(), most_seconds=_GATHER_SECONDS, least_rate=_MIN_RATE)

    def read(self) -> bytes:
        """Return the received bytes; empty if nothing arrives within `READ_SECONDS`.

        Raises
        ------
        DeviceLost
            If the device has closed the connection.
        """
        try:
            return self._bites.read(READ_SECONDS)
        except OSError as error:
            raise DeviceLost(self._address, "the connection is closed") from error

    @property
    def age(self) -> int:
        """Time since the last read's bytes were here [ns]."""
        return time.perf_counter_ns() - self._bites.arrived

    def discard_input(self) -> None:
        """Keep all: a connection begins with its first byte."""

    def close(self) -> None:
        """End the connection."""
        self._socket.close()


class UdpPort:
    """Datagrams of one device: the first to send after the port was opened; those of others are dropped.

    Parameters
    ----------
    address : for errors
    host : address of this machine, empty for all
    port : to which the device sends

    Raises
    ------
    OSError
        If another program has the port.
    """

    def __init__(self, address: str, host: str, port: int) -> None:
        self._address = address
        self._socket = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            if error.errno == errno.EADDRINUSE:
                raise OSError("the port is in use by another program") from error
            raise
        self._socket.setblocking(False)
        self._sender: object = None
        self._arrived = time.perf_counter_ns()

    def read(self) -> bytes:
        """Return the received datagrams; empty if nothing arrives within `READ_SECONDS`."""
        return b"".join(self.datagrams())

    def datagrams(self) -> list[bytes]:
        """Return the received datagrams, each whole.

        Raises
        ------
        DeviceLost
            If the network is not available.
        """
        found: list[bytes] = []
        try:
            select.select([self._socket], [], [], READ_SECONDS)
            while len(found) < _AT_ONCE:
                content, sender = self._socket.recvfrom(_DATAGRAM)
                self._sender = self._sender or sender
                if sender == self._sender:
                    found.append(content)
                    self._arrived = time.perf_counter_ns()
        except BlockingIOError:
            pass
        except OSError as error:
            raise DeviceLost(self._address, f"the port is not available: {error}") from error
        return found

    @property
    def age(self) -> int:
        """Time since the last read's bytes were here [ns]."""
        return time.perf_counter_ns() - self._arrived

    def discard_input(self) -> None:
        """Keep all: nothing arrives before the port is open."""

    def close(self) -> None:
        """Free the port."""
        self._socket.close()
