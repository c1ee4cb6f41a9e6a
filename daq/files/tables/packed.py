"""Text of a table, plain or compressed (.gz, .zip), of bounded size."""

import codecs
import gzip
import io
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING

from daq.errors import DataError
from daq.files.archive_size import check_unpacked
from daq.log.format.progress import report_progress

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_DAMAGED = (zlib.error, EOFError, zipfile.BadZipFile, UnicodeError)
_ENDINGS = (".gz", ".zip")
_ENCRYPTED = 0x1  # flag of a file in an archive


class _WatchedFile(io.FileIO):
    """File that reports the progress of its reader."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "rb")
        self._path, self._read, self._size = path, 0, path.stat().st_size

    def readinto(self, buffer: "WriteableBuffer", /) -> int:
        n_bytes = super().readinto(buffer) or 0
        self._read += n_bytes
        report_progress(self._path, self._read, self._size)
        return n_bytes


class _Bounded(io.RawIOBase):
    """Unpacked bytes, which end in an error once they are far more than the file's."""

    def __init__(self, path: Path, content: IO[bytes]) -> None:
        self._path, self._content, self._size = path, content, 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: "WriteableBuffer", /) -> int:
        view = memoryview(buffer).cast("B")
        piece = self._content.read(len(view))
        self._size += len(piece)
        check_unpacked(self._path, "table", self._size)
        view[: len(piece)] = piece
        return len(piece)


def _buffered(raw: io.RawIOBase) -> "io.BufferedReader[io.RawIOBase]":
    return io.BufferedReader(raw)


@contextmanager
def table_text(path: Path) -> Iterator[IO[str]]:
    """Open a table of text: UTF-8 with bytes that are none as surrogates, or UTF-16 if it begins with its mark.

    Raises
    ------
    DataError
        Naming the file that cannot be read, is damaged, or is an archive of several files.
    """
    try:
        with ExitStack() as stack:
            content = stack.enter_context(_buffered(_WatchedFile(path)))
            if path.suffix.lower() in _ENDINGS:
                unpacked = _unpacked(path, content, stack)
                content = stack.enter_context(_buffered(_Bounded(path, unpacked)))
            encoding = "utf-16" if content.peek(2)[:2] in _UTF16 else "utf-8-sig"
            errors = "strict" if encoding == "utf-16" else "surrogateescape"
            yield stack.enter_context(io.TextIOWrapper(content, encoding=encoding, errors=errors, newline=""))
    except OSError as error:
        raise DataError(path, f"cannot be read: {error.strerror or error}") from error
    except _DAMAGED as error:
        raise DataError(path, f"is damaged: {error}") from error


def _unpacked(path: Path, content: IO[bytes], stack: ExitStack) -> IO[bytes]:
    """Return the unpacked content of the one table of a file."""
    if path.suffix.lower() == ".gz":
        return gzip.GzipFile(fileobj=content)  # type: ignore[return-value]  # has what is used of IO
    archive = stack.enter_context(zipfile.ZipFile(content))
    members = [member for member in archive.infolist() if not member.is_dir() and not member.filename.startswith("__")]
    if len(members) != 1:
        names = ", ".join(member.filename for member in members[:5])
        raise DataError(path, f"expected an archive of one table, found {len(members)} files: {names:.200}: unpack it")
    if members[0].flag_bits & _ENCRYPTED:
        raise DataError(path, f"is damaged: {members[0].filename:.200} is encrypted, password required")
    try:
        return stack.enter_context(archive.open(members[0]))
    except NotImplementedError as error:  # a compression, or a kind of encryption, that zipfile does not have
        raise DataError(path, f"is damaged: {error}") from error
