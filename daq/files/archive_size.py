"""Sizes of compressed files before they are unpacked: a megabyte of zeros fits into a kilobyte."""

import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import numpy as np

from daq.errors import DataError

#: Exceptions of numpy, scipy and zipfile for damaged files, and for files of another format.
DAMAGED_FILE = (
    *(ValueError, TypeError, LookupError, AttributeError, EOFError, ArithmeticError, MemoryError, RuntimeError),
    *(SyntaxError, struct.error, zlib.error, zipfile.BadZipFile, tokenize.TokenError),
)
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


def inflated(file: IO[bytes], n: int, most: int) -> bytearray:
    """Return the unpacked content of the next `n` bytes of a file, read no further once it is over `most`.

    Raises
    ------
    zlib.error
        If they are damaged.
    """
    stream, content = zlib.decompressobj(), bytearray()
    while n > 0 and len(content) <= most and (piece := file.read(min(n, _PIECE))):
        n -= len(piece)
        while piece and len(content) <= most:
            content += stream.decompress(piece, _PIECE)
            piece = stream.unconsumed_tail
    return content


@contextmanager
def damage_named(path: Path, form: str, *errors: type[Exception]) -> Iterator[None]:
    """Turn exceptions of libraries for a damaged file, or one of another format, into an error that names the file.

    Parameters
    ----------
    path : of the file
    form : name of its format
    *errors : exceptions in addition to OSError and `DAMAGED_FILE`

    Raises
    ------
    DataError
        Naming the file.
    """
    caught: tuple[type[Exception], ...] = (OSError, *DAMAGED_FILE, *errors)
    try:
        yield
    except DataError:
        raise
    except caught as error:
        reason = f"{error}".strip().splitlines() or [type(error).__name__]
        raise DataError(path, f"is no {form} file, or damaged: {reason[0]}") from error


def check_archive(path: Path) -> None:
    """Refuse an npz file whose arrays are larger than its content, or far larger than the file.

    Raises
    ------
    DataError
        Naming the file and the array.
    ValueError, OSError, zipfile.BadZipFile
        If it is no archive of arrays, or damaged.
    """
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        check_unpacked(path, "arrays", sum(member.file_size for member in members))
        for member in (member for member in members if member.filename.endswith(".npy")):
            with archive.open(member) as file:
                _check_header(path, member.filename, file, member.file_size)


def check_array(path: Path) -> None:
    """Refuse an npy file whose array is larger than its content; errors as of `check_archive`."""
    with path.open("rb") as file:
        _check_header(path, "array", file, path.stat().st_size)


def _check_header(path: Path, what: str, file: IO[bytes], size: int) -> None:
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(file)
    held = size - file.tell()
    stated = math.prod(shape) * dtype.itemsize
    if stated > held:
        raise DataError(path, f"{what}: {shape} of {dtype} are {stated} bytes, found {held}")
