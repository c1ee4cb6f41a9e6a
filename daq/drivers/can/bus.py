"""A CAN bus behind an SLCAN adapter: read by the chunk, decoded by the block; and python-can's bus too.

python-can's own `slcan` reads one byte per system call and stops at the first damaged line. This bus reads all
available bytes at once and drops damaged lines individually. It is installed as `can.Bus(interface="modalwatch-slcan",
...)`.
"""

import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from daq.drivers.serial.buffered_port import BufferedPort
from daq.drivers.serial.line import open_line
from daq.errors import system_reason
from daq.protocol import slcan
from daq.protocol.can_library import can
from daq.protocol.frames import EXTENDED, NUMBER, REMOTE, CanFrames, can_frames

_GATHER_SECONDS = 0.03  # time that frames accumulate on a busy bus [s]; replies to requests may be delayed by it
_MIN_RATE = 20e3  # bytes/s of a busy bus, some 1000 frames/s
_MAX_MESSAGES = 1000  # taken of a bus at once


class SlcanBus(can.BusABC):
    """CAN bus behind an adapter on a serial port, opened exclusively.

    Parameters
    ----------
    channel : path of the serial port
    bitrate : of the CAN bus [bit/s]
    tty_baudrate : of the serial line; adapters on USB do not care [bit/s]
    **kwargs : as for `can.BusABC`

    Raises
    ------
    ValueError
        If adapters do not have this bit rate.
    can.CanInitializationError
        If the port cannot be opened.
    """

    def __init__(self, channel: str, bitrate: int = 1_000_000, tty_baudrate: int = 115_200, **kwargs: object) -> None:
        self._is_shutdown = True  # until there is something to shut down
        if bitrate not in slcan.BITRATES:
            raise ValueError(f"bitrate of {channel}: expected one of {list(slcan.BITRATES)}, found {bitrate}")
        try:
            self._port = open_line(channel, tty_baudrate, timeout=0)
            # the empty line ends whatever an earlier owner began
            self._port.write(b"\r" + slcan.CLOSE + slcan.NO_STAMPS + slcan.BITRATES[bitrate] + slcan.OPEN)
        except OSError as error:
            raise can.CanInitializationError(f"{channel}: {system_reason(error)}") from error
        self._decoder = slcan.SlcanDecoder()
        self._waiting: deque[can.Message] = deque()
        self._bites = BufferedPort(self._port.fileno(), most_seconds=_GATHER_SECONDS, least_rate=_MIN_RATE)
        self._is_shutdown = False
        self.channel_info = f"SLCAN adapter on {channel}"
        super().__init__(channel, **kwargs)  # type: ignore[arg-type]

    @property
    def bad_lines(self) -> int:
        """Lines that were damaged, so far."""
        return self._decoder.bad_lines

    def recv_frames(self, timeout: float | None = None) -> CanFrames:
        """Wait for frames and return all that are there; none after `timeout` [s], or if only parts came.

        Filters do not apply.

        Raises
        ------
        can.CanOperationError
            If the port is gone.
        """
        if self._waiting:
            messages = list(self._waiting)
            self._waiting.clear()
            return frames_of(messages)
        try:
            batch = timeout is None or timeout > _GATHER_SECONDS
            return self._decoder.feed(self._bites.read(timeout, batch=batch))
        except OSError as error:
            raise can.CanOperationError(f"{self._port.name}: {system_reason(error)}") from error

    @property
    def arrived(self) -> int:
        """Arrival of the bytes of the last read, by time.perf_counter_ns."""
        return self._bites.arrived

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._waiting:
            self._waiting.extend(messages_of(self.recv_frames(timeout), time.time()))
        return (self._waiting.popleft() if self._waiting else None), False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a classic frame; a line that takes nothing for a second (`timeout` is not used) is an error.

        Raises
        ------
        can.CanOperationError
            If the port is gone or full, or the frame is one of CAN FD.
        """
        if msg.is_fd:
            raise can.CanOperationError("CAN FD frames cannot be sent over SLCAN")
        try:
            self._port.write(slcan.encode(frames_of([msg])))
        except OSError as error:
            raise can.CanOperationError(f"{self._port.name}: {system_reason(error)}") from error

    def fileno(self) -> int:
        """Return the descriptor that becomes readable when frames may be there."""
        return int(self._port.fileno())

    def shutdown(self) -> None:
        """Close the adapter's channel if it still listens, and free the port."""
        if self._is_shutdown:
            return
        super().shutdown()
        with suppress(OSError):  # it is gone
            self._port.write(slcan.CLOSE)
        self._port.close()


def bus_reason(error: Exception) -> str:
    """Return the text of an error of a bus; if the system caused it, the reason alone, without port and number."""
    cause = error.__cause__
    return system_reason(cause if isinstance(cause, OSError) else error)


@dataclass(frozen=True, eq=False)
class Chunk:
    """Frames from one read of a bus."""

    frames: CanFrames
    arrived: int  #: when the last of them was here, by time.perf_counter_ns


def read_frames(bus: can.BusABC, timeout: float) -> Chunk:
    """Return the frames that a bus has, waiting for the first one; none after `timeout` [s].

    Raises
    ------
    can.CanError, OSError
        If the bus is gone.
    """
    if isinstance(bus, SlcanBus):
        frames = bus.recv_frames(timeout)
        return Chunk(frames, bus.arrived)
    messages: list[can.Message] = []
    message = bus.recv(timeout)
    while message is not None and len(messages) < _MAX_MESSAGES:
        messages.append(message)
        message = bus.recv(0)
    arrived = time.perf_counter_ns()
    return Chunk(frames_of(messages), arrived)


def frames_of(messages: Sequence[can.Message]) -> CanFrames:
    """Return python-can's messages as a block; error frames and CAN FD are left out."""
    kept = [m for m in messages if not (m.is_error_frame or m.is_fd)]
    frames = can_frames([(_id(message), bytes(message.data)) for message in kept])
    return replace(frames, dlc=np.array([message.dlc for message in kept], np.uint8))  # a remote frame has no data


def messages_of(frames: CanFrames, timestamp: float) -> list[can.Message]:
    """Return a block as python-can's messages, all of one arrival time [s since 1970]."""
    return [
        can.Message(
            timestamp=timestamp,
            arbitration_id=number & NUMBER,
            is_extended_id=bool(number & EXTENDED),
            is_remote_frame=bool(number & REMOTE),
            data=None if number & REMOTE else data,
            dlc=dlc,
        )
        for (number, data), dlc in zip(frames, frames.dlc.tolist(), strict=True)
    ]


def _id(message: can.Message) -> int:
    number = message.arbitration_id
    if message.is_extended_id:
        number |= EXTENDED
    return number | REMOTE if message.is_remote_frame else number
