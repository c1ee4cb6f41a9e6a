"""From an older schema to the present one, by numbered steps that are never changed once released."""

from collections.abc import Callable

from sqlalchemy import Connection, inspect, select

from monitor.outputs.history import schema
from monitor.outputs.history.daily import roll_up_all
from monitor.outputs.history.errors import HistoryError


def _windows_modes_alarms(connection: Connection) -> None:
    tables = (
        schema.versions,
        schema.windows,
        schema.modes,
        schema.diagnoses,
        schema.references,
        schema.alarms,
        schema.changes,
        schema.events,
    )
    schema.metadata.create_all(connection, tables=tables)


def _days(connection: Connection) -> None:
    schema.metadata.create_all(connection, tables=(schema.mode_days, schema.window_days))
    roll_up_all(connection)


STEPS: tuple[Callable[[Connection], None], ...] = (_windows_modes_alarms, _days)
NEWEST = len(STEPS)


def version_of(connection: Connection) -> int:
    """Return the version of a database; 0 of an empty one."""
    if not inspect(connection).has_table(schema.versions.name):
        return 0
    return max(connection.scalars(select(schema.versions.c.version)), default=0)


def migrate(connection: Connection, url: str) -> int:
    """Bring a database to the newest version within the caller's transaction; return the one it was of.

    Raises
    ------
    HistoryError
        If it is of a later version than this program supports.
    """
    before = version_of(connection)
    if before > NEWEST:
        raise HistoryError(url, f"is of schema version {before}, this program supports up to {NEWEST}: use a later one")
    for version, step in enumerate(STEPS[before:], before + 1):
        step(connection)
        connection.execute(schema.versions.insert().values(version=version))
    return before
