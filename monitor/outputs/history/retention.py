"""Deletion of old events and windows, and of repeated diagnoses: an alarm of years has one with every window."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence

from pydantic import ValidationError
from sqlalchemy import Connection, bindparam, delete, func, select

from monitor.outputs.history import schema
from monitor.results.comparison import DiagnosisAnswer
from updater import Cause

_BEYOND = 2.0  # standard deviations: a smaller difference is the same answer
# largest number of changed answers per day: one that alternates between two verdicts changes with every window
_MAX = 8
_AT_ONCE = 500  # rows in memory
_DAYS_AT_ONCE = 31  # days of windows that are deleted in one transaction


def forget_events(connection: Connection, site: int, keep: int) -> None:
    """Delete the oldest events of a site, of kinds with more than `keep` entries."""
    table = schema.events
    own, topic, time = table.c.site == site, table.c.topic, table.c.time
    many = select(topic).where(own).group_by(topic).having(func.count() > keep)
    for kind in list(connection.scalars(many)):
        newest = select(time).where(own, topic == kind).order_by(time.desc())
        first = newest.limit(1).offset(keep - 1).scalar_subquery()
        connection.execute(delete(table).where(own, topic == kind, time < first))


def forget_windows(connection: Connection, site: int, keep_days: int) -> None:
    """Delete the windows of a site, their modes and hours, before its newest days with windows; a month at a time.

    Days are counted, not time: a clock that is set ahead by years costs one day.
    """
    days, ends = schema.window_days, schema.windows.c.end
    last_day = select(days.c.day).where(days.c.site == site).order_by(days.c.day.desc()).limit(1).offset(keep_days - 1)
    first_kept = connection.scalar(last_day)
    oldest = connection.scalar(select(func.min(ends)).where(schema.windows.c.site == site))
    if first_kept is None or oldest is None:
        return
    until = min(first_kept * schema.DAY, oldest + _DAYS_AT_ONCE * schema.DAY)
    for table in (schema.windows, schema.modes):
        connection.execute(delete(table).where(table.c.site == site, table.c.end < until))
    hours = schema.mode_hours.c
    connection.execute(delete(schema.mode_hours).where(hours.site == site, hours.hour < until // schema.HOUR))


def thin_diagnoses(connection: Connection, site: int) -> None:
    """Delete the diagnoses of a site found by `told_before`."""
    table, alarms = schema.diagnoses, schema.alarms.c
    raised = sorted(connection.scalars(select(alarms.raised).where(alarms.site == site)))
    cleared = sorted(connection.scalars(select(alarms.cleared).where(alarms.site == site, alarms.cleared.is_not(None))))
    rows = connection.execute(
        select(table.c.end, table.c.json)
        .where(table.c.site == site)
        .order_by(table.c.end)
        .execution_options(yield_per=_AT_ONCE)
    )
    if gone := told_before(((end, json) for end, json in rows), raised, cleared):
        these = delete(table).where(table.c.site == site, table.c.end == bindparam("gone"))
        connection.execute(these, [{"gone": end} for end in gone])


def told_before(diagnoses: Iterable[tuple[int, str]], raised: Sequence[int], cleared: Sequence[int]) -> list[int]:
    """Return the ends of the diagnoses that need not be kept.

    The first and the newest of each alarm are kept, and up to eight per day that differ from the last one kept. Applied
    repeatedly, with later entries, the result is the same as applied once.

    Parameters
    ----------
    diagnoses : end of the window [ns UTC] and JSON, in the order of time
    raised, cleared : times of all alarms, ascending [ns UTC]
    """
    gone: list[int] = []
    known: DiagnosisAnswer | None = None  # the last one kept for its content
    of_alarm, day, n_of_day = -1, -1, 0
    newest: int | None = None  # of its alarm by now, and nothing else
    for end, json in diagnoses:
        found, alarm = _read(json), bisect_right(raised, end) + bisect_left(cleared, end)
        if newest is not None and alarm == of_alarm:
            gone.append(newest)
        if end // schema.DAY != day:
            day, n_of_day = end // schema.DAY, 0
        if alarm != of_alarm or (n_of_day < _MAX and not says_the_same(known, found)):
            known, of_alarm, newest = found, alarm, None
            n_of_day += 1
        else:
            newest = end
    return gone


def _read(json: str) -> DiagnosisAnswer | None:
    try:
        return DiagnosisAnswer.model_validate_json(json)
    except ValidationError:
        return None  # of another version


def says_the_same(before: DiagnosisAnswer | None, now: DiagnosisAnswer | None) -> bool:
    """Return whether two diagnoses name the same causes, places and sizes within their deviations."""
    if before is None or now is None or before.verdict != now.verdict or len(before.causes) != len(now.causes):
        return False
    pairs = zip(sorted(before.causes, key=_order), sorted(now.causes, key=_order), strict=True)
    return all(_same(one, other) for one, other in pairs)


def _order(cause: Cause) -> tuple[str, str, tuple[float, ...]]:
    """Sort causes by kind: the more probable of two may change with every window."""
    where = cause.where
    return cause.cause, str(where and (where.member, where.channels)), (where and where.position) or ()


def _same(one: Cause, other: Cause) -> bool:
    if one.cause != other.cause or set(one.cannot_be_told_from) != set(other.cannot_be_told_from):
        return False
    return _same_place(one, other) and _same_size(one, other)


def _same_place(one: Cause, other: Cause) -> bool:
    a, b = one.where, other.where
    if a is None or b is None:
        return a is b
    if (a.member, a.channels) != (b.member, b.channels) or (a.position is None) != (b.position is None):
        return False
    apart = math.dist(a.position, b.position) if a.position and b.position else 0.0
    return apart <= _BEYOND * max(a.position_std or 0.0, b.position_std or 0.0)


def _same_size(one: Cause, other: Cause) -> bool:
    if one.parameters.keys() != other.parameters.keys():
        return False
    pairs = ((value, other.parameters[name]) for name, value in one.parameters.items())
    return all(abs(a.value - b.value) <= _BEYOND * max(a.std, b.std) for a, b in pairs)
