"""History of many sites in one PostgreSQL database: size, time of each query of a chart, of the page, of writing.

    python benchmarks/monitor/fleet_history.py [--sites 1000] [--days 365] [--keep-days 30] [--asked 100]

The server is started for the benchmark, with its default settings except those in SETTINGS. Windows of 10 minutes with
eight modes are kept one by one for `--keep-days`, daily figures for `--days`. Each query is sent for `--asked` random
sites: at first after the server has been restarted and its files have been removed from the page cache, then with the
same sites once more.
"""

import argparse
import os
import random
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import httpx
import numpy as np
from sqlalchemy import create_engine

from daq import Event
from monitor.outputs.history import FleetReader, HistoryStore, Reader, SiteState, Span, Writer
from monitor.outputs.history.schema import DAY
from monitor.service.processes import spare_what_is_loaded
from tests.support.monitor.fleet import Fleet, fill
from tests.support.monitor.history import run_events
from tests.support.postgres import Server, postgres_server

SETTINGS = ("shared_buffers=1GB", "maintenance_work_mem=512MB", "max_wal_size=8GB", "checkpoint_timeout=30min")
WRITERS, WRITES, PORT = 4, 200, 28_770
SPANS = {"day": 1, "14 days": 14, "month": 30, "year": 365}
Query = Callable[[Reader, Span], object]
QUERIES: dict[str, Query] = {
    "all modes": Reader.trends,
    "novelty": lambda reader, span: reader.days(span) if span.every == "day" else reader.windows(span, 10**6),
    "alarms": Reader.alarms,
    "events": Reader.events,
}


def forget_cache(server: Server) -> None:
    """Restart the server, and remove its files from the page cache."""
    server.stop()
    for path in server.data.rglob("*"):
        if path.is_file():
            handle = os.open(path, os.O_RDONLY)
            os.posix_fadvise(handle, 0, 0, os.POSIX_FADV_DONTNEED)
            os.close(handle)
    server.start()


def milliseconds(action: Callable[[], object]) -> float:
    """Return how long an action takes [ms]."""
    begun = time.perf_counter()
    action()
    return 1e3 * (time.perf_counter() - begun)


def row(name: str, *times: Sequence[float]) -> str:
    """Return a line of the table: median and 95 % quantile of each set of times [ms]."""
    figures = (f"{np.quantile(t, q):.1f}" for t in times for q in (0.5, 0.95))
    return f"| {name} | {' | '.join(figures)} |"


def chart_times(url: str, query: Query, days: int, sites: Sequence[int]) -> list[float]:
    """Return the times of a query for some sites, each with an opened reader [ms]."""
    now = time.time_ns()
    span = Span(start=now - days * DAY, end=now)
    found = []
    for site in sites:
        with Reader(url, f"structure {site:04}") as reader:
            reader.state()  # connected
            found.append(milliseconds(partial(query, reader, span)))
    return found


