"""Queries over all sites of a PostgreSQL database: their present states, and their last windows."""

import json
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Row, Select, select, true
from sqlalchemy.exc import SQLAlchemyError

from monitor.outputs.history import schema
from monitor.outputs.history.engines import HistoryError, OpenDatabase, open_engine, shown_url
from monitor.outputs.history.migrations import migrate
from monitor.outputs.history.sites import SiteState, database_time


@dataclass(frozen=True, kw_only=True)
class LastAlarm:
    """The alarm of a site that was raised last."""

    raised: int  #: [ns UTC]
    active: bool
    acknowledged: bool
    text: str


@dataclass(frozen=True, kw_only=True)
class FleetRow:
    """One site."""

    number: int
    name: str
    state: SiteState | None  #: None before its monitor has written one
    age: float  #: time since the state was written [s]; 0 without one
    lasts: float | None  #: time since the state of the alarm began [s]; None without a state
    alarm: LastAlarm | None


class FleetReader(OpenDatabase):
    """All sites of a PostgreSQL database, opened for questions; a server that was restarted is followed.

    Raises
    ------
    HistoryError
        If it is of another kind, or cannot be read; so do all its methods.
    """

    def __init__(self, url: str) -> None:
        self.url = shown_url(url)
        self._engine = open_engine(url)
        try:
            if self._engine.dialect.name != "postgresql":
                raise HistoryError(self.url, "expected postgresql://USER@HOST/NAME: a file holds one site")
            with self._engine.begin() as connection:
                migrate(connection, self.url)
        except HistoryError:
            self._engine.dispose()
            raise
        except SQLAlchemyError as error:
            self._engine.dispose()
            raise self._error(error) from error

    def sites(self) -> list[FleetRow]:
        """Return all sites, by name."""
        rows, now = self._rows(sites_query())
        return [_fleet_row(row, now) for row in rows]

    def levels(self, sites: Sequence[int], most: int = 40) -> dict[int, list[float]]:
        """Return the novelty of the last evaluated windows of some sites over its limit, in the order of time."""
        found: dict[int, list[float]] = defaultdict(list)
        for site, t2, limit in self._rows(levels_query(sites, most))[0]:
            found[site].append(t2 / limit)
        return {site: levels[::-1] for site, levels in found.items()}

    def _rows(self, query: Select[*tuple[Any, ...]]) -> tuple[list[Row[*tuple[Any, ...]]], int]:
        """Return the rows of an answer, and the time of the database [ns UTC]."""
        try:
            with self._engine.connect() as connection:
                return list(connection.execute(query)), database_time(connection)
        except SQLAlchemyError as error:
            raise self._error(error) from error


def sites_query() -> Select[*tuple[Any, ...]]:
    """Return the query for all sites with their states and last alarms."""
    sites, states, alarms = schema.sites.c, schema.states, schema.alarms
    newest = select(alarms).where(alarms.c.site == sites.id).order_by(alarms.c.raised.desc()).limit(1).lateral()
    columns = [column for column in states.columns if column.name != "site"]
    alarm = (newest.c.raised, newest.c.cleared, newest.c.acknowledged, newest.c.text)
    joined = schema.sites.outerjoin(states, states.c.site == sites.id).outerjoin(newest, true())
    return select(sites.id, sites.name, *columns, *alarm).select_from(joined).order_by(sites.name)


def levels_query(sites: Sequence[int], most: int) -> Select[*tuple[Any, ...]]:
    """Return the query for the last evaluated windows of some sites, the newest of each first."""
    windows, number = schema.windows.c, schema.sites.c.id
    judged = select(windows.end, windows.t2, windows.limit).where(windows.site == number, windows.t2.is_not(None))
    last = judged.where(windows.limit > 0).order_by(windows.end.desc()).limit(most).lateral()
    columns = (number, last.c.t2, last.c.limit)
    found = select(*columns).select_from(schema.sites.join(last, true())).where(number.in_(sites))
    return found.order_by(number, last.c.end.desc())


def _fleet_row(row: Row[*tuple[Any, ...]], now: int) -> FleetRow:
    state = None
    if row.state is not None:
        state = SiteState(
            state=row.state,
            window=None,
            window_age=row.window_age,
            overdue=row.overdue,
            problems=_texts(row.problems),
            url=row.url,
        )
    alarm = None
    if row.raised is not None:
        active, known = row.cleared is None, row.acknowledged is not None
        alarm = LastAlarm(raised=row.raised, active=active, acknowledged=known, text=row.text)
    age = 0.0 if state is None else (now - row.time) * 1e-9
    lasts = None if state is None else (now - row.since) * 1e-9
    return FleetRow(number=row.id, name=row.name, state=state, age=age, lasts=lasts, alarm=alarm)


def _texts(problems: str) -> tuple[str, ...]:
    """Return the texts of a JSON list; one that another program has written otherwise is a text itself."""
    try:
        found = json.loads(problems)
    except ValueError:
        found = problems
    return tuple(map(str, found)) if isinstance(found, list) else (str(found),)
