"""Questions to the history, each answered through an index."""

import json
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

from sqlalchemy import BigInteger, Column, Result, Row, Select, Table, cast, func, literal, select, true
from sqlalchemy.exc import SQLAlchemyError

from monitor.outputs.history import schema
from monitor.outputs.history.engines import HistoryError, OpenDatabase, error_message, reading_engines, shown_url
from monitor.outputs.history.migrations import migrate
from monitor.outputs.history.roll_ups import hour_of
from monitor.outputs.history.sites import NO_SITE, find_site

T = TypeVar("T")
Every = Literal["window", "hour", "day"]
_NO_WRITING = "readonly database", "unable to open"  # messages of SQLite without write permission
_PART = 256  # rows that are converted at a time
_WINDOW_DAYS, _HOUR_DAYS = 2, 14  # longest spans with a trend per window, and per hour


@dataclass(frozen=True, kw_only=True)
class Span:
    """From when to when, ends included."""

    start: int  #: [ns UTC]
    end: int  #: [ns UTC]

    @property
    def every(self) -> Every:
        """Resolution of trends over it: at most some thousand points."""
        days = (self.end - self.start) / schema.DAY
        return "window" if days <= _WINDOW_DAYS else "hour" if days <= _HOUR_DAYS else "day"

    @property
    def days(self) -> tuple[int, int]:
        """First and last day, counted from 1970-01-01 UTC."""
        return self.start // schema.DAY, self.end // schema.DAY


@dataclass(frozen=True, kw_only=True)
class WindowRow:
    """One analysed window."""

    end: int  #: [ns UTC]
    start: int  #: [ns UTC]
    number: int
    phase: str
    n_modes: int
    t2: float | None
    limit: float | None
    problem: str | None


@dataclass(frozen=True, kw_only=True)
class DayRow:
    """All windows of a day."""

    day: int  #: days since 1970-01-01 UTC
    n: int
    n_judged: int
    n_over: int
    level: float | None  #: highest novelty over its limit [-]


@dataclass(frozen=True, kw_only=True)
class TrendPoint:
    """A mode in a window, or over an hour or a day."""

    mode: int
    time: int  #: end of the window, middle of the hour, noon of the day [ns UTC]
    n: int  #: windows that show it
    frequency: float  #: mean [Hz]
    lowest: float  #: [Hz]
    highest: float  #: [Hz]
    damping: float | None  #: [-]
    shift_percent: float | None  #: against the baseline
    frequency_std: float | None = None  #: of a window [Hz]; None over an hour or a day
    damping_std: float | None = None  #: of a window [-]
    shift_std_percent: float | None = None  #: of a window


@dataclass(frozen=True, kw_only=True)
class AlarmRow:
    """An alarm from its beginning to its end."""

    raised: int  #: [ns UTC]
    cleared: int | None  #: [ns UTC]; None while it is active
    lasted: float | None  #: [s]
    acknowledged: int | None  #: [ns UTC]
    text: str  #: present text of the alarm
    reopened: int  #: number of continuations after a short end


@dataclass(frozen=True, kw_only=True)
class EventRow:
    """Anything else that happened."""

    time: int  #: [ns UTC]
    topic: str
    device: str
    json: str


