"""State of the history's SQLite file: identity and integrity."""

import sqlite3
import time
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import quote

_CHECK_SECONDS = 30.0  # between looks at the whole file, less than half of the minute within which damage is noticed
_CHECK_SHARE = 50.0  # times as long as a look takes, at least
_MAX_CHECK_SECONDS = 10.0  # of one look; one that takes longer is given up
_PROGRESS_STEPS = 100_000  # of SQLite's machine between looks at the clock
_PARTS = ("", "-wal", "-shm")  # of a database, behind its name
_DAMAGE = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
_UNREAD = "_unread"  # part of the name of files that were set aside


def is_damage(error: BaseException) -> bool:
    """Return whether SQLite, or a layer above it, reports a damaged file; not a locked or full one."""
    original = getattr(error, "orig", None) or error
    return (getattr(original, "sqlite_errorcode", None) or 0) & 0xFF in _DAMAGE


class SqliteFile:
    """A file as it was when it was opened.

    Parameters
    ----------
    path : of the file, which was there a moment ago
    """

    def __init__(self, path: Path) -> None:
        self.path, self._identity = path, _identity(path)
        self._due = time.monotonic() + _CHECK_SECONDS

    def displacement(self) -> str | None:
        """Return how the path no longer leads to the file that was opened; None if it does."""
        now = _identity(self.path)
        if now is None:  # also if it was gone when its identity was to be read
            return "the file was moved or deleted"
        return None if now == self._identity else "the file was replaced by another one"

    @property
    def due(self) -> bool:
        """True if the whole file is to be checked again."""
        return time.monotonic() >= self._due

    def damage(self) -> str | None:
        """Check the whole file by a new connection; return the fault."""
        begun = time.monotonic()
        try:
            return _quick_check(self.path, begun + _MAX_CHECK_SECONDS)
        finally:
            took = time.monotonic() - begun
            self._due = begun + max(_CHECK_SECONDS, _CHECK_SHARE * took)


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def _quick_check(path: Path, until: float) -> str | None:
    try:
        connection = sqlite3.connect(f"file:{quote(str(path.absolute()))}?mode=ro", uri=True, timeout=0.2)
    except sqlite3.Error:
        return None  # the next write shows it
    try:
        connection.set_progress_handler(lambda: time.monotonic() > until, _PROGRESS_STEPS)
        found = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
    except sqlite3.DatabaseError as error:
        return f"the file is damaged: {error}" if is_damage(error) else None
    finally:
        connection.close()
    return None if found == "ok" else f"the file is damaged: {' '.join(str(found).split())[:200]}"


def set_aside(path: Path) -> Path:
    """Rename a damaged database, with its journal, to a name that marks it as not read yet.

    Raises
    ------
    OSError
        If it cannot be renamed.
    """
    aside = unread_name(path)
    for part in _PARTS:
        part_path = Path(f"{path}{part}")
        if part_path.exists():
            part_path.rename(f"{aside}{part}")
    return aside


def unread_name(path: Path) -> Path:
    """Return a new name for a former database that has not been read yet."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S%f")
    return path.with_name(f"{path.stem}_before_{stamp}{_UNREAD}.sqlite")


def copy_open_file(connection: sqlite3.Connection, path: Path) -> bool:
    """Copy a database that is open although its path does not lead to it any more; return whether that succeeded."""
    try:
        target = sqlite3.connect(path)
        try:
            connection.backup(target)
        finally:
            target.close()
    except (sqlite3.Error, OSError):
        path.unlink(missing_ok=True)
        return False
    return True


def remove_leftovers(path: Path) -> None:
    """Remove the journal of a database that is gone: it belongs to no other one."""
    for part in _PARTS[1:]:
        Path(f"{path}{part}").unlink(missing_ok=True)


def unread(path: Path) -> list[Path]:
    """Return the set-aside files of a database that have not been read, the oldest first."""
    return sorted(path.parent.glob(f"{path.stem}_before_*{_UNREAD}.sqlite"))


def mark_read(aside: Path) -> Path:
    """Rename a set-aside file once it has been read; return its new name."""
    read = aside.with_name(aside.name.replace(_UNREAD, ""))
    for part in _PARTS:
        part_path = Path(f"{aside}{part}")
        if part_path.exists():
            part_path.rename(f"{read}{part}")
    return read
