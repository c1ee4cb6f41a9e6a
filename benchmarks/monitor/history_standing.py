"""An alarm that is active for a month of ten-minute windows: size of a window in the history, thinned each hour or not.

python benchmarks/monitor/history_standing.py demo-output/state/history.sqlite

Each diagnosis is the last one of that history, its sizes moved as the mean of the newest 100 windows moves.
"""

import random
import sqlite3
import sys
import tempfile
import time
from pathlib import Path

from daq import Event
from monitor.outputs.history import HistoryStore
from monitor.results.comparison import DiagnosisAnswer
from monitor.results.windows import ModeResult, WindowResult, result_event
from tests.support.monitor.history import START, change, rows, sqlite_url
from updater import Cause

N, STEP, MODES, FUSED, HOUR = 30 * 144, 600 * 10**9, 8, 100, 6


def moved(cause: Cause, by: float) -> Cause:
    """Return a cause with all its parameters off by so many of their standard deviations."""
    sizes = {name: q.model_copy(update={"value": q.value + by * q.std}) for name, q in cause.parameters.items()}
    return cause.model_copy(update={"parameters": sizes})


def window(number: int, diagnosis: DiagnosisAnswer, by: float) -> Event:
    """Return a window in alarm as it is in the log."""
    end = START + (number + 1) * STEP
    figures = {"frequency_std": 0.01, "damping": 0.012, "damping_std": 1e-3, "shift_percent": -0.7, "shape": []}
    each = [{"id": k, "frequency": 9.7 * k + 1e-3 * by} for k in range(1, MODES + 1)]
    modes = [ModeResult.model_validate(mode | figures) for mode in each]
    found = diagnosis.model_copy(update={"causes": tuple(moved(cause, by) for cause in diagnosis.causes)})
    fields = {"index": number, "start": end - STEP, "end": end, "phase": "alarm", "channels": [], "modes": modes}
    return result_event(WindowResult.model_validate(fields | {"diagnosis": found}))


def main() -> None:
    """Print a table."""
    with sqlite3.connect(sys.argv[1]) as known:
        [text] = known.execute("SELECT json FROM diagnoses ORDER BY end DESC LIMIT 1").fetchone()
    diagnosis, draw = DiagnosisAnswer.model_validate_json(text), random.Random(1)
    single = [draw.gauss(0.0, FUSED**0.5) for _ in range(N + FUSED)]
    run_results = [window(n, diagnosis, sum(single[n : n + FUSED]) / FUSED) for n in range(N)]
    print(f"{N} windows, {MODES} modes each, a diagnosis of {len(text)} bytes\n")
    print("| diagnoses | kept | bytes a window | slowest look [ms] |\n| --- | ---: | ---: | ---: |")
    for thinned in (False, True):
        with tempfile.TemporaryDirectory() as folder:
            slowest = 0.0
            with HistoryStore(sqlite_url(Path(folder))) as store:
                store.write([change(START, "alarm")])
                for first in range(0, N, HOUR):
                    store.write(run_results[first : first + HOUR])
                    if thinned:
                        begun = time.perf_counter()
                        store.forget(1000)
                        slowest = max(slowest, time.perf_counter() - begun)
            size = Path(folder, "history.sqlite").stat().st_size
            kept = len(rows(sqlite_url(Path(folder)), "diagnoses"))
        print(f"| {'thinned each hour' if thinned else 'all'} | {kept} | {size / N:.0f} | {1e3 * slowest:.1f} |")


if __name__ == "__main__":
    main()
