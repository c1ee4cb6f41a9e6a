"""Histories for tests: a short run in full, and years of figures put straight into the tables."""

import math
from pathlib import Path
from typing import Any

from sqlalchemy import create_engine

from daq import Event
from monitor.outputs.history import HistoryStore, schema
from monitor.outputs.history.daily import roll_up_all
from monitor.results.events import result_event
from monitor.results.windows import AlarmResult
from tests.support.monitor.results import Site, whole_run

HOUR = 3600 * 10**9
START = 20_454 * 86_400 * 10**9  # 2026-01-01


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
    window = {"phase": "watching", "n_modes": n_modes, "limit": 4.0, "problem": None}
    windows = [
        window | {"end": t, "start": t - step, "number": i, "t2": 1.0 + (i % 97) / 60} for i, t in enumerate(ends)
    ]
    modes = [
        {"mode": mode, "end": t, "shift_percent": (swing := 0.5 * math.sin(2 * math.pi * i / n))}
        | {"frequency": 10.0 * mode * (1 + swing / 100), "damping": 0.01}
        for mode in range(1, n_modes + 1)
        for i, t in enumerate(ends)
    ]
    engine = create_engine(url)
    with engine.begin() as connection:
        connection.execute(schema.windows.insert(), windows)
        connection.execute(schema.modes.insert(), modes)
        roll_up_all(connection)
    engine.dispose()
    return n


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
