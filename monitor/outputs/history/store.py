"""Results and events put into the database: each once, however often they are brought."""

import json
import math
import sqlite3
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, cast

from pydantic import ValidationError
from sqlalchemy import Connection, ScalarSelect, Table, func, select, update
from sqlalchemy.dialects.postgresql import insert as postgres_insert
from sqlalchemy.dialects.sqlite import insert as sqlite_insert
from sqlalchemy.exc import DataError, IntegrityError, SQLAlchemyError

from daq import Event
from monitor.outputs.history import schema
from monitor.outputs.history.engines import HistoryError, OpenDatabase, error_message, file_of, open_engine, shown_url
from monitor.outputs.history.migrations import migrate
from monitor.outputs.history.retention import forget_events, forget_windows, thin_diagnoses
from monitor.outputs.history.roll_ups import roll_up
from monitor.outputs.history.sites import ONLY_SITE, SiteState, Writer, check_single_writer, register_site, write_state
from monitor.outputs.history.sqlite.file import SqliteFile, copy_open_file, is_damage
from monitor.results.windows import AlarmResult, ReferenceResult, Result, SelfTestResult, WindowResult, event_result
from monitor.text.causes import change_text

#: errors of one item, not of the database
_NEVER = (
    DataError,
    IntegrityError,
    ArithmeticError,
    AttributeError,
    LookupError,
    RecursionError,
    TypeError,
    ValueError,
)


class HistoryStore(OpenDatabase):
    """The database, opened for writing.

    Parameters
    ----------
    url : of the database, as SQLAlchemy spells it
    writer : site that the rows belong to

    Raises
    ------
    HistoryError
        If it cannot be opened, is of a later version, or another monitor writes the same site.
    """

    def __init__(self, url: str, writer: Writer = ONLY_SITE) -> None:
        self.url, self._writer = shown_url(url), writer
        self._engine = open_engine(url, keep_connections=False)
        try:
            if self._engine.url.database and self._engine.dialect.name == "sqlite":
                Path(self._engine.url.database).parent.mkdir(parents=True, exist_ok=True)
            with self._engine.begin() as connection:
                migrate(connection, self.url)
                self._site = register_site(connection, writer.site)
                check_single_writer(connection, self._site, writer, self.url)
            path = file_of(url)
            self._file = SqliteFile(path) if path else None
        except HistoryError:
            self._engine.dispose()
            raise
        except (SQLAlchemyError, OSError) as error:
            self._engine.dispose()
            raise self._error(error) from error

    def _error(self, error: Exception) -> HistoryError:
        return HistoryError(self.url, error_message(error, self._engine.url), unusable=is_damage(error))

    @property
    def displaced(self) -> bool:
        """True if the path of a SQLite file no longer leads to the one that is open."""
        return self._file is not None and self._file.displacement() is not None

    def check(self, *, whole: bool = False) -> bool:
        """Look at the file: whether it is the one that was opened, and now and then whether it is whole.

        Parameters
        ----------
        whole : whether to look at all of it now

        Returns
        -------
        bool
            Whether all of it was checked, and is intact.

        Raises
        ------
        HistoryError
            If it is not: moved, deleted, replaced or damaged.
        """
        if self._file is None:
            return False
        wrong = self._file.displacement()
        looked = wrong is None and (whole or self._file.due)
        if looked:
            wrong = self._file.damage()
        if wrong:
            raise HistoryError(self.url, wrong, unusable=True)
        return looked

    def copy_to(self, path: Path) -> bool:
        """Copy a SQLite database that is open although its path leads elsewhere; return whether that succeeded."""
        try:
            with closing(self._engine.raw_connection()) as connection:
                return copy_open_file(cast(sqlite3.Connection, connection.driver_connection), path)
        except (SQLAlchemyError, sqlite3.Error):
            return False

    def write(self, items: Sequence[Event]) -> int:
        """Put items in, all or none; return how many no database will ever take: these are left out.

        Raises
        ------
        HistoryError
            If the database is locked, damaged or gone.
        """
        try:
            with self._engine.begin() as connection:
                ends = [_write(connection, self._site, item) for item in items]
                roll_up(connection, self._site, [end for end in ends if end is not None])
        except _NEVER:  # one of them would keep out all that come after it, for good
            return 1 if len(items) == 1 else sum(self.write([item]) for item in items)
        except SQLAlchemyError as error:
            raise self._error(error) from error
        return 0

    def write_state(self, state: SiteState) -> None:
        """Replace the present state of the site.

        Raises
        ------
        HistoryError
            If the database is locked, damaged or gone, or another monitor writes the same site.
        """
        try:
            with self._engine.begin() as connection:
                check_single_writer(connection, self._site, self._writer, self.url)
                write_state(connection, self._site, self._writer, state)
        except SQLAlchemyError as error:
            raise self._error(error) from error

    def forget(self, keep: int, keep_days: float | None = None) -> None:
        """Delete the oldest events of kinds with more than `keep` entries, repeated diagnoses, and old windows.

        Events by their number, not their age: a plug that is loose for a week fills no disk, and a clock that is set
        ahead by years costs nothing. Windows and their modes stay for the newest `keep_days` days that have any; the
        figures by the day stay for good.

        Raises
        ------
        HistoryError
            If the database is locked, damaged or gone.
        """
        try:
            with self._engine.begin() as connection:
                forget_events(connection, self._site, keep)
                thin_diagnoses(connection, self._site)
                if keep_days is not None:
                    forget_windows(connection, self._site, round(keep_days))
        except SQLAlchemyError as error:
            raise self._error(error) from error


