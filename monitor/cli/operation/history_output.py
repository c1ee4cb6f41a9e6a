"""Results over months and years as tables, CSV, JSON and a picture."""

import csv
import json
from dataclasses import asdict
from pathlib import Path
from time import time_ns

from rich.markup import escape
from rich.table import Table

from daq.errors import writing
from daq.notebook import rounded_text
from monitor.cli.terminal import console, echo, new_table, progress
from monitor.errors import ArgumentError
from monitor.outputs.history import AlarmRow, EventRow, Reader, Span, TrendPoint
from monitor.outputs.history.summary import Found, look
from monitor.service.site import load_site
from monitor.text.events import event_sentence
from monitor.text.quantities import duration_text, last_value, percent, scatter, utc

_DAY = 86_400 * 10**9  # ns
_MAX = 20  # lines of a table
_EONS = 1e5  # days: more than any site has, of which ns fit into 64 bits


def read_history(target: str, site: str, days: float | None) -> Found:
    """Return the history of the last days, or of all time, of SITE.toml, a SQLite file or an address.

    Parameters
    ----------
    target : the site, file or address
    site : name of the site in a database of many; empty for that of SITE.toml, or the only one
    days : counted back from now; None for all
    """
    url, own = _place(target)
    with progress("reading"), Reader(url, site or own) as reader:
        if site and not reader.is_known:
            raise ArgumentError("--site-name", f"expected a site of the database, found {site!r}")
        now = time_ns()
        return look(reader, None if days is None else Span(start=now - round(min(_EONS, days) * _DAY), end=now))


def _place(target: str) -> tuple[str, str]:
    """Return the address of a history, and the name of the site in it if that is known."""
    if "://" in target:
        return target, ""
    path = Path(target)
    if path.suffix == ".toml":
        source = load_site(path).source
        return source.url, source.history_site
    if not path.is_file():
        missing = "" if path.exists() else ", which does not exist"
        raise ArgumentError("TARGET", f"expected SITE.toml, a SQLite file or an address, found {target!r}{missing}")
    return f"sqlite:///{path}", ""


def write_csv(path: Path, found: Found) -> None:
    """Write the trends: one line per mode and window, hour (over two days) or day (over two weeks)."""
    with writing(path, ArgumentError.of_file("--csv")), path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(TrendPoint.__dataclass_fields__)
        writer.writerows(asdict(point).values() for points in found.trends.values() for point in points)


def as_json(found: Found) -> dict[str, object]:
    """Return the output for other programs; times are ns UTC, days are counted from 1970-01-01."""
    return {
        "start": found.span.start,
        "end": found.span.end,
        "state": found.state,
        "every": found.span.every,
        "days": [asdict(day) for day in found.days],
        "alarms": [asdict(alarm) for alarm in found.alarms],
        "accepted": [change.payload() for change in found.accepted],
        "trends": {str(mode): [asdict(point) for point in points] for mode, points in found.trends.items()},
        "events": _told(found.events),
        "self_tests": _told(found.self_tests),
    }


def _told(events: list[EventRow]) -> list[dict[str, object]]:
    return [asdict(event) | {"json": json.loads(event.json)} for event in events]


def print_history(found: Found) -> None:
    """Print states, self-tests, alarms, modes and events."""
    windows = found.windows
    newest = f"; the newest {utc(found.newest)}" if found.newest < found.span.end else ""
    console.print(f"{utc(found.span.start)} to {utc(found.span.end)}")
    counts = f"{windows.number} windows, {windows.judged} judged, {windows.over} over the limit"
    echo(f"{counts}{newest}", divide=True)
    console.print(f"state: {found.state}")
    console.print(_self_tests(found.self_tests))
    _say_alarms(found.alarms)
    if any(found.trends.values()):
        console.print(_trends(found.trends))
    if found.events:
        console.print(_events(found.events))


def _self_tests(tests: list[EventRow]) -> str:
    """Return a line on the self-tests."""
    if not tests:
        return "self-tests: none"
    records = [json.loads(test.json) for test in tests]
    passed = [test.time for test, record in zip(tests, records, strict=True) if record["passed"]]
    last = records[-1]
    seen = f"{1000 * last['mass']:.0f} g would raise the alarm at {last['detected']} of {last['places']} places"
    before = "" if last["passed"] else f"; passed last {utc(passed[-1])}" if passed else "; none has passed"
    return f"self-tests: {len(tests)}, {len(passed)} passed; the last {utc(tests[-1].time)}: {seen}{before}"


def _say_alarms(alarms: list[AlarmRow]) -> None:
    """Print one line per alarm, and its text below it, which is too long for a column of a table."""
    console.print("\nalarms" if alarms else "alarms: none")
    for alarm in alarms[-_MAX:]:
        lasted = "active" if alarm.cleared is None else f"lasted {duration_text(alarm.lasted or 0.0)}"
        again = f", reopened {alarm.reopened} times" if alarm.reopened else ""
        known = f"acknowledged {utc(alarm.acknowledged)}" if alarm.acknowledged else "not acknowledged"
        echo(f"  {utc(alarm.raised)}   {lasted}{again}, {known}")
        echo(f"    {alarm.text}", divide=True)
    if alarms:
        console.print()


def _trends(trends: dict[int, list[TrendPoint]]) -> Table:
    title = "modes: frequencies in Hz, last damping and shift in %"
    names = ("mode", "windows", "first", "last", "lowest", "highest", "damping", "shift")
    table = new_table(right=names, no_wrap=True, title=title)
    for mode, points in trends.items():
        if not points:
            continue
        last = points[-1]
        lowest, highest = min(p.lowest for p in points), max(p.highest for p in points)
        std = last.frequency_std or scatter([p.frequency for p in points])
        figures = [rounded_text(f, std) for f in (points[0].frequency, last.frequency, lowest, highest)]
        damping = last_value([percent(p.damping) for p in points], percent(last.damping_std))
        shift = last_value([p.shift_percent for p in points], last.shift_std_percent, sign=True)
        table.add_row(str(mode), str(sum(p.n for p in points)), *figures, damping, shift)
    return table


def _events(events: list[EventRow]) -> Table:
    table = new_table(("time",), no_wrap=True, title="events")
    table.add_column("event")
    for event in events[-_MAX:]:
        table.add_row(utc(event.time), escape(event_sentence(event.topic, json.loads(event.json))))
    return table
