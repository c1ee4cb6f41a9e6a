"""Replacement of a damaged, moved or deleted SQLite file, with all readable rows."""

import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path

from monitor.outputs.history.sqlite.file import mark_read, remove_leftovers, set_aside, unread, unread_name
from monitor.outputs.history.sqlite.salvage import salvage
from monitor.outputs.history.store import HistoryStore
from monitor.results.service_events import HistoryRenewed, HistoryRestored


def renew_file(path: Path, store: HistoryStore | None, why: str) -> HistoryRenewed:
    """Make room for a new file; the old database is closed.

    A damaged file is renamed. One that was moved, deleted or replaced is still open, and copied: to its place if that
    is free, else next to the new file.

    Parameters
    ----------
    path : of the file
    store : that had it open, if it could be opened at all
    why : the file cannot be used any more

    Raises
    ------
    OSError
        If it cannot be renamed.
    """
    if store is None or not store.displaced:
        if store:
            store.__exit__()
        return HistoryRenewed(why=why, set_aside=set_aside(path).name)
    copy = unread_name(path)
    copied = store.copy_to(copy)
    store.__exit__()  # before there is another file: it removes its journal by its name
    if path.exists():
        return HistoryRenewed(why=why, copied_to=copy.name if copied else None)
    remove_leftovers(path)
    if copied:
        copy.rename(path)
    return HistoryRenewed(why=why, restored=copied)


class Takeover:
    """Rows of files that were set aside, put into the present file some at a time.

    Parameters
    ----------
    path : of the present file; None for a database that is no file
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._failed: set[Path] = set()  # left to the next start
        self._source: Path | None = None
        self._rows: Iterator[int] = iter(())
        self._count = 0

    @property
    def pending(self) -> bool:
        """True if there are rows to take over."""
        return self._source is not None or bool(self._left())

    def _left(self) -> list[Path]:
        return [] if self._path is None else [path for path in unread(self._path) if path not in self._failed]

    def advance(self, seconds: float) -> HistoryRestored | None:
        """Copy rows for a while; return the report once a file has been read.

        The present file must be there.
        """
        if self._source is None and self._path:
            self._source, self._count = self._left()[0], 0
            self._rows = salvage(self._source, self._path)
        end, source = time.monotonic() + seconds, self._source
        try:
            while source and time.monotonic() < end:
                found = next(self._rows, None)
                if found is None:
                    self._source = None
                    return HistoryRestored(rows=self._count, of=mark_read(source).name)
                self._count += found
        except (sqlite3.Error, OSError) as error:
            self._source = None
            self._failed |= {source} if source else set()
            return HistoryRestored(rows=self._count, of=source.name if source else "", why=str(error))
        return None
