"""The same history on a real PostgreSQL server."""

from pathlib import Path

import pytest
from sqlalchemy import create_engine, text

from daq import Event
from monitor.outputs.history import HistoryError, HistoryRecorder, HistoryStore, Reader, Span, engines, schema
from tests.support.monitor.history import HOUR, START, run_events, write_years
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
