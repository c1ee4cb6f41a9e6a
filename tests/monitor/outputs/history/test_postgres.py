"""The same history on a real PostgreSQL server."""

import hashlib
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Select, create_engine, text

from daq import Event
from monitor.outputs.history import (
    HistoryError,
    HistoryRecorder,
    HistoryStore,
    Reader,
    SiteState,
    Span,
    Writer,
    engines,
    schema,
    sites,
)
from monitor.outputs.history.migrations import NEWEST
from monitor.outputs.history.queries import daily_trend_query, hourly_trend_query
from tests.support.monitor.fleet import Fleet, fill
from tests.support.monitor.history import HOUR, START, make_old, run_events, write_years
from tests.support.monitor.notices import until
from tests.support.postgres import postgres_programs, postgres_url

EVENTS = run_events()
NEEDED = pytest.mark.skipif(postgres_programs() is None, reason="no PostgreSQL server is installed")


@pytest.mark.live
@NEEDED
def test_entries_for_a_locked_table_are_spooled_to_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As by a VACUUM FULL: PostgreSQL itself would block for hours."""
    monkeypatch.setattr(engines, "_LOCK_SECONDS", 0.1)
    spool = tmp_path / "spool.jsonl"
    with postgres_url() as url:
        HistoryStore(url).__exit__()
        session = create_engine(url.replace("postgresql:", "postgresql+psycopg:"))
        with HistoryRecorder(url, spool, keep_events=5, retry_seconds=0.05) as recorder:
            with session.begin() as connection:
                connection.execute(text("LOCK TABLE windows"))
                for event in EVENTS:
                    recorder.put(event)
                until(spool.exists)
                assert "lock timeout" in (recorder.problem or "")
            until(lambda: recorder.problem is None)
            with Reader(url) as reader:
                span = reader.span()
                assert span is not None
                assert len(reader.windows(span)) == 20
            with HistoryStore(url) as store:
                store.write([Event(topic="/event/gap", time=k, payload={}) for k in range(30)])
                store.forget(5)
            with Reader(url) as reader:
                assert [event.time for event in reader.events(Span(start=0, end=29))] == [26, 27, 28, 29]
        session.dispose()


@pytest.mark.live
@NEEDED
def test_run_is_stored_in_postgres_as_in_sqlite() -> None:
    with postgres_url() as url:
        for _ in range(2):  # the second time brings nothing new
            with HistoryStore(url) as store:
                store.write(EVENTS)
        with Reader(url) as reader:
            span = reader.span()
            assert span is not None
            assert (len(reader.windows(span)), reader.modes(), reader.state()) == (20, [1, 2, 3, 4, 5, 6], "alarm")
            [alarm] = reader.alarms(span)
            assert alarm.cleared is None
            assert sum(day.n for day in reader.days(span)) == 20
        engine = create_engine(url.replace("postgresql:", "postgresql+psycopg:"))
        with engine.begin() as connection:
            for table in reversed(schema.metadata.sorted_tables):
                connection.execute(text(f"DROP TABLE {table.name}"))
        engine.dispose()
        n = write_years(url.replace("postgresql:", "postgresql+psycopg:"), years=0.02, step=HOUR, n_modes=2)
        with Reader(url) as reader:
            assert sum(p.n for p in reader.trend(2, Span(start=START, end=START + n * HOUR), "day")) == n
        store = HistoryStore(url)
    with pytest.raises(HistoryError):  # the server has gone
        store.write(EVENTS)
    store.__exit__()


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with postgres_url() as url:
        yield url


@pytest.fixture
def database(server: str, request: pytest.FixtureRequest) -> str:
    """Return an empty database of the server."""
    name = "t" + hashlib.sha1(request.node.name.encode()).hexdigest()[:12]
    engine = create_engine(server.replace("postgresql:", "postgresql+psycopg:"), isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    engine.dispose()
    return server.replace("/postgres?", f"/{name}?")


def write_run(url: str, site: str, batch: int) -> None:
    """Write a run in batches, as its monitor does, whatever the others do."""
    with HistoryStore(url, Writer(site=site, place=site)) as store:
        for first in range(0, len(EVENTS), batch):
            store.write(EVENTS[first : first + batch])
            store.write_state(STATE)


STATE = SiteState(state="alarm", window=START, window_age=3.0, overdue=False, problems=(), url="")


@pytest.mark.live
@NEEDED
def test_monitors_that_write_at_once_lose_nothing(database: str) -> None:
    """All of them open an empty database at the same time, and write the same times."""
    sites = [f"site {k}" for k in range(8)]
    with ThreadPoolExecutor(len(sites)) as pool:
        for done in [pool.submit(write_run, database, site, 1 + k) for k, site in enumerate(sites)]:
            done.result()
    for site in sites:
        with Reader(database, site) as reader:
            span = reader.span()
            assert span is not None
            assert (len(reader.windows(span)), reader.modes(), reader.state()) == (20, [1, 2, 3, 4, 5, 6], "alarm")
            assert sum(point.n for mode in reader.modes() for point in reader.trend(mode, span, "day")) == 65
            assert sum(day.n for day in reader.days(span)) == 20
            [alarm] = reader.alarms(span)
            assert alarm.cleared is None
            assert reader.reference() is not None
            assert len(reader.events(Span(start=0, end=2**62))) == 1
    with pytest.raises(HistoryError, match=r"holds 8 sites \(site 0, .*\): expected --site-name NAME"):
        Reader(database)


@pytest.mark.live
@NEEDED
def test_older_database_is_migrated_by_the_first_of_its_writers(database: str) -> None:
    window: dict[str, Any] = {"end": START + HOUR, "start": START, "number": 1, "phase": "watching", "n_modes": 1}
    content = {
        "windows": window | {"t2": 9.0, "limit": 4.5},
        "modes": {"mode": 3, "end": START + HOUR, "frequency": 7.0},
    }
    make_old(database.replace("postgresql:", "postgresql+psycopg:"), 2, content)
    with HistoryStore(database, Writer(site="bridge", place="here")) as store:
        store.write(EVENTS)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda k: write_run(database, f"tower {k}", 5), range(4)))
    with Reader(database, "bridge") as reader:
        points = reader.trend(3, Span(start=START, end=START + HOUR), "window")
        assert {point.time: point.frequency for point in points}[START + HOUR] == 7.0
        [day] = reader.days(Span(start=START, end=START + HOUR))
        assert (day.n, day.n_judged) == (21, 12)


@pytest.mark.live
@NEEDED
@pytest.mark.parametrize("new", [True, False])
@pytest.mark.parametrize(
    ("figures", "query_of"), [("mode_hours", hourly_trend_query), ("mode_days", daily_trend_query)]
)
def test_all_modes_are_read_from_an_index_alone(
    database: str, figures: str, query_of: Callable[[int, int | None, Span], Select[Any]], *, new: bool
) -> None:
    """In the table, rows of a site are on as many pages as there are hours; a database without the index gets it."""
    days = 14
    fill(database, Fleet(sites=4, days=days, keep_days=days))
    engine = create_engine(database.replace("postgresql:", "postgresql+psycopg:"), isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        if not new:
            connection.exec_driver_sql(f"DROP INDEX {figures}_by_time")
            connection.exec_driver_sql(f"UPDATE schema_version SET version = {NEWEST - 2}")
        with Reader(database, "structure 0002"):
            pass  # it migrates
        connection.exec_driver_sql(f"VACUUM ANALYZE {figures}")
        now = time.time_ns()
        query = query_of(2, None, Span(start=now - days * schema.DAY, end=now))
        text = str(query.compile(dialect=engine.dialect, compile_kwargs={"literal_binds": True}))
        plan = "\n".join(row[0] for row in connection.exec_driver_sql(f"EXPLAIN (ANALYZE, BUFFERS) {text}"))
    engine.dispose()
    assert f"Index Only Scan using {figures}_by_time" in plan, plan
    assert "Heap Fetches: 0" in plan, plan


@pytest.mark.live
@NEEDED
def test_second_monitor_of_the_same_site_is_refused(database: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with HistoryStore(database, Writer(site="bridge", place="a:/state")) as store:
        store.write_state(STATE)
        with pytest.raises(HistoryError, match=r"site 'bridge' is written by the monitor a:/state: .*history\.site"):
            HistoryStore(database, Writer(site="bridge", place="b:/state"))
        HistoryStore(database, Writer(site="bridge", place="a:/state")).__exit__()  # a restart
        monkeypatch.setattr(sites, "STATE_SECONDS", 0.0)  # later
        with HistoryStore(database, Writer(site="bridge", place="b:/state")) as successor:
            successor.write_state(STATE)
        monkeypatch.undo()
        with pytest.raises(HistoryError, match="is written by the monitor b:/state"):
            store.write_state(STATE)
