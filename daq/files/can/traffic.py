"""Import of CAN traffic recorded by other programs, for sensors described by a DBC file.

python-can reads the files (candump's .log, Vector's .asc and .blf, PCAN's .trc). Frames are processed as live ones: the
same decoder, the same blocks, gaps by the counter; the time stamps of the file are the arrival times.
"""

import logging
import struct
import zlib
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq.drivers.base import DbcSensor, Scans
from daq.drivers.block_builder import BlockBuilder
from daq.drivers.can.bus import frames_of
from daq.drivers.can.dbc_file import read_layout
from daq.errors import DataError
from daq.events import ScansMissing
from daq.log.channel_map import CHANNELS, ChannelMap
from daq.log.mcap_log import McapWriter
from daq.protocol.can_library import can
from daq.protocol.can_scan import ScanDecoder, what_is_missing
from daq.protocol.frames import NO_FRAMES, NUMBER, CanFrames, concatenate
from daq.types import Block, Channel, IndexArray, Item

_HEADER = struct.Struct("<4sHHLL")  # signature, header size, header version, object size, object type
_CONTAINER = struct.Struct("<H6xL4x")  # method of compression, size uncompressed
_LOG_CONTAINER, _PLAIN, _DEFLATED = 10, 0, 2
_MAX_CONTAINER = 16 << 20  # bytes uncompressed: writers make 128 kB
_MAX_OBJECT = 64 << 20
_PADDING = 8  # bytes in which the next object begins


class BoundedBlfReader(can.BLFReader):
    """Reader of a BLF file that refuses containers which are larger than any writer makes.

    python-can's reader inflates a container to whatever size it has, and does not end where an object states a length
    of 0.
    """

    def __iter__(self) -> Generator[can.Message, None, None]:
        """Yield the messages."""
        while head := self.file.read(_HEADER.size):
            signature, _, _, size, kind = _HEADER.unpack(head)
            if signature != b"LOBJ" or not _HEADER.size <= size <= _MAX_OBJECT:
                raise can.io.blf.BLFParseError(f"object of {size} bytes")
            body = self.file.read(size - _HEADER.size)
            self.file.read(size % 4)
            if kind == _LOG_CONTAINER:
                data = _contents(body)
                _check_objects(self._tail + data)
                yield from self._parse_container(data)
        self.stop()


def _contents(body: bytes) -> bytes:
    method, _ = _CONTAINER.unpack_from(body)
    if method == _PLAIN:
        return body[_CONTAINER.size :]
    if method != _DEFLATED:
        raise can.io.blf.BLFParseError(f"unknown method of compression {method}")
    data = zlib.decompressobj().decompress(body[_CONTAINER.size :], _MAX_CONTAINER + 1)
    if len(data) > _MAX_CONTAINER:
        raise can.io.blf.BLFParseError(f"container: expected up to {_MAX_CONTAINER} bytes uncompressed, found more")
    return data


def _check_objects(data: bytes) -> None:
    """Refuse objects that are shorter than their own header: the next one would be the same for ever."""
    at = data.find(b"LOBJ", 0, _PADDING)
    while at >= 0 and at + _HEADER.size <= len(data):
        size = _HEADER.unpack_from(data, at)[3]
        if size < _HEADER.size:
            raise can.io.blf.BLFParseError(f"object of {size} bytes")
        at = data.find(b"LOBJ", at + size, at + size + _PADDING)


_READERS: dict[str, tuple[Callable[..., Iterable[can.Message]], str]] = {
    ".asc": (can.ASCReader, "r"),
    ".blf": (BoundedBlfReader, "rb"),
    ".log": (can.CanutilsLogReader, "r"),
    ".trc": (can.TRCReader, "r"),
}
CAN_LOGS = tuple(_READERS)  #: names of files of CAN traffic end so
_PIECE_SECONDS, _PIECE_FRAMES = 0.1, 4096  # that are decoded at a time
_BLOCK_SECONDS = 0.25
_BACK_SECONDS = 1.0  # that time stamps may go back: of two buses in one file, not of a clock
_MAX_BYTES = {False: 8, True: 64}  # of a frame of CAN, of CAN FD
_MAX_SECONDS = 4.6e9  # of a time stamp since 1970
_RATE_TOLERANCE = 0.05
_TRC_LOGGER = logging.getLogger("can.io.trc")
_MAX_MESSAGE = 200  # characters
_DAMAGED = (
    ValueError,
    KeyError,
    IndexError,
    EOFError,
    OverflowError,
    struct.error,
    zlib.error,
    can.CanError,
    can.io.blf.BLFParseError,
)


