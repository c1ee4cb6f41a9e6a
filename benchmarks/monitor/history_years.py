"""Three years of ten-minute windows in a history: size, time of a query, time to add one more window.

python benchmarks/monitor/history_years.py
"""

import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from monitor.outputs.history import HistoryStore, Reader, Span
from monitor.outputs.history.schema import DAY
from tests.support.monitor.history import START, run_events, sqlite_url, write_years

YEARS, STEP, MODES, REPEATS = 3.0, 600 * 10**9, 8, 15


def milliseconds(action: Callable[[], object]) -> float:
    """Return the median time of an action [ms]."""
    times = []
    for _ in range(REPEATS):
        begun = time.perf_counter()
        action()
        times.append(time.perf_counter() - begun)
    return 1e3 * statistics.median(times)


def main() -> None:
    """Print a table."""
    with tempfile.TemporaryDirectory() as folder:
        url = sqlite_url(Path(folder))
        n = write_years(url, years=YEARS, step=STEP, n_modes=MODES)
        size = Path(folder, "history.sqlite").stat().st_size
        whole, end = Span(start=START, end=START + n * STEP), START + n * STEP
        week = Span(start=end - 7 * DAY, end=end)
        windows = [event for event in run_events() if event.topic == "/result/window"]
        with Reader(url) as reader, HistoryStore(url) as store:
            rows = [
                ("course of one mode over three years, by the day", milliseconds(lambda: reader.trend(3, whole))),
                ("the same, every window", milliseconds(lambda: reader.trend(3, whole, "window"))),
                ("novelty over three years, by the day", milliseconds(lambda: reader.days(whole))),
                ("course of one mode over a week, every window", milliseconds(lambda: reader.trend(3, week))),
                ("one more window put in", milliseconds(lambda: store.write([windows.pop()]))),
            ]
    print(f"{n} windows, {MODES} modes each: {size / 1e6:.0f} MB, {size / n:.0f} bytes a window\n")
    print("| asked | ms |\n| --- | ---: |")
    for name, value in rows:
        print(f"| {name} | {value:.1f} |")


if __name__ == "__main__":
    main()