def _write(connection: Connection, site: int, item: Event) -> int | None:
    """Add one item; return the end of a window, whose hour and day are to be summed up."""
    result = _result(item)
    if result is None or isinstance(result, SelfTestResult):
        payload = item.payload
        if result is not None:  # the stored part of a self-test; the log has the rest
            payload = {name: getattr(result, name) for name in ("passed", "mass", "places", "detected")}
            payload["mass"] = round(result.mass, 4)
        row = {"time": item.time, "topic": item.topic[:64], "device": str(payload.get("device", ""))[:64]}
        _put(connection, site, schema.events, [row | {"json": json.dumps(payload)}])
    elif isinstance(result, ReferenceResult):
        row = {"time": result.time, "n_windows": result.n_windows, "json": result.model_dump_json()}
        _put(connection, site, schema.references, [row])
    elif isinstance(result, AlarmResult):
        _write_change(connection, site, result)
    else:
        return _write_window(connection, site, result)
    return None


def _result(item: Event) -> Result | None:
    try:
        return event_result(item)
    except ValidationError:
        return None  # left on disk by another version: kept as it is


def _write_window(connection: Connection, site: int, window: WindowResult) -> int:
    novelty = window.novelty
    row = {
        "end": window.end,
        "start": window.start,
        "number": window.index,
        "phase": window.phase,
        "n_modes": len(window.modes),
        "t2": _finite(novelty.t2) if novelty else None,
        "limit": _finite(novelty.limit) if novelty else None,
        "problem": window.problem,
    }
    _put(connection, site, schema.windows, [row])
    if window.phase != "learning":  # before, modes are counted and have no identity
        _put(connection, site, schema.modes, _mode_rows(window))
    if window.diagnosis:
        text = change_text(window.diagnosis)
        found = {"end": window.end, "verdict": window.diagnosis.verdict, "text": text}
        _put(connection, site, schema.diagnoses, [found | {"json": window.diagnosis.model_dump_json()}])
        if window.phase == "alarm":
            _update_standing(connection, site, window.end, text=text)
    return window.end


def _mode_rows(window: WindowResult) -> list[dict[str, Any]]:
    names = ("frequency", "frequency_std", "damping", "damping_std", "shift_percent", "shift_std_percent")
    return [
        {"mode": mode.id, "end": window.end} | {name: _finite(getattr(mode, name)) for name in names}
        for mode in window.modes
    ]


def _write_change(connection: Connection, site: int, change: AlarmResult) -> None:
    row = {"time": change.time, "kind": change.kind, "state": change.state, "number": change.window}
    _put(connection, site, schema.changes, [row | {"quiet": change.quiet, "text": change.text}])
    if change.raised:
        _put(connection, site, schema.alarms, [{"raised": change.time, "text": change.text, "reopened": 0}])
    elif change.kind == "reopened":
        _update_last(connection, site, change.time, cleared=None, lasted=None, reopened=_times_reopened(site))
    elif change.kind == "acknowledged":
        _update_last(connection, site, change.time, acknowledged=change.time)
    elif change.kind == "accepted":
        _update_last(connection, site, change.time, cleared=change.time, lasted=change.lasted, text=change.text)
    elif change.kind == "state" and change.lasted is not None:
        _update_last(connection, site, change.time, cleared=change.time, lasted=change.lasted)


def _times_reopened(site: int) -> ScalarSelect[int]:
    """Count the continuations of an alarm, from scratch each time: idempotent."""
    found = select(func.count()).where(schema.changes.c.site == site, schema.changes.c.kind == "reopened")
    return found.where(schema.changes.c.time >= schema.alarms.c.raised).scalar_subquery()


def _update_last(connection: Connection, site: int, time: int, **values: object) -> None:
    """Update the last alarm raised by then."""
    table = schema.alarms
    own = table.c.site == site
    last = select(table.c.raised).where(own, table.c.raised <= time).order_by(table.c.raised.desc()).limit(1)
    connection.execute(update(table).where(own, table.c.raised == last.scalar_subquery()).values(**values))


def _update_standing(connection: Connection, site: int, time: int, text: str) -> None:
    """Update the active alarm; a window that raises an alarm comes before it, and changes none."""
    table = schema.alarms
    standing = table.c.site == site, table.c.raised <= time, table.c.cleared.is_(None) | (table.c.cleared > time)
    connection.execute(update(table).where(*standing).values(text=text))


def _put(connection: Connection, site: int, table: Table, rows: Iterable[dict[str, Any]]) -> None:
    """Insert rows of a site; one that is there already stays as it is."""
    rows = [{"site": site} | row for row in rows]
    if not rows:
        return
    insert = sqlite_insert if connection.dialect.name == "sqlite" else postgres_insert
    connection.execute(insert(table).on_conflict_do_nothing(), rows)


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
