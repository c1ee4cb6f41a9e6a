"""Logged items are stored in the history once, in full, and are found through an index."""

import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import create_engine
from sqlalchemy.dialects import sqlite

from daq import Event
from monitor.outputs.history import HistoryError, HistoryStore, Reader, Span, Writer, schema
from monitor.outputs.history.migrations import NEWEST
from monitor.outputs.history.queries import (
    daily_trend_query,
    events_query,
    hourly_trend_query,
    trend_query,
    windows_query,
)
from monitor.outputs.history.roll_ups import roll_up_days, roll_up_hours
from tests.support.monitor.history import HOUR, START, change, make_old, rows, run_events, sqlite_url, write_years

EVENTS = run_events()


@pytest.fixture
def url(tmp_path: Path) -> str:
    return sqlite_url(tmp_path)


def write(url: str, *batches: list) -> None:  # type: ignore[type-arg]
    with HistoryStore(url) as store:
        for batch in batches:
            store.write(batch)


def everything(url: str) -> dict[str, list[object]]:
    return {name: [tuple(row.values()) for row in rows(url, name)] for name in schema.metadata.tables}


def test_repeated_writing_stores_each_item_once(url: str) -> None:
    write(url, EVENTS)
    once = everything(url)
    write(url, EVENTS[:9], EVENTS, list(reversed(EVENTS[:5])))
    assert {name: sorted(map(str, found)) for name, found in everything(url).items()} == {
        name: sorted(map(str, found)) for name, found in once.items()
    }
    assert len(once["windows"]) == 20
    assert len(once["modes"]) == 11 * 6 - 1  # twelve watched windows; one without modes, one that misses one
    assert len(once["events"]) == 1
    with Reader(url) as reader:
        assert reader.reference() is not None
        assert reader.state() == "alarm"
        assert reader.modes() == [1, 2, 3, 4, 5, 6]


