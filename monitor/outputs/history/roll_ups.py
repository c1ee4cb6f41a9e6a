"""Figures per hour and per day: a trend over two weeks or years has some thousand rows instead of a hundred thousand.

An hour and a day are summed again from their windows whenever one is added: exact, and idempotent. A day keeps its
figures once its windows have been deleted.
"""

from collections.abc import Iterable
from typing import Any

from sqlalchemy import ColumnElement, Connection, Float, Integer, Select, Table, case, cast, func, literal, select, true
from sqlalchemy.dialects.postgresql import insert as postgres_insert
from sqlalchemy.dialects.sqlite import insert as sqlite_insert

from monitor.outputs.history.schema import DAY, HOUR, mode_days, mode_hours, modes, window_days, windows


def roll_up(connection: Connection, site: int, ends: Iterable[int]) -> None:
    """Sum up the hours and days of some windows of a site, given by their ends [ns UTC].

    A day with deleted windows stays as it is.
    """
    hours, days = set(), set()
    for end in ends:
        hours.add(hour_of(end))
        days.add(end // DAY)
    for hour in sorted(hours):
        first, last = hour * HOUR + 1, (hour + 1) * HOUR
        of_hour = _modes_of(site, hour).where(modes.c.site == site, modes.c.end.between(first, last))
        _put(connection, mode_hours, of_hour)
    for day in sorted(days):
        _roll_up_day(connection, site, day)


def roll_up_days(connection: Connection) -> None:
    """Sum up every day of every site that has windows and no figures yet."""
    day = windows.c.end // DAY
    known = select(window_days.c.day).where(window_days.c.site == windows.c.site, window_days.c.day == day)
    found = select(windows.c.site, day).where(~known.correlate(windows).exists()).distinct()
    for site, number in list(connection.execute(found)):
        _roll_up_day(connection, site, number)


def roll_up_hours(connection: Connection) -> None:
    """Sum up every hour of every site."""
    hour = hour_of(modes.c.end)
    of_hours = select(modes.c.site, modes.c.mode, hour, *_figures()).where(true())  # SQLite: ON CONFLICT needs a WHERE
    _put(connection, mode_hours, of_hours.group_by(modes.c.site, modes.c.mode, hour))


def hour_of(end: Any) -> Any:  # noqa: ANN401 - an int or a column
    """Return the hour of a window, counted from 1970-01-01 UTC: one that ends with an hour is of this hour."""
    return (end - 1) // HOUR


def _roll_up_day(connection: Connection, site: int, day: int) -> None:
    first, after = day * DAY, (day + 1) * DAY
    now = select(func.count()).where(windows.c.site == site, windows.c.end >= first, windows.c.end < after)
    before = select(window_days.c.n).where(window_days.c.site == site, window_days.c.day == day)
    if (connection.scalar(now) or 0) < (connection.scalar(before) or 0):
        return
    in_day = _windows_of(site, day).where(windows.c.site == site, windows.c.end >= first, windows.c.end < after)
    _put(connection, window_days, in_day)
    of_day = _modes_of(site, day).where(modes.c.site == site, modes.c.end >= first, modes.c.end < after)
    _put(connection, mode_days, of_day)


def _put(connection: Connection, table: Table, rows: Select[*tuple[Any, ...]]) -> None:
    """Insert rows, or update them in place: deleting and inserting would leave a dead row for every window."""
    insert = sqlite_insert if connection.dialect.name == "sqlite" else postgres_insert
    query = insert(table).from_select([c.name for c in table.columns], rows)
    values = {c.name: query.excluded[c.name] for c in table.columns if not c.primary_key}
    connection.execute(query.on_conflict_do_update(index_elements=list(table.primary_key), set_=values))


def _modes_of(site: int, number: int) -> Select[*tuple[Any, ...]]:
    """Return the query for the figures of an hour or a day, by its number."""
    return select(literal(site), modes.c.mode, cast(number, Integer), *_figures()).group_by(modes.c.mode)


def _figures() -> tuple[ColumnElement[Any], ...]:
    frequency, damping, shift = modes.c.frequency, modes.c.damping, modes.c.shift_percent
    of_frequency = func.avg(frequency), func.min(frequency), func.max(frequency)
    return func.count(), *of_frequency, func.avg(damping), func.avg(shift)


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
