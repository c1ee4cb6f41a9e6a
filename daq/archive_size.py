"""Sizes of compressed files before they are unpacked: a megabyte of zeros fits into a kilobyte."""

import zlib
from pathlib import Path
from typing import IO

from daq.errors import DataError

_MAX_UNPACKED = 64_000_000  # bytes that every file may have
_MAX_RATIO = 50  # unpacked over packed of a larger one: measured signals have 1 to 10
_PIECE = 1 << 20


def max_unpacked(path: Path) -> int:
    """Return the largest unpacked size of a file's contents [bytes]."""
    return max(_MAX_UNPACKED, _MAX_RATIO * path.stat().st_size)


def check_unpacked(path: Path, what: str, unpacked: int) -> None:
    """Refuse contents that are far larger than their file.

    Raises
    ------
    DataError
        Naming the file and `what`.
    """
    most = max_unpacked(path)
    if unpacked > most:
        raise DataError(path, f"{what}: expected up to {most} bytes unpacked, found {unpacked} or more")


def inflated_size(file: IO[bytes], n: int, most: int) -> int:
    """Return the unpacked size of the next `n` bytes of a file, read no further once it is over `most`.

    Raises
    ------
    zlib.error
        If they are damaged.
    """
    stream, size = zlib.decompressobj(), 0
    while n > 0 and size <= most and (piece := file.read(min(n, _PIECE))):
        n -= len(piece)
        while piece and size <= most:
            size += len(stream.decompress(piece, _PIECE))
            piece = stream.unconsumed_tail
    return size
