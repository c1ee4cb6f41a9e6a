"""Catalog of an archive: the logs in files, folders and object storage, each with a key of its content."""

import errno
import hashlib
import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, cast

from daq import AnyLog
from daq.errors import reading
from daq.log import PartedLog, as_logs, files_of
from monitor.errors import ArgumentError

PIECE_BYTES = 512 << 20  #: size of files from which on a piece of a run takes no more
_FIRST, _LARGEST = 1 << 16, 8 << 20  # bytes of a range: each that follows on another has twice as many


@dataclass(frozen=True)
class StoredFile:
    """Object with a URL (`s3://`, `gs://` and what else fsspec knows), in place of a path to a log file.

    A range is requested only when it is read: the plan of a run requests the beginning and the end of a log, the
    identification of a short log each part once. A piece of a long log is requested twice, by the advance and by the
    identification, and its last files once more, by the identification of the next piece.
    """

    url: str
    size: int = field(compare=False)  #: [bytes]
    version: str = field(compare=False)  #: as the storage states it

    def __str__(self) -> str:
        """Return the URL."""
        return self.url

    @property
    def name(self) -> str:
        """Last part of the URL."""
        return self.url.rpartition("/")[2]

    def is_dir(self) -> bool:
        """Return False: it is an object."""
        return False

    def open(self, mode: str = "rb") -> IO[bytes]:
        """Return a file that reads in ranges; every error of the storage is an OSError."""
        assert mode == "rb"
        return cast("IO[bytes]", _Ranges(self))

    def as_path(self) -> Path:
        """Return it as the type of a path, of which it has what is needed."""
        return cast("Path", self)


class _Ranges(io.RawIOBase):
    """Contents of an object, requested as they are read."""

    def __init__(self, stored: StoredFile) -> None:
        self._url, self._size = stored.url, stored.size
        self._at, self._start, self._held, self._ahead = 0, 0, b"", _FIRST

    def read(self, size: int = -1, /) -> bytes:
        end = self._size if size < 0 else min(self._at + size, self._size)
        here = self._held[self._at - self._start : end - self._start] if self._start <= self._at else b""
        missing = self._at + len(here)
        if missing < end:
            follows = missing == self._start + len(self._held)
            self._ahead = min(2 * self._ahead, _LARGEST) if follows else _FIRST
            self._start, self._held = missing, self._range(missing, min(max(end, missing + self._ahead), self._size))
            here += self._held[: end - missing]
        self._at += len(here)
        return here

    def _range(self, start: int, end: int) -> bytes:
        from fsspec.core import url_to_fs

        try:
            storage, name = url_to_fs(self._url)
            return bytes(storage.cat_file(name, start=start, end=end))
        except Exception as error:  # each storage has errors of its own
            raise OSError(errno.EIO, f"{type(error).__name__}: {error}") from error

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        return self._at

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at


def stored_logs(url: str) -> list[StoredFile]:
    """Return the objects with the name of a log that a URL means, sorted by name.

    Raises
    ------
    ArgumentError
        If the storage cannot be read, or fsspec is not installed.
    """
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        raise ArgumentError("ARCHIVE", f"{url}: fsspec is not installed: pip install 'modalwatch[fleet]'") from error
    try:
        storage, root = url_to_fs(url)
        details = storage.find(root, detail=True)
    except Exception as error:  # each storage has errors of its own
        raise ArgumentError("ARCHIVE", f"{url}: cannot be listed: {type(error).__name__}: {error}") from error
    return [
        StoredFile(storage.unstrip_protocol(path), int(entry["size"]), _version(entry))
        for path, entry in sorted(details.items())
        if path.endswith(".mcap")
    ]


def _version(entry: dict[str, Any]) -> str:
    """Return what changes with the content: by one of these names, each storage states it."""
    names = ("ETag", "etag", "md5Hash", "LastModified", "mtime", "created")
    return " ".join(str(entry[name]) for name in names if entry.get(name))


@dataclass(frozen=True, kw_only=True)
class LogPiece:
    """Whole files of one run, one after the other, that are analysed as a unit."""

    log: AnyLog  #: its files: paths, or objects in place of them
    size: int  #: of all files [bytes]
    key: str  #: hash of their content, or of the versions that object storage states, and of all pieces before

    @property
    def name(self) -> str:
        """Name for users: that of the first file."""
        return str(self.files[0])

    @property
    def files(self) -> tuple[Path, ...]:
        """Its files, in the order of writing."""
        return files_of(self.log)

    @property
    def complete(self) -> bool:
        """Return whether files that the run gets later belong to another piece."""
        return self.size >= PIECE_BYTES


@dataclass(frozen=True)
class ArchiveLog:
    """Log of one run in an archive."""

    pieces: tuple[LogPiece, ...]  #: one or more, in the order of writing

    @property
    def name(self) -> str:
        """Name for users: that of the first file."""
        return self.pieces[0].name

    @property
    def files(self) -> tuple[Path, ...]:
        """All files, in the order of writing."""
        return tuple(path for piece in self.pieces for path in piece.files)

    @property
    def key(self) -> str:
        """Hash of the content of all files."""
        return self.pieces[-1].key

    @property
    def size(self) -> int:
        """Size of all files [bytes]."""
        return sum(piece.size for piece in self.pieces)


def find_logs(archives: Sequence[str]) -> list[ArchiveLog]:
    """Return the logs of files, folders (with all folders in them) and URLs, sorted by name.

    The files of one run are one log. Of copies the first is used. A log is divided from its beginning on: pieces stay
    as they are when the run continues, but for the last one.

    Raises
    ------
    ArgumentError
        If there is no log, or the storage cannot be read.
    """
    files: dict[Path, None] = {}
    for archive in archives:
        path = Path(archive)
        if "://" in archive:
            found = [stored.as_path() for stored in stored_logs(archive)]
        else:
            found = sorted(path.rglob("*.mcap")) if path.is_dir() else [path.resolve()]
        files |= dict.fromkeys(found)
    if not files:
        raise ArgumentError("ARCHIVE", f"{', '.join(archives)}: holds no log (*.mcap)")
    logs = sorted((_entry(log) for log in as_logs(list(files))), key=lambda log: log.name)
    return list({log.key: log for log in reversed(logs)}.values())[::-1]


def _entry(log: AnyLog) -> ArchiveLog:
    digests: set[bytes] = set()
    pieces: list[LogPiece] = []
    files: list[Path] = []
    digest, size = hashlib.sha256(), 0
    for path in files_of(log):
        content, n_bytes = _content(path)
        if content in digests:
            continue  # a copy
        if size >= PIECE_BYTES:
            pieces.append(_piece(files, size, digest.hexdigest()))
            digest, files, size = hashlib.sha256(pieces[-1].key.encode()), [], 0
        digests.add(content)
        digest.update(content)
        files.append(path)
        size += n_bytes
    return ArchiveLog((*pieces, _piece(files, size, digest.hexdigest())))


def _piece(files: Sequence[Path], size: int, digest: str) -> LogPiece:
    log = PartedLog(tuple(files)) if len(files) > 1 else files[0]
    return LogPiece(log=log, size=size, key=digest[:32])


def _content(path: Path) -> tuple[bytes, int]:
    """Return what identifies the content of a file, and its size [bytes]; a local file is read to its end."""
    if isinstance(path, StoredFile):
        return f"{path.url}\n{path.size}\n{path.version}\n".encode(), path.size
    with reading(path, ArgumentError.of_file("ARCHIVE")), path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").digest(), file.tell()
