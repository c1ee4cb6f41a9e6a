"""Chunks of a log opened with bounded memory: sizes stated in a file are checked before memory is allocated."""

import mmap
import os
import struct
import zlib
from collections.abc import Callable
from io import BytesIO
from typing import IO, TypeVar, cast

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from zstandard import ZstdDecompressor, ZstdError, frame_content_size

FRAME = 9  #: bytes of a record's opcode and length
CHUNK_HEAD = FRAME + 32  #: bytes of a chunk before its compression's name: times, size, checksum, length of the name
_ZSTD = b"\4\0\0\0zstd"  # name of the compression, with its length
_READ_AHEAD = 1 << 20
MAX_CHUNK = 32 << 20  #: bytes of an uncompressed chunk: the writers begin a new one after 1 MB
_HEAD = struct.Struct("<BQ")  # opcode and length of a record
_HEAD_AND_CHANNEL = struct.Struct("<BQH")  # of a message, which begins with its channel
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time

_MESSAGE_CODE = int(Opcode.MESSAGE)  # a comparison with an enumeration is slower

ChunkRecord = Channel | Message | Schema
R = TypeVar("R")


class WholeReads:
    """File whose reads return all requested bytes or fail, within the size of the file.

    The stock reader accepts incomplete records, and allocates memory by a damaged length.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._size = 0  # when it was last measured [bytes]

    def read(self, n: int) -> bytes:
        """Return `n` bytes."""
        if n > _READ_AHEAD and not self.holds(n):
            raise McapError(f"a length of {n} bytes is more than the file has")
        data = self._file.read(n)
        if len(data) < n:
            raise EndOfFile
        return data

    def seek(self, at: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place in the file; return it."""
        if not self.holds(abs(at)):
            raise McapError(f"a place of {at} bytes is outside the file")
        return self._file.seek(at, whence)

    def holds(self, n: int) -> bool:
        """Return whether the file has n bytes by now."""
        if n > self._size:
            here = self._file.tell()
            self._size = self._file.seek(0, os.SEEK_END)
            self._file.seek(here)
        return n <= self._size

    def tell(self) -> int:
        """Return the place in the file."""
        return self._file.tell()

    def seekable(self) -> bool:
        """Return whether `seek` works."""
        return self._file.seekable()


class ChunkReader:
    """Records of successive chunks; messages of channels that are not wanted are passed over by their headers.

    Parameters
    ----------
    wanted : decides for each channel, at its record
    """

    def __init__(self, wanted: Callable[[Channel], bool] = lambda _: True) -> None:
        self._wanted = wanted
        self._passed_over: set[int] = set()  # channels
        self._zstd = ZstdDecompressor()  # to build one takes as long as a chunk

    def channel(self, channel: Channel) -> None:
        """Take a channel that stands outside a chunk."""
        if not self._wanted(channel):
            self._passed_over.add(channel.id)
        else:
            self._passed_over.discard(channel.id)

    def records(self, chunk: Chunk) -> list[ChunkRecord]:
        """Return the records of a chunk, its checksum verified.

        Raises
        ------
        McapError, ZstdError, struct.error, ValueError
            If it is damaged, or larger than `MAX_CHUNK`.
        """
        data = self.uncompressed(chunk)
        if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
            raise McapError("chunk: its checksum does not match")
        at, end, passed_over, found = 0, len(data), self._passed_over, list[ChunkRecord]()
        last = end - _HEAD_AND_CHANNEL.size  # place behind which no message begins
        head = _HEAD_AND_CHANNEL.unpack_from
        while at < end:
            if at <= last:
                opcode, length, channel_id = head(data, at)
                if opcode == _MESSAGE_CODE and channel_id in passed_over:
                    same, step = data[at : at + _HEAD_AND_CHANNEL.size], FRAME + length
                    at += step
                    while data.startswith(same, at):  # others of this channel and length
                        at += step
                    continue
            else:
                (opcode, length), channel_id = _HEAD.unpack_from(data, at), -1
            begin = at + FRAME
            at = begin + length
            if at > end:
                break
            if opcode == _MESSAGE_CODE:
                found.append(_message(data, begin, at))
            elif opcode == Opcode.CHANNEL:
                channel = _parsed(Channel.read, data[begin:at])
                self.channel(channel)
                found.append(channel)
            elif opcode == Opcode.SCHEMA:
                found.append(_parsed(Schema.read, data[begin:at]))
        if at > end:
            raise McapError("a record is longer than its chunk")
        return found

    def uncompressed(self, chunk: Chunk) -> bytes:
        """Return the records of a chunk as bytes; errors as for `records`."""
        check_chunk_size(chunk.uncompressed_size)
        if not chunk.compression:
            return chunk.data
        if chunk.compression == "zstd":
            stated = frame_content_size(chunk.data)
            if stated not in (-1, chunk.uncompressed_size):
                raise ZstdError(f"expected {chunk.uncompressed_size} bytes, found a frame of {stated}")
            data = self._zstd.decompress(chunk.data, max_output_size=chunk.uncompressed_size)
        elif chunk.compression == "lz4":
            try:
                data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=chunk.uncompressed_size + 1)
            except (RuntimeError, EOFError) as error:
                raise McapError(f"chunk: {error}") from error
        else:
            raise McapError(f"chunk: expected compression by zstd or lz4, found {chunk.compression!r:.40}")
        if len(data) != chunk.uncompressed_size:
            raise McapError(f"chunk: expected {chunk.uncompressed_size} bytes, found {len(data)}")
        return data


def chunk_records(chunk: Chunk) -> list[ChunkRecord]:
    """Return all records of a chunk; errors as for `ChunkReader.records`."""
    return ChunkReader().records(chunk)


def _message(data: bytes, begin: int, end: int) -> Message:
    """Return the message whose content is at these places."""
    channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(data, begin)
    if begin + _MESSAGE.size > end:
        raise McapError("a message is shorter than its header")
    return Message(
        channel_id=channel,
        log_time=log_time,
        data=data[begin + _MESSAGE.size : end],
        publish_time=publish_time,
        sequence=sequence,
    )


def _parsed(parse: Callable[[ReadDataStream], R], content: bytes) -> R:
    """Return a record from its content, by its stock parser."""
    try:
        return parse(ReadDataStream(cast(IO[bytes], WholeReads(BytesIO(content)))))
    except EndOfFile as error:  # the end of the record must not be taken for the end of the file
        raise McapError("a record is longer than its length") from error


def next_chunk(data: mmap.mmap, start: int) -> int | None:
    """Return the place of the next compressed chunk behind `start`, found by the name of its compression."""
    before = CHUNK_HEAD - 4
    at = data.find(_ZSTD, start + before + 1)
    while at >= 0 and data[at - before] != Opcode.CHUNK:
        at = data.find(_ZSTD, at + 1)
    return at - before if at >= 0 else None


def check_chunk_size(size: int) -> None:
    """Refuse an uncompressed size that no writer of logs makes."""
    if size > MAX_CHUNK:
        raise McapError(f"chunk: uncompressed size: expected up to {MAX_CHUNK} bytes, found {size}")
