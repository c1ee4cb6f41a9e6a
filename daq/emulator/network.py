"""Emulated devices on a network of this machine: an adapter of a serial device, and a Raspberry Shake."""

import math
import os
import socket
from collections.abc import Sequence
from contextlib import suppress
from typing import Literal

import numpy as np

from daq.emulator.serial_port import SerialEmulator
from daq.emulator.serving import PORT_BUFFER, SampleSource
from daq.protocol import raspberry_shake as shake
from daq.timing.host_clock import HostClock

_HOST = "127.0.0.1"
_DATAGRAM = 1400  # bytes, at most
_OTHERS = ("EHZ",)  # velocities, which a Raspberry Shake 4D sends too


def free_port() -> int:
    """Return a UDP port of this machine that no program has."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind((_HOST, 0))
        return int(found.getsockname()[1])


class FaultyNetwork:
    """Datagrams to a port of this machine, of which some are lost, repeated or exchanged.

    Parameters
    ----------
    port : of the host
    lost, repeated, exchanged : share of the datagrams
    seed : of the faults
    """

    def __init__(
        self, port: int, *, lost: float = 0.0, repeated: float = 0.0, exchanged: float = 0.0, seed: int = 0
    ) -> None:
        self.port = port  #: of the host
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._limits = np.cumsum([lost, repeated, exchanged])
        self._random = np.random.default_rng(seed)
        self._held: bytes | None = None
        self.lost = 0  #: datagrams, so far

    def send(self, datagrams: Sequence[bytes]) -> None:
        """Send datagrams; those without a receiver are lost."""
        for datagram in datagrams:
            what = int(np.searchsorted(self._limits, self._random.random(), side="right"))
            self.lost += what == 0
            if what == 2 and self._held is None:
                self._held = datagram
                continue
            for part in [datagram] * (0, 2, 1, 1)[what] + ([] if self._held is None else [self._held]):
                self._put(part)
            self._held = None

    def _put(self, datagram: bytes) -> None:
        try:
            self._socket.sendto(datagram, (_HOST, self.port))
        except OSError:
            self.lost += 1  # no port, or no room

    def close(self) -> None:
        """Free the socket."""
        self._socket.close()


class EmulatedAdapter:
    """An adapter between a serial device and a network: a server of one connection, or a sender of datagrams.

    Parameters
    ----------
    device : on its serial side; it must end its lines by line feeds
    kind : of the network side
    network : of datagrams, with its faults. Default: a free port without faults
    """

    def __init__(
        self, device: SerialEmulator, kind: Literal["tcp", "udp"], network: FaultyNetwork | None = None
    ) -> None:
        self.device = device  #: on the serial side
        self._line = os.open(device.port, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        self._server: socket.socket | None = None
        self._client: socket.socket | None = None
        self._network, self._pending, self._unplugged = network, bytearray(), False
        if kind == "tcp":
            self._server = socket.create_server((_HOST, 0))
            self._server.setblocking(False)
            number = int(self._server.getsockname()[1])
        elif network is None:
            number = free_port()
            self._network = FaultyNetwork(number)
        else:
            number = network.port
        self.port = f"{kind}://{_HOST}:{number}"  #: address for the host

    @property
    def sent(self) -> int:
        """Scans that the device has sent."""
        return self.device.sent

    @property
    def dropped(self) -> int:
        """Scans that the device has dropped."""
        return self.device.dropped

    @property
    def unread(self) -> int:
        """Number of bytes that the device or the adapter has not sent yet."""
        return self.device.unread + len(self._pending)

    def serve(self) -> None:
        """Forward what the device sends, without blocking. No effect once unplugged."""
        if self._unplugged:
            return
        self.device.serve()
        if len(self._pending) < PORT_BUFFER:
            with suppress(BlockingIOError):
                self._pending += os.read(self._line, 65_536)
        if self._server is not None:
            self._serve_connection(self._server)
        elif self._network is not None:
            self._network.send(self._datagrams())

    def close(self) -> None:
        """Unplug: connections end. A second call has no effect."""
        if not self._unplugged:
            self._unplugged = True
            self.device.close()
            os.close(self._line)
            for part in (self._server, self._client, self._network):
                if part is not None:
                    part.close()

    def _serve_connection(self, server: socket.socket) -> None:
        self._forward()
        with suppress(BlockingIOError):
            client, _ = server.accept()
            client.setblocking(False)
            self._forward()  # the last connection may have ended before this one began
            if self._client is None:
                self._client = client
            else:
                client.close()  # one at a time
        if self._client is None:
            self._pending.clear()

    def _forward(self) -> None:
        """Send what is pending to the connection, if there is one; close it if its other end has."""
        if self._client is not None and not self._forwarded(self._client):
            self._client.close()
            self._client = None

    def _forwarded(self, client: socket.socket) -> bool:
        """Send what is pending, as far as there is room; return whether the connection is still open."""
        try:
            with suppress(BlockingIOError):
                if not client.recv(64):
                    return False
            with suppress(BlockingIOError):
                del self._pending[: client.send(self._pending)]
        except OSError:
            return False
        return True

    def _datagrams(self) -> list[bytes]:
        """Return whole lines, as many in each datagram as there is room for."""
        found = []
        while end := self._pending.rfind(b"\n", 0, _DATAGRAM) + 1:
            found.append(bytes(self._pending[:end]))
            del self._pending[:end]
        return found


class EmulatedShake:
    """A Raspberry Shake 4D that sends to a port of this machine from its start on.

    Parameters
    ----------
    source : measured signal, in counts of `daq.protocol.raspberry_shake.SCALE`
    clock : simulated clock, that of the device too
    network : with its faults. Default: a free port without faults
    clock_error : of the sampling against the time stamps, 1e-6 = 1 ppm fast
    """

    unread = 0  #: bytes not yet sent: it holds none

    def __init__(
        self,
        source: SampleSource,
        clock: HostClock,
        network: FaultyNetwork | None = None,
        *,
        clock_error: float = 0.0,
    ) -> None:
        self._network = network or FaultyNetwork(free_port())
        self.port = f"udp://{_HOST}:{self._network.port}"  #: address for the host
        self._source, self._clock = source, clock
        self._rate = shake.RATE * (1 + clock_error)
        self._began, self._due, self._unplugged = clock.now(), 0, False
        source.start(self._began, self._rate)
        self.sent = 0  #: scans sent
        self.dropped = 0  #: none: the network loses datagrams

    def serve(self) -> None:
        """Send the datagrams that are due. No effect once unplugged."""
        due = math.floor((self._clock.now() - self._began) * 1e-9 * self._rate) + 1
        while not self._unplugged and due - self._due >= shake.SAMPLES:
            counts = self._source.read(self._due, shake.SAMPLES)
            time = self._began * 1e-9 + self._due / self._rate
            velocities = [shake.encode_packet(name, time, counts[:, 0]) for name in _OTHERS]
            accelerations = [shake.encode_packet(name, time, counts[:, k]) for k, name in enumerate(shake.CHANNELS)]
            self._network.send([*velocities, *accelerations])
            self._due += shake.SAMPLES
            self.sent += shake.SAMPLES

    def close(self) -> None:
        """Unplug; once is enough."""
        if not self._unplugged:
            self._unplugged = True
            self._network.close()
