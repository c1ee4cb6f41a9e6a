"""Figures a day, so that a trend over years is a thousand rows instead of a hundred thousand.

A day is summed again from its windows whenever one is added: exact, and idempotent. A day keeps its figures once its
windows have been deleted.
"""

from typing import Any

from sqlalchemy import Connection, Float, Integer, Select, Table, case, cast, func, literal, select
from sqlalchemy.dialects.postgresql import insert as postgres_insert
from sqlalchemy.dialects.sqlite import insert as sqlite_insert

from monitor.outputs.history.schema import DAY, mode_days, modes, window_days, windows


def roll_up(connection: Connection, site: int, day: int) -> None:
    """Sum up one day of a site [days since 1970-01-01 UTC], unless some of its windows have been deleted."""
    first, after = day * DAY, (day + 1) * DAY
    now = select(func.count()).where(windows.c.site == site, windows.c.end >= first, windows.c.end < after)
    before = select(window_days.c.n).where(window_days.c.site == site, window_days.c.day == day)
    if (connection.scalar(now) or 0) < (connection.scalar(before) or 0):
        return
    in_day = _windows_of(site, day).where(windows.c.site == site, windows.c.end >= first, windows.c.end < after)
    _put(connection, window_days, in_day)
    of_day = _modes_of(site, day).where(modes.c.site == site, modes.c.end >= first, modes.c.end < after)
    _put(connection, mode_days, of_day)


def roll_up_missing(connection: Connection) -> None:
    """Sum up every day of every site that has windows and no figures yet."""
    day = windows.c.end // DAY
    known = select(window_days.c.day).where(window_days.c.site == windows.c.site, window_days.c.day == day)
    found = select(windows.c.site, day).where(~known.correlate(windows).exists()).distinct()
    for site, number in list(connection.execute(found)):
        roll_up(connection, site, number)


def _put(connection: Connection, table: Table, rows: Select[*tuple[Any, ...]]) -> None:
    """Insert rows, or update them in place: deleting and inserting would leave a dead row for every window."""
    insert = sqlite_insert if connection.dialect.name == "sqlite" else postgres_insert
    query = insert(table).from_select([c.name for c in table.columns], rows)
    values = {c.name: query.excluded[c.name] for c in table.columns if not c.primary_key}
    connection.execute(query.on_conflict_do_update(index_elements=list(table.primary_key), set_=values))


def _modes_of(site: int, day: int) -> Select[*tuple[Any, ...]]:
    return select(
        literal(site),
        modes.c.mode,
        cast(day, Integer),
        func.count(),
        func.avg(modes.c.frequency),
        func.min(modes.c.frequency),
        func.max(modes.c.frequency),
        func.avg(modes.c.damping),
        func.avg(modes.c.shift_percent),
    ).group_by(modes.c.mode)


def _windows_of(site: int, day: int) -> Select[*tuple[Any, ...]]:
    over = case((windows.c.t2 > windows.c.limit, 1), else_=0)
    return select(
        literal(site),
        cast(day, Integer),
        func.count(),
        func.count(windows.c.t2),
        func.sum(over),
        func.max(cast(windows.c.t2, Float) / windows.c.limit),
    ).having(func.count() > 0)
