"""Catalog of an archive: the logs in files, folders and object storage, each with a key of its content."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from daq import AnyLog
from daq.log import as_logs, files_of
from monitor.archive.object_storage import StoredFile, stored_logs
from monitor.errors import ArgumentError


@dataclass(frozen=True, kw_only=True)
class ArchiveLog:
    """Log of one run in an archive."""

    log: AnyLog  #: its files: paths, or objects in place of them
    size: int  #: of all files [bytes]
    key: str  #: hash of their content, or of the versions that object storage states

    @property
    def name(self) -> str:
        """Name for users: that of the first file."""
        return str(files_of(self.log)[0])


def find_logs(archives: Sequence[str]) -> list[ArchiveLog]:
    """Return the logs of files, folders (with all folders in them) and URLs, sorted by name.

    The files of one run are one log. Of copies the first is used.

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
    digest = hashlib.sha256()
    size = 0
    for path in files_of(log):
        if isinstance(path, StoredFile):
            digest.update(f"{path.url}\n{path.size}\n{path.version}\n".encode())
            size += path.size
            continue
        try:
            with path.open("rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
                size += file.tell()
        except OSError as error:
            raise ArgumentError("ARCHIVE", f"{path}: cannot be read: {error.strerror}") from error
    return ArchiveLog(log=log, size=size, key=digest.hexdigest()[:32])