def sizes(url: str) -> dict[str, tuple[int, int]]:
    """Return rows and bytes, with indexes, of each table."""
    engine = create_engine(url.replace("postgresql:", "postgresql+psycopg:"), isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.exec_driver_sql("VACUUM ANALYZE")
        connection.exec_driver_sql("CHECKPOINT")
        found = connection.exec_driver_sql(
            "SELECT relname, reltuples::bigint, pg_total_relation_size(oid) FROM pg_class "
            "WHERE relkind = 'r' AND relnamespace = 'public'::regnamespace ORDER BY 3 DESC"
        )
        result = {name: (count, size) for name, count, size in found}
        order = connection.exec_driver_sql("SELECT correlation FROM pg_stats WHERE tablename='modes' AND attname='end'")
        print(f"rows of modes in the order of time: correlation {order.scalar():.3f}")
    engine.dispose()
    return result


def page_times(url: str, number: int) -> tuple[list[float], list[float]]:
    """Return the time of the first answer of the server of the page, and of others, none younger than a second [ms]."""
    command = [sys.executable, "-c", "from monitor.cli.main import main; main()", "fleet", url, "--web-port", str(PORT)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process, httpx.Client(timeout=60.0) as client:
        assert process.stdout is not None
        process.stdout.readline()

        def ask(query: str) -> object:
            return client.get(f"http://127.0.0.1:{PORT}/{query}").raise_for_status()

        first = milliseconds(partial(ask, ""))
        found = []
        for k in range(number):
            time.sleep(1.1)  # states are read anew once per second at most
            found.append(milliseconds(partial(ask, ("", "?page=5", "?state=stale", "?q=99")[k % 4])))
        process.terminate()
    return [first], found


def written(url: str, sites: int, events: Sequence[Event], number: int) -> list[float]:
    """Write windows of many sites, as their monitors do, each with a state; return the time of each [ms]."""
    found = []
    state = SiteState(state="normal", window=0, window_age=1.0, overdue=False, problems=(), url="")
    for k in range(WRITES):
        site = f"structure {1 + (number + WRITERS * k) % sites:04}"
        with HistoryStore(url, Writer(site=site)) as store:
            now = time.time_ns()
            window = replace(events[k % len(events)], time=now)
            window.payload.update({"end": now, "start": now - 1})

            def write(store: HistoryStore = store, window: Event = window) -> None:
                store.write([window])
                store.write_state(state)

            found.append(milliseconds(write))
    return found


def main() -> None:
    """Fill, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sites", type=int, default=1000)
    parser.add_argument("--days", type=int, default=365)
    parser.add_argument("--keep-days", type=int, default=30)
    parser.add_argument("--asked", type=int, default=100)
    given = parser.parse_args()
    fleet = Fleet(sites=given.sites, days=given.days, keep_days=given.keep_days)
    draw = random.Random(1)
    with postgres_server(SETTINGS) as server:
        filling = milliseconds(lambda: fill(server.url, fleet))
        print(f"{fleet}, filled in {filling / 1e3:.0f} s")
        tables = sizes(server.url)
        print(f"database {sum(size for _, size in tables.values()) / 1e9:.2f} GB\n")
        print("| table | rows | MB | bytes per row |\n| --- | ---: | ---: | ---: |")
        for name, (count, size) in tables.items():
            print(f"| {name} | {count} | {size / 1e6:.1f} | {size / max(count, 1):.0f} |")
        spare_what_is_loaded()  # as the server of the page does
        print("\n| query of one site [ms] | from disk, p50 | p95 | again, p50 | p95 |")
        print("| --- | ---: | ---: | ---: | ---: |")
        for span, days in SPANS.items():
            for name, query in QUERIES.items():
                sites = draw.sample(range(1, fleet.sites + 1), min(given.asked, fleet.sites))
                forget_cache(server)
                cold = chart_times(server.url, query, days, sites)
                print(row(f"{name}, {span}", cold, chart_times(server.url, query, days, sites)), flush=True)
        with FleetReader(server.url) as reader:
            shown = list(range(1, min(50, fleet.sites) + 1))
            forget_cache(server)
            cold = [milliseconds(reader.sites)]
            print(row("states of all sites", cold, [milliseconds(reader.sites) for _ in range(given.asked)]))
            cold = [milliseconds(lambda: reader.levels(shown))]
            warm = [milliseconds(lambda: reader.levels(shown)) for _ in range(given.asked)]
            print(row("novelty of the 50 sites of a page", cold, warm))
        print(row("page of 48 sites through HTTP", *page_times(server.url, given.asked)), flush=True)
        windows = [e for e in run_events() if e.topic == "/result/window" and e.payload["novelty"]]
        begun = time.perf_counter()
        with ThreadPoolExecutor(WRITERS) as pool:
            jobs = [pool.submit(written, server.url, fleet.sites, windows, k) for k in range(WRITERS)]
            times = [ms for job in jobs for ms in job.result()]
        rate = len(times) / (time.perf_counter() - begun)
        print(f"\n{WRITERS} writers at once: {rate:.0f} windows with state per second, a connection for each write;")
        print(f"one takes {statistics.median(times):.0f} ms (p95 {np.quantile(times, 0.95):.0f} ms)")


if __name__ == "__main__":
    main()
