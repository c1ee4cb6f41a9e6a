"""Catalog of an archive: the logs in files, folders and object storage, each with a key of its content."""

import hashlib
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from daq import AnyLog, LogError
from daq.log import PartedLog, as_logs, files_of
from monitor.errors import ArgumentError


@dataclass(frozen=True, kw_only=True)
class ArchiveLog:
    """Log of one run in an archive."""

    files: tuple[str, ...]  #: paths or URLs, in the order of writing
    size: int  #: of all files [bytes]
    key: str  #: hash of their content, or of the version that object storage states

    @property
    def name(self) -> str:
        """Name for users: that of the first file."""
        return self.files[0]

    @contextmanager
    def local(self) -> Iterator[AnyLog]:
        """Provide the log as local files; those of object storage are copied into a temporary folder.

        Raises
        ------
        LogError
            If a file cannot be copied.
        """
        if not any(_is_remote(file) for file in self.files):
            yield _as_log([Path(file) for file in self.files])
            return
        with tempfile.TemporaryDirectory(prefix="modalwatch-archive-") as folder:
            paths = []
            for number, file in enumerate(self.files):
                path = Path(folder) / f"{number:06d}_{Path(file).name}"
                _copy(file, path)
                paths.append(path)
            yield _as_log(paths)


def _as_log(paths: Sequence[Path]) -> AnyLog:
    return PartedLog(tuple(paths)) if len(paths) > 1 else paths[0]


def find_logs(archives: Sequence[str]) -> list[ArchiveLog]:
    """Return the logs of files, folders (with all folders in them) and URLs, sorted by name.

    Local files of one run are one log. Each object of object storage is a log of its own. Of copies the first is used.

    Raises
    ------
    ArgumentError
        If there is no log, or the storage cannot be read.
    """
    local: dict[Path, None] = {}
    found: list[ArchiveLog] = []
    for archive in archives:
        if _is_remote(archive):
            found += _objects(archive)
        else:
            path = Path(archive)
            local |= dict.fromkeys(sorted(path.rglob("*.mcap")) if path.is_dir() else [path])
    found += [_local(log) for log in as_logs(list(local))] if local else []
    if not found:
        raise ArgumentError("ARCHIVE", f"{', '.join(archives)}: holds no log (*.mcap)")
    by_content = {log.key: log for log in sorted(found, key=lambda log: log.name, reverse=True)}
    return sorted(by_content.values(), key=lambda log: log.name)


def _is_remote(name: str) -> bool:
    return "://" in name


def _local(log: AnyLog) -> ArchiveLog:
    files = files_of(log)
    digest = hashlib.sha256()
    size = 0
    for path in files:
        try:
            with path.open("rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
                size += file.tell()
        except OSError as error:
            raise ArgumentError("ARCHIVE", f"{path}: cannot be read: {error.strerror}") from error
    return ArchiveLog(files=tuple(str(path.resolve()) for path in files), size=size, key=digest.hexdigest()[:32])


def _objects(url: str) -> Iterator[ArchiveLog]:
    """Yield the objects of a URL, by the version that the storage states."""
    from fsspec.core import url_to_fs

    try:
        storage, root = url_to_fs(url)
        details = storage.find(root, detail=True)
    except Exception as error:  # each storage has errors of its own
        raise ArgumentError("ARCHIVE", f"{url}: cannot be listed: {type(error).__name__}: {error}") from error
    for path, entry in sorted(details.items()):
        if path.endswith(".mcap"):
            version = [str(entry.get(name)) for name in ("ETag", "etag", "md5Hash", "LastModified", "mtime", "created")]
            content = "\n".join([path, str(entry["size"]), *version])
            key = hashlib.sha256(content.encode()).hexdigest()[:32]
            yield ArchiveLog(files=(storage.unstrip_protocol(path),), size=int(entry["size"]), key=key)


def _copy(url: str, path: Path) -> None:
    from fsspec.core import url_to_fs

    try:
        storage, name = url_to_fs(url)
        with storage.open(name, "rb") as source, path.open("wb") as target:
            shutil.copyfileobj(source, target)
    except Exception as error:
        raise LogError(url, f"cannot be copied: {type(error).__name__}: {error}") from error