class Reader(OpenDatabase):
    """The history of one site, opened for questions.

    Parameters
    ----------
    url : of the database
    site : name; empty for the only one

    Raises
    ------
    HistoryError
        If there is none, it cannot be read, or it has several sites and none is named; so do all its methods.
    """

    def __init__(self, url: str, site: str = "") -> None:
        self.url = shown_url(url)
        refused: SQLAlchemyError | None = None
        for engine in reading_engines(url):
            file = engine.url.database
            if refused is None and engine.dialect.name == "sqlite" and file and not Path(file).exists():
                raise HistoryError(self.url, "there is no history yet: `run` and `reanalyse` write it")
            try:
                with engine.begin() as connection:
                    migrate(connection, self.url)
                    self._site = find_site(connection, site, self.url)
                # for all questions: a transaction for each would send four more messages to the server
                self._connection = engine.connect().execution_options(isolation_level="AUTOCOMMIT")
            except HistoryError:
                engine.dispose()
                raise
            except SQLAlchemyError as error:
                engine.dispose()
                refused = refused or error
                if not any(word in error_message(error, engine.url) for word in _NO_WRITING):
                    break
            else:
                self._engine = engine
                return
        raise HistoryError(self.url, error_message(refused, engine.url) if refused else "cannot be opened") from refused

    def __exit__(self, *reason: object) -> None:
        """Close the connection."""
        self._connection.close()
        super().__exit__(*reason)

    @property
    def is_known(self) -> bool:
        """True if the database has the site."""
        return self._site != NO_SITE

    def span(self) -> Span | None:
        """Return the time span of the windows, including days of which only the figures are kept; None without any."""
        windows, days = schema.windows.c, schema.window_days.c
        ends = select(func.min(windows.end), func.max(windows.end)).where(windows.site == self._site)
        [(start, end)] = self._rows(ends)
        [(first_day,)] = self._rows(select(func.min(days.day)).where(days.site == self._site))
        if start is None:
            return None
        return Span(start=start if first_day is None else min(start, (first_day + 1) * schema.DAY - 1), end=end)

    def windows(self, span: Span, most: int = 1000) -> list[WindowRow]:
        """Return the last windows of a span, in the order of time."""
        return self._objects(WindowRow, windows_query(self._site, span).limit(most))[::-1]

    def days(self, span: Span) -> list[DayRow]:
        """Return all windows of a span by the day."""
        table, (first, last) = schema.window_days, span.days
        own = select(*_columns(table)).where(table.c.site == self._site)
        found = own.where(table.c.day.between(first, last)).order_by(table.c.day)
        return self._objects(DayRow, found)

    def modes(self) -> list[int]:
        """Return the identities of all modes ever tracked."""
        table = schema.mode_days
        return [
            row[0]
            for row in self._rows(
                select(table.c.mode).where(table.c.site == self._site).distinct().order_by(table.c.mode)
            )
        ]

    def trend(self, mode: int, span: Span, every: Every | None = None) -> list[TrendPoint]:
        """Return a mode over a span of time; by default with the resolution of the span."""
        return self._objects(TrendPoint, _TREND_QUERIES[every or span.every](self._site, mode, span))

    def trends(self, span: Span) -> dict[int, list[TrendPoint]]:
        """Return all modes over a span of time, as `trend` does each; those without a point are left out."""
        found: dict[int, list[TrendPoint]] = defaultdict(list)
        for point in self._objects(TrendPoint, _TREND_QUERIES[span.every](self._site, None, span)):
            found[point.mode].append(point)
        return dict(sorted(found.items()))

    def alarms(self, span: Span) -> list[AlarmRow]:
        """Return the alarms that were active at any time of a span."""
        table = schema.alarms
        open_still = table.c.cleared.is_(None) | (table.c.cleared >= span.start)
        own = select(*_columns(table)).where(table.c.site == self._site)
        found = own.where(table.c.raised <= span.end, open_still).order_by(table.c.raised)
        return self._objects(AlarmRow, found)

    def events(self, span: Span, most: int = 1000, topic: str | None = None) -> list[EventRow]:
        """Return the last events of a span, or of one kind, in the order of time."""
        return self._objects(EventRow, events_query(self._site, span, topic).limit(most))[::-1]

    def alarm_changes(self, span: Span, most: int) -> list[EventRow]:
        """Return the last reported changes of the alarm in a span as events, in the order of time."""
        table = schema.changes
        query = (
            select(table.c.time, table.c.state, table.c.text)
            .where(table.c.site == self._site, table.c.time.between(span.start, span.end), table.c.quiet.is_(False))
            .order_by(table.c.time.desc())
            .limit(most)
        )
        return [
            EventRow(time=time, topic=f"/alarm/{state}", device="", json=json.dumps({"text": text}))
            for time, state, text in reversed(self._rows(query))
        ]

    def state(self) -> str:
        """Return the state of the alarm: learning, normal, watch or alarm."""
        table = schema.changes
        states = select(table.c.state).where(table.c.site == self._site)
        last = self._rows(states.order_by(table.c.time.desc()).limit(1))
        return str(last[0][0]) if last else "learning"

    def diagnosis(self, since: int, until: int | None = None) -> str | None:
        """Return the newest diagnosis since a time [ns UTC], and until another if one is given, as JSON."""
        table = schema.diagnoses
        found = select(table.c.json).where(table.c.site == self._site, table.c.end >= since)
        if until is not None:
            found = found.where(table.c.end <= until)
        last = self._rows(found.order_by(table.c.end.desc()).limit(1))
        return str(last[0][0]) if last else None

    def reference(self) -> str | None:
        """Return the newest baseline as the JSON of a `ReferenceResult`."""
        table = schema.references
        found = select(table.c.json).where(table.c.site == self._site)
        last = self._rows(found.order_by(table.c.time.desc()).limit(1))
        return str(last[0][0]) if last else None

    def _rows(self, query: Select[*tuple[Any, ...]]) -> list[Row[*tuple[Any, ...]]]:
        return self._read(query, lambda result: list(result.all()))

    def _objects(self, kind: Callable[..., T], query: Select[*tuple[Any, ...]]) -> list[T]:
        """Return an object for each row, whose columns are its fields.

        Rows are converted and released in parts. As many new objects as all rows together would start a garbage
        collection of the whole program, which takes longer than a query.
        """

        def made(result: Result[*tuple[Any, ...]]) -> list[T]:
            names = tuple(result.keys())
            return [kind(**dict(zip(names, row, strict=True))) for part in result.partitions(_PART) for row in part]

        return self._read(query, made)

    def _read(self, query: Select[*tuple[Any, ...]], taken: Callable[[Result[*tuple[Any, ...]]], T]) -> T:
        try:
            return taken(self._connection.execute(query))
        except SQLAlchemyError as error:
            raise self._error(error) from error


