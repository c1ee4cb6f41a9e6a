"""Ports on a network: a connection to a device, and datagrams from one."""

import errno
import select
import socket
import time
from dataclasses import dataclass
from urllib.parse import urlsplit

from daq.drivers.serial.base import READ_SECONDS
from daq.drivers.serial.buffered_port import BufferedPort
from daq.errors import DeviceLost

_CONNECT_SECONDS = 3.0
_GATHER_SECONDS = 0.1  # the kernel holds far more than these bytes
_MIN_RATE = 500.0  # bytes/s: slower devices are read as they send
_DATAGRAM = 65_536  # bytes, at most
_RECEIVE_BUFFER = 1 << 20  # bytes, for a host that is busy
_AT_ONCE = 200  # datagrams a read


@dataclass(frozen=True)
class NetworkAddress:
    """A parsed address."""

    text: str  #: as given
    kind: str  #: tcp or udp
    host: str  #: of the device, or of this machine for datagrams; empty for all of its addresses
    port: int

    def open(self) -> "TcpPort | UdpPort":
        """Open the port; OSError as its class."""
        return (TcpPort if self.kind == "tcp" else UdpPort)(self)


def network_address(address: str) -> NetworkAddress | None:
    """Return the parts of `tcp://HOST:PORT` or `udp://[HOST]:PORT`, None for the path of a serial port.

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
    if not port or not (parts.scheme == "udp" or (parts.scheme == "tcp" and host)):
        raise ValueError(f"port: expected tcp://HOST:PORT or udp://:PORT, found {address!r}")
    return NetworkAddress(address, parts.scheme, host, port)


class TcpPort:
    """A connection to a device that is a server.

    Parameters
    ----------
    address : of the device

    Raises
    ------
    OSError
        If it does not accept.
    """

    def __init__(self, address: NetworkAddress) -> None:
        self._address = address.text
        self._socket = socket.create_connection((address.host, address.port), _CONNECT_SECONDS)
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
    address : of this machine, to which the device sends

    Raises
    ------
    OSError
        If another program has the port.
    """

    def __init__(self, address: NetworkAddress) -> None:
        self._address = address.text
        self._socket = socket.socket(socket.AF_INET6 if ":" in address.host else socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
            self._socket.bind((address.host, address.port))
        except OSError as error:
            self._socket.close()
            if error.errno == errno.EADDRINUSE:
                raise OSError("the port is in use by another program") from error
            raise
        self._socket.setblocking(False)
        self._sender: object = None
        self._arrived = time.perf_counter_ns()

    def read(self) -> bytes:
        """Return the received datagrams, one after another; empty if nothing arrives within `READ_SECONDS`.

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
        except BlockingIOError:
            pass
        except OSError as error:
            raise DeviceLost(self._address, f"the port is not available: {error}") from error
        self._arrived = time.perf_counter_ns()
        return b"".join(found)

    @property
    def age(self) -> int:
        """Time since the last read's bytes were here [ns]."""
        return time.perf_counter_ns() - self._arrived

    def discard_input(self) -> None:
        """Keep all: nothing arrives before the port is open."""

    def close(self) -> None:
        """Free the port."""
        self._socket.close()