@dataclass(frozen=True, kw_only=True)
class LoggedSensor:
    """A sensor that was on a recorded bus."""

    device: str  #: its name
    rate: float  #: scans per second [Hz]
    sensor: DbcSensor


@dataclass(frozen=True, kw_only=True)
class ImportedSensor:
    """Scans of a sensor that were found."""

    device: str
    scans: int
    missing: int  #: scans between the first and the last
    seconds: float  #: time from the first to the last scan


def import_can_log(
    path: Path,
    out: Path,
    sensors: Sequence[LoggedSensor],
    channels: tuple[Channel, ...],
    attachments: Mapping[str, str] | None = None,
    *,
    start: int | None = None,
) -> tuple[ImportedSensor, ...]:
    """Write the scans of sensors in a file of CAN traffic to a new log.

    Parameters
    ----------
    path : of the file, one of `CAN_LOGS`
    out : of the log
    sensors : to look for
    channels : axis of a sensor for each channel
    attachments : name -> text, in addition to the channel map
    start : time of the file's first frame [ns UTC]. Default: that of the file

    Raises
    ------
    DbcError
        If a DBC file cannot be used.
    DataError
        If the file cannot be read, its times decrease, it has no scan of a sensor, or the scans have another rate.
    LogError
        If the log exists or cannot be made.
    """
    streams = [_Stream(sensor) for sensor in sensors]
    known = ChannelMap(channels=channels, on_grid=False)
    writer = McapWriter(out, {CHANNELS: known.to_json(), **(attachments or {})})
    try:
        for frames, stamps in _pieces(path, start):
            for stream in streams:
                for item in stream.take(frames, stamps):
                    writer.write(item)
        for stream in streams:
            for item in stream.finish(path):
                writer.write(item)
    except BaseException:
        writer.abandon()
        out.unlink()
        raise
    writer.close()
    return tuple(stream.found() for stream in streams)


class _Stream:
    """One sensor's scans."""

    def __init__(self, sensor: LoggedSensor) -> None:
        self._sensor, self._layout = sensor, read_layout(sensor.sensor)
        self._decoder = ScanDecoder(self._layout)
        n = max(1, round(_BLOCK_SECONDS * sensor.rate))
        self._blocks = BlockBuilder(sensor.device, sensor.rate, self._layout.scale, self._layout.modulus, n)
        self._recent_frames = NO_FRAMES
        self._n = self._end = self._missing = 0
        self._times: list[int] = []  # of the first scan and the last [ns UTC]

    def take(self, frames: CanFrames, stamps: IndexArray) -> Iterator[Item]:
        """Take frames (n) and when each came (n,) [ns UTC]; yield full blocks, and gaps."""
        before, scans = self._decoder.bad_frames, self._decoder.feed(frames, stamps)
        if not self._times and not len(scans.counts):
            self._recent_frames = concatenate([self._recent_frames, frames])[-_PIECE_FRAMES:]
            return
        if len(scans.arrived):
            first, last = scans.arrived[[0, -1]].tolist()
            self._times = [self._times[0] if self._times else first, last]
        bad = 8 * (self._decoder.bad_frames - before)
        read = Scans(scans.counts, scans.counter, self._decoder.temperature, bad)
        for block in self._blocks.add(read, self._times[-1]):
            yield from self._counted(block)

    def finish(self, path: Path) -> Iterator[Item]:
        """Yield the remaining blocks, if there were any, and check the rate."""
        device, rate = self._sensor.device, self._sensor.rate
        if not self._times:
            raise DataError(path, f"has no scan of {device}: {what_is_missing(self._layout, self._recent_frames)}")
        for block in self._blocks.flush(self._times[-1]):
            yield from self._counted(block)
        found = self.found()
        steps = found.scans + found.missing - 1
        if abs(steps - rate * found.seconds) > max(2.0, _RATE_TOLERANCE * steps):
            raise DataError(
                path, f"{device}: expected {rate:g} scans per second, found {steps / max(found.seconds, 1e-9):.4g}"
            )

    def _counted(self, block: Block) -> Iterator[Item]:
        missing = block.first_index - self._end
        if missing > 0:
            gap = ScansMissing(device=block.device, first_index=self._end, missing=missing, exact=True)
            yield gap.event(block.arrival_time)
            self._missing += missing
        self._n, self._end = self._n + block.n_scans, block.end_index
        yield block

    def found(self) -> ImportedSensor:
        """Return a summary of the decoded scans."""
        seconds = 1e-9 * (self._times[-1] - self._times[0])
        return ImportedSensor(device=self._sensor.device, scans=self._n, missing=self._missing, seconds=seconds)