def _columns(table: Table) -> list[Column[Any]]:
    return [column for column in table.columns if column.name != "site"]


def windows_query(site: int, span: Span) -> Select[*tuple[Any, ...]]:
    """Return the query for windows, the newest first."""
    table = schema.windows
    found = select(*_columns(table)).where(table.c.site == site, table.c.end.between(span.start, span.end))
    return found.order_by(table.c.end.desc())


def trend_query(site: int, mode: int | None, span: Span) -> Select[*tuple[Any, ...]]:
    """Return the query for a mode, or all of them, over time, per window."""
    table = schema.modes
    frequency = table.c.frequency
    extremes = (frequency.label("lowest"), frequency.label("highest"))
    values = (table.c.damping, table.c.shift_percent)
    deviations = (table.c.frequency_std, table.c.damping_std, table.c.shift_std_percent)
    found = select(table.c.mode, table.c.end.label("time"), literal(1).label("n"), frequency)
    found = found.add_columns(*extremes, *values, *deviations)
    own = found.where(table.c.site == site, true() if mode is None else table.c.mode == mode)
    return own.where(table.c.end.between(span.start, span.end)).order_by(table.c.end)


def hourly_trend_query(site: int, mode: int | None, span: Span) -> Select[*tuple[Any, ...]]:
    """Return the query for a mode, or all of them, over time, per hour."""
    hours = hour_of(span.start), hour_of(span.end)
    return _figures_query(schema.mode_hours, schema.mode_hours.c.hour, schema.HOUR, site, mode, hours)


def daily_trend_query(site: int, mode: int | None, span: Span) -> Select[*tuple[Any, ...]]:
    """Return the query for a mode, or all of them, over time, per day."""
    return _figures_query(schema.mode_days, schema.mode_days.c.day, schema.DAY, site, mode, span.days)


def _figures_query(
    table: Table, number: Column[int], length: int, site: int, mode: int | None, span: tuple[int, int]
) -> Select[*tuple[Any, ...]]:
    """Return the query for the figures of hours or days of a length [ns], from a first to a last number."""
    middle = (cast(number, BigInteger) * length + length // 2).label("time")
    columns = (column for column in _columns(table) if column is not number)
    own = select(middle, *columns).where(table.c.site == site, true() if mode is None else table.c.mode == mode)
    return own.where(number.between(*span)).order_by(number)


def events_query(site: int, span: Span, topic: str | None = None) -> Select[*tuple[Any, ...]]:
    """Return the query for events, or those of one kind, the newest first."""
    table = schema.events
    found = select(*_columns(table)).where(table.c.site == site, table.c.time.between(span.start, span.end))
    return (found if topic is None else found.where(table.c.topic == topic)).order_by(table.c.time.desc())


_TREND_QUERIES: dict[Every, Callable[[int, int | None, Span], Select[*tuple[Any, ...]]]] = {
    "window": trend_query,
    "hour": hourly_trend_query,
    "day": daily_trend_query,
}
