"""Histories for tests: a short run in full, and years of figures put straight into the tables."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sqlalchemy import create_engine, text

from daq import Event
from monitor.outputs.history import HistoryStore, schema
from monitor.outputs.history.migrations import STEPS
from monitor.outputs.history.roll_ups import roll_up_days, roll_up_hours
from monitor.results.windows import AlarmResult, result_event
from tests.support.monitor.results import Site, whole_run

HOUR = 3600 * 10**9
START = 20_454 * 86_400 * 10**9  # 2026-01-01

#: tables of the first released schema
FIRST_SCHEMA = (
    "schema_version (version INTEGER NOT NULL, PRIMARY KEY (version))",
    'windows ("end" BIGINT NOT NULL, start BIGINT NOT NULL, number INTEGER NOT NULL, phase VARCHAR(16) NOT NULL, '
    'n_modes INTEGER NOT NULL, t2 FLOAT, "limit" FLOAT, problem TEXT, PRIMARY KEY ("end"))',
    'modes (mode INTEGER NOT NULL, "end" BIGINT NOT NULL, frequency FLOAT NOT NULL, frequency_std FLOAT, '
    'damping FLOAT, damping_std FLOAT, shift_percent FLOAT, shift_std_percent FLOAT, PRIMARY KEY (mode, "end"))',
    'diagnoses ("end" BIGINT NOT NULL, verdict VARCHAR(32) NOT NULL, text TEXT NOT NULL, json TEXT NOT NULL, '
    'PRIMARY KEY ("end"))',
    "baselines (time BIGINT NOT NULL, n_windows INTEGER NOT NULL, json TEXT NOT NULL, PRIMARY KEY (time))",
    "alarms (raised BIGINT NOT NULL, cleared BIGINT, lasted FLOAT, acknowledged BIGINT, text TEXT NOT NULL, "
    "reopened INTEGER NOT NULL, PRIMARY KEY (raised))",
    "alarm_changes (time BIGINT NOT NULL, kind VARCHAR(16) NOT NULL, state VARCHAR(16) NOT NULL, "
    "number INTEGER NOT NULL, quiet BOOLEAN NOT NULL, text TEXT NOT NULL, PRIMARY KEY (time, kind, state))",
    "events (time BIGINT NOT NULL, topic VARCHAR(64) NOT NULL, device VARCHAR(64) NOT NULL, json TEXT NOT NULL, "
    "PRIMARY KEY (time, topic, device))",
)


def run_events(**fields: Any) -> list[Event]:
    """Return a run that learns, monitors and finds a mass, as it is in the log."""
    run = whole_run(Site(**fields))
    results = [run["reference"], *run["windows"], *run["alarms"]]
    gap = Event(topic="/event/gap", time=run["windows"][3].end, payload={"device": "left", "missing": 12})
    return sorted([*map(result_event, results), gap], key=lambda event: event.time)


def change(time: int, state: str, text: str = "so", **fields: Any) -> Event:
    """Return a change of the alarm as it is in the log."""
    return result_event(AlarmResult.model_validate({"time": time, "state": state, "text": text, "window": 1} | fields))


def write_years(url: str, *, years: float, step: int, n_modes: int) -> int:
    """Fill a history with windows `step` [ns] apart: frequencies that swing with the year; return how many."""
    HistoryStore(url).__exit__()
    n = round(years * 365.25 * schema.DAY / step)
    ends = [START + i * step for i in range(1, n + 1)]
    window = {"site": 1, "phase": "watching", "n_modes": n_modes, "limit": 4.0, "problem": None}
    windows = [
        window | {"end": t, "start": t - step, "number": i, "t2": 1.0 + (i % 97) / 60} for i, t in enumerate(ends)
    ]
    modes = [
        {"site": 1, "mode": mode, "end": t, "shift_percent": (swing := 0.5 * math.sin(2 * math.pi * i / n))}
        | {"frequency": 10.0 * mode * (1 + swing / 100), "damping": 0.01}
        for mode in range(1, n_modes + 1)
        for i, t in enumerate(ends)
    ]
    engine = create_engine(url)
    with engine.begin() as connection:
        connection.execute(schema.windows.insert(), windows)
        connection.execute(schema.modes.insert(), modes)
        roll_up_days(connection)
        roll_up_hours(connection)
    engine.dispose()
    return n


def make_old(url: str, version: int, content: Mapping[str, dict[str, Any]]) -> None:
    """Make a database of an earlier version, with one row in each of some tables."""
    engine = create_engine(url)
    with engine.begin() as connection:
        for columns in FIRST_SCHEMA:
            connection.execute(text(f"CREATE TABLE {columns}"))
        connection.execute(text('CREATE INDEX modes_by_time ON modes ("end")'))
        for step in STEPS[: version - 1]:
            step(connection)
        connection.execute(schema.versions.insert(), [{"version": number + 1} for number in range(version)])
        for table, row in content.items():
            columns, marks = ", ".join(f'"{name}"' for name in row), ", ".join(f":{name}" for name in row)
            connection.execute(text(f"INSERT INTO {table} ({columns}) VALUES ({marks})"), row)
    engine.dispose()


def rows(url: str, table: str) -> list[dict[str, Any]]:
    """Return everything in a table."""
    engine = create_engine(url)
    try:
        with engine.connect() as connection:
            return [dict(row._mapping) for row in connection.execute(schema.metadata.tables[table].select())]
    finally:
        engine.dispose()


def sqlite_url(folder: Path) -> str:
    """Return a database in a folder."""
    return f"sqlite:///{folder / 'history.sqlite'}"
