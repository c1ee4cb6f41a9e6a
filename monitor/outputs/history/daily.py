"""Figures a day, so that a trend over years is a thousand rows instead of a hundred thousand.

A day is summed again from its windows whenever one is added: exact, and idempotent.
"""

from typing import Any

from sqlalchemy import Connection, Float, Integer, Select, case, cast, delete, func, insert, select

from monitor.outputs.history.schema import DAY, mode_days, modes, window_days, windows


def roll_up(connection: Connection, day: int) -> None:
    """Sum up one day [days since 1970-01-01 UTC]."""
    first, after = day * DAY, (day + 1) * DAY
    for table in (mode_days, window_days):
        connection.execute(delete(table).where(table.c.day == day))
    of_day = _modes_of(day).where(modes.c.end >= first, modes.c.end < after)
    connection.execute(insert(mode_days).from_select([c.name for c in mode_days.columns], of_day))
    in_day = _windows_of(day).where(windows.c.end >= first, windows.c.end < after)
    connection.execute(insert(window_days).from_select([c.name for c in window_days.columns], in_day))


def roll_up_all(connection: Connection) -> None:
    """Sum up every day there is."""
    for day in list(connection.scalars(select(windows.c.end // DAY).distinct())):
        roll_up(connection, day)


def _modes_of(day: int) -> Select[*tuple[Any, ...]]:
    return select(
        modes.c.mode,
        cast(day, Integer),
        func.count(),
        func.avg(modes.c.frequency),
        func.min(modes.c.frequency),
        func.max(modes.c.frequency),
        func.avg(modes.c.damping),
        func.avg(modes.c.shift_percent),
    ).group_by(modes.c.mode)


def _windows_of(day: int) -> Select[*tuple[Any, ...]]:
    over = case((windows.c.t2 > windows.c.limit, 1), else_=0)
    return select(
        cast(day, Integer),
        func.count(),
        func.count(windows.c.t2),
        func.sum(over),
        func.max(cast(windows.c.t2, Float) / windows.c.limit),
    ).having(func.count() > 0)
