"""Chunks of a log opened with bounded memory: sizes stated in a file are checked before memory is allocated."""

import mmap
import os
from dataclasses import replace
from typing import IO

import lz4.frame
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import breakup_chunk
from zstandard import ZstdDecompressor, ZstdError, frame_content_size

FRAME = 9  #: bytes of a record's opcode and length
CHUNK_HEAD = FRAME + 32  #: bytes of a chunk before its compression's name: times, size, checksum, length of the name
_ZSTD = b"\4\0\0\0zstd"  # name of the compression, with its length
_READ_AHEAD = 1 << 20
MAX_CHUNK = 32 << 20  #: bytes of an uncompressed chunk: the writers begin a new one after 1 MB


class WholeReads:
    """File whose reads return all requested bytes or fail, within the size of the file.

    The stock reader accepts incomplete records, and allocates memory by a damaged length.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._size = 0  # when it was last measured [bytes]

    def read(self, n: int) -> bytes:
        """Return `n` bytes."""
        if n > _READ_AHEAD and not self._holds(n):
            raise McapError(f"a length of {n} bytes is more than the file has")
        data = self._file.read(n)
        if len(data) < n:
            raise EndOfFile
        return data

    def seek(self, at: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place in the file; return it."""
        if not self._holds(abs(at)):
            raise McapError(f"a place of {at} bytes is outside the file")
        return self._file.seek(at, whence)

    def _holds(self, n: int) -> bool:
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


def chunk_records(chunk: Chunk) -> list[McapRecord]:
    """Return the records of a chunk, its checksum verified.

    Raises
    ------
    McapError, ZstdError, struct.error, ValueError
        If it is damaged, or larger than `MAX_CHUNK`.
    """
    plain = replace(chunk, data=_uncompressed(chunk), compression="")
    try:
        return breakup_chunk(plain, validate_crc=True)
    except (EndOfFile, OverflowError) as error:  # the chunk's end must not be taken for the file's
        raise McapError("a record is longer than its chunk") from error


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


def _uncompressed(chunk: Chunk) -> bytes:
    check_chunk_size(chunk.uncompressed_size)
    if not chunk.compression:
        return chunk.data
    if chunk.compression == "zstd":
        stated = frame_content_size(chunk.data)
        if stated not in (-1, chunk.uncompressed_size):
            raise ZstdError(f"expected {chunk.uncompressed_size} bytes, found a frame of {stated}")
        data = ZstdDecompressor().decompress(chunk.data, max_output_size=chunk.uncompressed_size)
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