def _pieces(path: Path, start: int | None) -> Iterator[tuple[CanFrames, IndexArray]]:
    """Yield frames with the times at which they came [ns UTC], some of them at a time."""
    piece: list[can.Message] = []
    begun: float | None = None
    for message in _messages(path):
        begun = message.timestamp if begun is None else begun
        if piece and (message.timestamp - piece[0].timestamp > _PIECE_SECONDS or len(piece) == _PIECE_FRAMES):
            yield _piece(piece, begun, start)
            piece = []
        piece.append(message)
    if begun is not None:
        yield _piece(piece, begun, start)


def _piece(messages: list[can.Message], begun: float, start: int | None) -> tuple[CanFrames, IndexArray]:
    since = np.array([message.timestamp for message in messages]) - begun  # s; doubles keep a microsecond of 1970's
    origin = round(begun * 1e9) if start is None else start
    return frames_of(messages), np.rint(since * 1e9).astype(np.intp) + origin


def _messages(path: Path) -> Iterator[can.Message]:
    """Yield the data frames of a file."""
    if path.suffix.lower() not in _READERS:
        raise DataError(path, f"expected a file of CAN traffic, {', '.join(_READERS)}")
    make, mode = _READERS[path.suffix.lower()]
    number, last = 0, -np.inf
    try:
        with path.open(mode) as file, _strict(_TRC_LOGGER):  # python-can does not close files that it cannot read
            for number, message in enumerate(make(file), 1):
                if message.timestamp < last - _BACK_SECONDS:
                    why = f"frame {number}: its clock runs backwards, from {last:.6f} s to {message.timestamp:.6f} s"
                    raise DataError(path, why)
                if why := _impossible(message):
                    raise DataError(path, f"frame {number}: {why}")
                last = max(last, message.timestamp)
                if not (message.is_error_frame or message.is_fd):
                    yield message
    except OSError as error:
        raise DataError(path, f"cannot be read: {error.strerror}") from error
    except _DAMAGED as error:
        raise DataError(path, f"is no CAN log, or is damaged after frame {number}: {error}") from error


@contextmanager
def _strict(logger: logging.Logger) -> Iterator[None]:
    """Raise ValueError where a reader of python-can warns that it leaves out a line, which the others refuse."""

    def refuse(record: logging.LogRecord) -> bool:
        if record.levelno >= logging.WARNING:
            raise ValueError(record.getMessage()[:_MAX_MESSAGE])
        return True

    logger.addFilter(refuse)
    try:
        yield
    finally:
        logger.removeFilter(refuse)


def _impossible(message: can.Message) -> str:
    """Return the reason why a frame is invalid; empty if it is valid."""
    size = message.dlc if message.dlc < 0 else max(len(message.data), message.dlc)
    if not 0 <= message.timestamp < _MAX_SECONDS or not 0 <= size <= _MAX_BYTES[message.is_fd]:
        return f"{size} bytes at {message.timestamp:g} s are none of CAN"
    if not 0 <= message.arbitration_id <= NUMBER:
        return f"expected an identifier of at most 29 bits, found {message.arbitration_id.bit_length()}"
    return ""
