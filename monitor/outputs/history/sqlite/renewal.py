"""Replacement of a damaged, moved or deleted SQLite file, with all readable rows."""

import json
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from itertools import islice
from pathlib import Path
from urllib.parse import quote

from monitor.outputs.history import schema
from monitor.outputs.history.sqlite.file import mark_read, remove_leftovers, set_aside, unread, unread_name
from monitor.outputs.history.store import HistoryStore
from monitor.results.service_events import HistoryRenewed, HistoryRestored

_BATCH = 2000  # rows between two commits
_MAX_TRIES = 500  # at places of one table that cannot be read
_LAST_ROW = 2**62


def salvage(source: Path, target: Path) -> Iterator[int]:
    """Take over rows that the target does not have; yield how many after each batch, so that others may work between.

    A row that cannot be read, or makes no sense, is left out. Rows of a site keep their site by its name; those of an
    earlier version, without a site, belong to the first one of the target.
    """
    with _opened(source, "ro") as damaged, _opened(target, "rw") as whole:
        damaged.text_factory = lambda raw: raw.decode(errors="replace")
        sites = _Sites(damaged, whole)
        for table in schema.metadata.sorted_tables:
            if table in (schema.versions, schema.sites, schema.states):
                continue
            names = [column.name for column in table.columns]
            found = _readable(damaged, table.name, names if sites.known else names[1:])
            rows = (sites.moved(row) for row in found if _makes_sense(names[-len(row) :], row))
            marks, columns = ", ".join("?" * len(names)), ", ".join(f'"{name}"' for name in names)
            put = f'INSERT OR IGNORE INTO "{table.name}" ({columns}) VALUES ({marks})'
            while batch := list(islice(rows, _BATCH)):
                before = whole.total_changes
                with whole:
                    whole.executemany(put, batch)
                yield whole.total_changes - before


class _Sites:
    """Numbers of the sites of a damaged file in the target."""

    def __init__(self, damaged: sqlite3.Connection, whole: sqlite3.Connection) -> None:
        columns = [row[1] for row in damaged.execute(f'PRAGMA table_info("{schema.windows.name}")')]
        self.known = "site" in columns  #: whether the damaged file has sites
        own = list(whole.execute("SELECT id, name FROM sites ORDER BY id"))
        self._default, numbers = own[0][0], {name: number for number, name in own}
        self._moved: dict[object, int] = {}
        for number, name in _readable(damaged, "sites", ["id", "name"]) if self.known else ():
            if name not in numbers and name and "" not in numbers:
                with whole:
                    numbers[name] = whole.execute("INSERT INTO sites (name) VALUES (?)", (name,)).lastrowid
            self._moved[number] = numbers.get(name, self._default)

    def moved(self, row: tuple[object, ...]) -> tuple[object, ...]:
        """Return a row with the number of its site in the target."""
        return (self._moved.get(row[0], self._default), *row[1:]) if self.known else (self._default, *row)


def _opened(path: Path, mode: str) -> closing[sqlite3.Connection]:
    """Return a connection that is closed at the end of its context."""
    return closing(sqlite3.connect(f"file:{quote(str(path.absolute()))}?mode={mode}", uri=True, timeout=5.0))


def _readable(connection: sqlite3.Connection, table: str, names: list[str]) -> Iterator[tuple[object, ...]]:
    """Yield the rows of a table; after an unreadable place, continue with growing steps."""
    columns = ", ".join(f'"{name}"' for name in names)
    query = f'SELECT rowid, {columns} FROM "{table}" WHERE rowid > ? ORDER BY rowid'
    last, ahead, tries = 0, 1, 0
    while last < _LAST_ROW and tries < _MAX_TRIES:
        try:
            for row in connection.execute(query, (last,)):
                last, ahead = row[0], 1
                yield row[1:]
        except (sqlite3.Error, ValueError):
            last, ahead, tries = last + ahead, 2 * ahead, tries + 1
        else:
            return


def _makes_sense(names: list[str], row: tuple[object, ...]) -> bool:
    """Return whether JSON can be read, as required by pages and reports."""
    for name, value in zip(names, row, strict=True):
        if name == "json":
            try:
                json.loads(str(value))
            except (ValueError, RecursionError):
                return False
    return True


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
