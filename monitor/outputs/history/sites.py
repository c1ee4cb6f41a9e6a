"""Sites of one database, and the present state of each as its monitor last wrote it."""

import json
import time
from dataclasses import dataclass

from sqlalchemy import Connection, case, func, insert, select, update
from sqlalchemy.dialects.postgresql import insert as postgres_insert
from sqlalchemy.dialects.sqlite import insert as sqlite_insert
from sqlalchemy.exc import IntegrityError

from monitor.outputs.history.engines import HistoryError
from monitor.outputs.history.schema import sites, states

STATE_SECONDS = 120.0  #: age of a state beyond which its monitor is not running
_REPEAT_SECONDS = 45.0  # between two writings of a state that has not changed
NO_SITE = -1  #: number of a site that has no rows


@dataclass(frozen=True, kw_only=True)
class Writer:
    """The monitor that writes the rows of a site.

    Parameters
    ----------
    site : name of the site, empty for the only one
    place : host and folder of the monitor; empty if no other one could write to the same database
    """

    site: str = ""
    place: str = ""


ONLY_SITE = Writer()  #: the only site of a file


@dataclass(frozen=True, kw_only=True)
class SiteState:
    """Present state of a site."""

    state: str  #: of the alarm, or learning
    window: int | None  #: end of the last window [ns UTC]
    window_age: float | None  #: time since the last window [s]; None if there was none
    overdue: bool  #: whether a window is overdue
    problems: tuple[str, ...]
    url: str  #: address of the status page; empty if unknown

    @property
    def content(self) -> tuple[object, ...]:
        """Part whose change is written at once; texts of problems may contain ages."""
        return self.state, self.window, self.overdue, len(self.problems), self.url


class StateSchedule:
    """Times at which the present state of a site is written: at once if it has changed, else after a while."""

    def __init__(self) -> None:
        self._written: object = None
        self._due = 0.0  # monotonic time [s]

    def is_due(self, content: object) -> bool:
        """Return whether a state with this content is to be written now."""
        return content != self._written or time.monotonic() >= self._due

    def note_written(self, content: object) -> None:
        """Note that it is written."""
        self._written, self._due = content, time.monotonic() + _REPEAT_SECONDS


def register_site(connection: Connection, name: str) -> int:
    """Return the number of a site; a new one is added, one without a name gets this name."""
    known = {row.name: row.id for row in connection.execute(select(sites.c.name, sites.c.id))}
    if not name and len(known) == 1:
        return int(next(iter(known.values())))
    if name not in known:
        try:
            with connection.begin_nested():
                renamed = update(sites).where(sites.c.name == "").values(name=name)
                if not connection.execute(renamed).rowcount:
                    connection.execute(insert(sites).values(name=name))
        except IntegrityError:
            pass  # another program has added it
    return int(connection.scalars(select(sites.c.id).where(sites.c.name == name)).one())


def find_site(connection: Connection, name: str, url: str) -> int:
    """Return the number of a site for reading, of the only one without a name; `NO_SITE` if it has no rows yet.

    Raises
    ------
    HistoryError
        If there are several and no name is given.
    """
    known = {row.name: row.id for row in connection.execute(select(sites.c.name, sites.c.id).order_by(sites.c.name))}
    if name:
        return int(known.get(name, known.get("", NO_SITE)))
    if len(known) > 1:
        first = ", ".join(list(known)[:5])
        raise HistoryError(
            url, f"holds {len(known)} sites ({first}{', ...' * (len(known) > 5)}): expected --site-name NAME"
        )
    return int(next(iter(known.values()), NO_SITE))


def database_time(connection: Connection) -> int:
    """Return the time by the clock of the database, which all its programs share [ns UTC]."""
    if connection.dialect.name == "sqlite":
        return time.time_ns()
    microseconds = func.extract("epoch", func.clock_timestamp()) * 1_000_000
    return 1000 * int(connection.scalars(select(microseconds)).one())


def check_single_writer(connection: Connection, site: int, writer: Writer, url: str) -> None:
    """Check that no other running monitor writes the rows of a site.

    Raises
    ------
    HistoryError
        If one does.
    """
    if not writer.place:
        return
    row = connection.execute(select(states.c.place, states.c.time).where(states.c.site == site)).first()
    if row and row.place not in ("", writer.place) and database_time(connection) - row.time < STATE_SECONDS * 1e9:
        raise HistoryError(
            url, f"site {writer.site!r} is written by the monitor {row.place}: expected another name in history.site"
        )


def write_state(connection: Connection, site: int, writer: Writer, state: SiteState) -> None:
    """Replace the state of a site; the time since when it lasts is kept while it is the same."""
    now = database_time(connection)
    row = {
        "site": site,
        "time": now,
        "state": state.state,
        "since": now,
        "window_age": state.window_age,
        "overdue": state.overdue,
        "problems": json.dumps(state.problems),
        "url": state.url,
        "place": writer.place,
    }
    query = (sqlite_insert if connection.dialect.name == "sqlite" else postgres_insert)(states).values(row)
    new = query.excluded
    since = case((states.c.state == new.state, states.c.since), else_=new.since)
    values = {name: new[name] for name in row if name not in ("site", "since")} | {"since": since}
    connection.execute(query.on_conflict_do_update(index_elements=[states.c.site], set_=values))
