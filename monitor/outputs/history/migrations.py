"""From an older schema to the present one, by numbered steps that are never changed once released."""

from collections.abc import Callable

from sqlalchemy import Connection, func, insert, inspect, literal, select, table, text

from monitor.outputs.history import schema
from monitor.outputs.history.engines import HistoryError
from monitor.outputs.history.roll_ups import roll_up_days, roll_up_hours

_LOCK = 0x6D6F64616C  # key of PostgreSQL's advisory lock: one program migrates, the others wait for it

_DAYS = (
    "mode_days (mode INTEGER NOT NULL, day INTEGER NOT NULL, n INTEGER NOT NULL, frequency FLOAT NOT NULL, "
    "lowest FLOAT NOT NULL, highest FLOAT NOT NULL, damping FLOAT, shift_percent FLOAT, PRIMARY KEY (mode, day))",
    "window_days (day INTEGER NOT NULL, n INTEGER NOT NULL, n_judged INTEGER NOT NULL, n_over INTEGER NOT NULL, "
    "level FLOAT, PRIMARY KEY (day))",
)


def _days(connection: Connection) -> None:
    for columns in _DAYS:
        connection.execute(text(f"CREATE TABLE {columns}"))


def _sites(connection: Connection) -> None:
    """Give every row a site: those there are belong to one without a name, until its monitor names it."""
    later = schema.versions, schema.sites, schema.states, schema.mode_hours
    kept = [t for t in schema.metadata.sorted_tables if t not in later]
    connection.execute(text("DROP INDEX modes_by_time"))
    for new in kept:
        connection.execute(text(f"ALTER TABLE {new.name} RENAME TO old_{new.name}"))
    schema.metadata.create_all(connection, tables=[schema.sites, schema.states, *kept])
    old = {new: table(f"old_{new.name}", *(c._copy() for c in new.columns if c.name != "site")) for new in kept}
    if any(connection.scalar(select(func.count()).select_from(found)) for found in old.values()):
        connection.execute(schema.sites.insert().values(name=""))
        site = connection.scalar(select(schema.sites.c.id))
        for new, found in old.items():
            rows = select(literal(site), *found.columns)
            connection.execute(insert(new).from_select(["site", *(c.name for c in found.columns)], rows))
    for found in old.values():
        connection.execute(text(f"DROP TABLE {found.name}"))
    roll_up_days(connection)


def _hours(connection: Connection) -> None:
    schema.mode_hours.create(connection)
    roll_up_hours(connection)


def _index_of_hours(connection: Connection) -> None:
    if connection.dialect.name == "postgresql":
        schema.mode_hours_by_time.create(connection, checkfirst=True)  # the step before makes the present table


def _index_of_days(connection: Connection) -> None:
    if connection.dialect.name == "postgresql":
        schema.mode_days_by_time.create(connection, checkfirst=True)


# from version 1 to 2, and so on
STEPS: tuple[Callable[[Connection], None], ...] = (_days, _sites, _hours, _index_of_hours, _index_of_days)
NEWEST = 1 + len(STEPS)


def version_of(connection: Connection) -> int:
    """Return the version of a database; 0 of an empty one."""
    if not inspect(connection).has_table(schema.versions.name):
        return 0
    return max(connection.scalars(select(schema.versions.c.version)), default=0)


def migrate(connection: Connection, url: str) -> int:
    """Bring a database to the newest version within the caller's transaction; return the one it was of.

    Programs that open the database at the same time wait for the one that migrates it.

    Raises
    ------
    HistoryError
        If it is of a later version than this program supports.
    """
    before = version_of(connection)
    if before < NEWEST:
        sqlite = connection.dialect.name == "sqlite"
        connection.exec_driver_sql("BEGIN IMMEDIATE" if sqlite else f"SELECT pg_advisory_xact_lock({_LOCK})")
        before = version_of(connection)
    if before > NEWEST:
        raise HistoryError(url, f"is of schema version {before}, this program supports up to {NEWEST}: use a later one")
    if before == 0:
        schema.metadata.create_all(connection)
        connection.execute(schema.versions.insert().values(version=NEWEST))
        return before
    for version, step in enumerate(STEPS[before - 1 :], before + 1):
        step(connection)
        connection.execute(schema.versions.insert().values(version=version))
    return before