def test_daily_statistics_match_the_windows_of_the_day(url: str) -> None:
    n = write_years(url, years=0.02, step=HOUR, n_modes=2)
    with Reader(url) as reader:
        span = reader.span()
        assert span is not None
        fine, coarse = reader.trend(2, span, "window"), reader.trend(2, span, "day")
        days, windows = reader.days(span), reader.windows(span)
    assert sum(day.n for day in days) == len(windows) == len(fine) == n
    for point in coarse:
        own = [p.frequency for p in fine if p.time // schema.DAY == point.time // schema.DAY]
        assert point.n == len(own)
        assert point.frequency == pytest.approx(sum(own) / len(own), rel=1e-12)
        assert (point.lowest, point.highest) == (min(own), max(own))
    levels = [w.t2 / w.limit for w in windows if w.t2 and w.limit]
    assert max(day.level or 0 for day in days) == pytest.approx(max(levels))


def test_alarm_is_one_row_from_raised_to_cleared(url: str) -> None:
    """Raised, acknowledged, cleared after 2 h, on again, cleared for good; then a second one that is active."""
    at = [START + i * HOUR for i in range(10)]
    run_results = [
        change(at[0], "watch"),
        change(at[1], "alarm", "first"),
        change(at[2], "alarm", kind="acknowledged"),
        change(at[3], "normal", lasted=7200.0),
        change(at[4], "alarm", kind="reopened", quiet=True),
        change(at[5], "normal", lasted=14400.0),
        change(at[7], "alarm", "second"),
        change(at[8], "alarm", kind="flapping"),
    ]
    write(url, run_results, run_results)
    with Reader(url) as reader:
        first, second = reader.alarms(Span(start=at[0], end=at[9]))
        assert [alarm.text for alarm in reader.alarms(Span(start=at[6], end=at[9]))] == ["second"]
    assert (first.raised, first.acknowledged, first.cleared, first.lasted) == (at[1], at[2], at[5], 14400.0)
    assert (first.text, first.reopened) == ("first", 1)
    assert (second.raised, second.cleared, second.reopened) == (at[7], None, 0)


def explained(time: int, cause: str) -> Event:
    """Return a window in alarm that names a cause."""
    window = next(e for e in EVENTS if e.payload.get("phase") == "alarm")
    found = {"cause": cause, "probability": 1.0, "where": None, "cannot_be_told_from": []}
    found |= {"parameters": {"mass": {"value": 0.2, "std": 0.01, "unit": "kg"}}}
    diagnosis = {"verdict": "explained", "causes": [found], "rejected": [], "modes": [], "gain": None}
    diagnosis |= {"extended_model": None, "next_measurement": ""}
    return replace(window, time=time, payload=window.payload | {"end": time, "diagnosis": diagnosis})


def test_window_raising_an_alarm_does_not_change_the_previous_alarm(url: str) -> None:
    """It is analysed, and written to the log, before the alarm that it raises."""
    at = [START + i * HOUR for i in range(6)]
    run_results = [change(at[0], "alarm", "first"), explained(at[1], "added_mass")]
    run_results += [change(at[2], "normal", kind="accepted", text="accepted as 'pump'", lasted=7200.0)]
    run_results += [explained(at[3], "sensor_dead"), change(at[3], "alarm", "second"), explained(at[4], "added_mass")]
    write(url, run_results)
    with Reader(url) as reader:
        first, second = reader.alarms(Span(start=at[0], end=at[5]))
    assert first.text == "accepted as 'pump'"
    assert "200 ± 10 g" in second.text


def test_unstorable_item_does_not_block_other_items(url: str) -> None:
    """A time beyond 64 bits: items that came with it, and after it, are stored."""
    events = [Event(topic="/event/gap", time=time, payload={"device": "left"}) for time in (1, 2**70, 3)]
    with HistoryStore(url) as store:
        assert store.write(events) == 1
        assert store.write(events[:1]) == 0
    assert [row["time"] for row in rows(url, "events")] == [1, 3]


@pytest.mark.parametrize("version", [1, 2, 3])
def test_older_schema_is_migrated_with_all_rows(url: str, version: int) -> None:
    """A database before figures per day, sites, or figures per hour; the monitor that opens it names the site."""
    window = {"end": START + HOUR, "start": START, "number": 1, "phase": "watching", "n_modes": 1}
    window |= {"t2": 9.0, "limit": 4.5, "problem": None}
    old_rows: dict[str, dict[str, object]] = {
        "windows": window,
        "modes": {"mode": 3, "end": START + HOUR, "frequency": 7.0},
        "diagnoses": {"end": START + HOUR, "verdict": "no_change", "text": "so", "json": "{}"},
        "baselines": {"time": START, "n_windows": 24, "json": "{}"},
        "alarms": {"raised": START, "text": "so", "reopened": 2},
        "alarm_changes": {"time": START, "kind": "state", "state": "alarm", "number": 1, "quiet": 0, "text": "so"},
        "events": {"time": START, "topic": "/event/gap", "device": "left", "json": "{}"},
    }
    if version >= 2:
        day = {"day": START // schema.DAY}
        old_rows |= {"window_days": day | {"n": 1, "n_judged": 1, "n_over": 1, "level": 2.0}}
        old_rows |= {"mode_days": day | {"mode": 3, "n": 1, "frequency": 7.0, "lowest": 7.0, "highest": 7.0}}
    if version >= 3:
        old_rows = {"sites": {"id": 1, "name": ""}} | {name: {"site": 1} | row for name, row in old_rows.items()}
    make_old(url, version, old_rows)
    with Reader(url) as reader:  # which may come before the monitor
        [day_row] = reader.days(Span(start=START, end=START + HOUR))
    assert (day_row.day, day_row.n, day_row.n_over, day_row.level) == (START // schema.DAY, 1, 1, 2.0)
    HistoryStore(url, Writer(site="bridge")).__exit__()
    assert [row["version"] for row in rows(url, "schema_version")] == list(range(1, NEWEST + 1))
    [site] = rows(url, "sites")
    assert site["name"] == "bridge"
    old_rows.pop("sites", None)
    for table, row in old_rows.items():
        [kept] = rows(url, table)
        assert {name: kept[name] for name in ("site", *row)} == {"site": site["id"]} | row
    for table in ("mode_days", "mode_hours"):
        [figures] = rows(url, table)
        assert (figures["mode"], figures["n"], figures["frequency"]) == (3, 1, 7.0)
    assert figures["hour"] == START // HOUR  # that ends with the window


def test_newer_schema_version_is_refused(url: str) -> None:
    write(url, EVENTS[:2])
    engine = create_engine(url)
    with engine.begin() as connection:
        connection.execute(schema.versions.insert().values(version=NEWEST + 1))
    engine.dispose()
    for opened in (HistoryStore, Reader):
        with pytest.raises(
            HistoryError, match=f"is of schema version {NEWEST + 1}, this program supports up to {NEWEST}"
        ):
            opened(url)


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("nonsense", "expected sqlite:///FILE or postgresql://"),
        ("oracle9://x", "expected sqlite:///FILE or postgresql://"),
        ("sqlite:////proc/nowhere/h.sqlite", "/proc/nowhere"),
        ("postgresql://me:secret@127.0.0.1:1/none", "127.0.0.1"),
    ],
)
def test_invalid_database_address_is_reported_without_the_password(url: str, says: str) -> None:
    with pytest.raises(HistoryError) as caught:
        HistoryStore(url)
    assert says in str(caught.value)
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("waiting", [True, False])
def test_read_only_history_can_be_read(url: str, monkeypatch: pytest.MonkeyPatch, waiting: bool) -> None:
    """Another user's, or a copy on a read-only disk: SQLite's message there, whoever runs this test."""

    def refuse(*_: object) -> None:
        raise sqlite3.OperationalError("attempt to write a readonly database")

    store = HistoryStore(url)
    store.write(EVENTS)
    if not waiting:
        store.__exit__()
    monkeypatch.setattr("monitor.outputs.history.engines._set_pragmas", refuse)
    with Reader(url) as reader:
        assert len(reader.modes()) == 6
    store.__exit__()


def test_queries_over_a_year_use_an_index(url: str) -> None:
    """No question reads a table from end to end, by the database's own account; by the day, a year is 366 rows."""
    n = write_years(url, years=1.0, step=HOUR, n_modes=3)
    span = Span(start=START, end=START + n * HOUR)
    engine = create_engine(url)
    with engine.connect() as connection:
        for query in (
            windows_query(1, span),
            trend_query(1, 2, span),
            hourly_trend_query(1, 2, span),
            daily_trend_query(1, 2, span),
            events_query(1, span),
        ):
            text = str(query.compile(dialect=sqlite.dialect(), compile_kwargs={"literal_binds": True}))
            plan = [str(row[3]) for row in connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {text}")]
            assert plan, text
            plan = [step for step in plan if not step.startswith("USE TEMP B-TREE")]  # of some thousand rows found
            assert all(step.startswith("SEARCH") and "INDEX" in step for step in plan), (text, plan)
    engine.dispose()
    with Reader(url) as reader:
        assert len(reader.trend(2, span)) == 366
        assert sum(point.n for point in reader.trend(2, span)) == n


def test_figures_are_those_of_all_windows_after_every_write(url: str) -> None:
    """Hours and days that grow window by window are the same as those summed up at once."""
    write(url, *([event] for event in EVENTS))
    kept = {name: rows(url, name) for name in ("mode_hours", "mode_days")}
    engine = create_engine(url)
    with engine.begin() as connection:
        for table in (schema.mode_hours, schema.mode_days, schema.window_days):
            connection.execute(table.delete())
        roll_up_days(connection)
        roll_up_hours(connection)
    engine.dispose()
    assert kept == {name: rows(url, name) for name in kept}
    assert sum(row["n"] for row in kept["mode_hours"]) == len(rows(url, "modes")) > 0


def test_trend_per_hour_is_that_of_its_windows(url: str) -> None:
    write_years(url, years=10 / 365, step=HOUR // 6, n_modes=3)
    span = Span(start=START, end=START + 240 * HOUR)
    with Reader(url) as reader:
        assert (span.every, Span(start=START, end=START + 48 * HOUR).every) == ("hour", "window")
        found, windows = reader.trends(span), reader.trend(2, span, "window")
        assert found[2] == reader.trend(2, span)
    assert len(found) == 3
    assert sum(point.n for point in found[2]) == len(windows) > 1400
    for point in found[2]:
        own = [w for w in windows if point.time - HOUR // 2 < w.time <= point.time + HOUR // 2]
        assert point.n == len(own)
        assert point.frequency == pytest.approx(sum(w.frequency for w in own) / len(own), rel=1e-12)
        assert (point.lowest, point.highest) == (min(w.frequency for w in own), max(w.frequency for w in own))
