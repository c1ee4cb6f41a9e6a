"""The confusion matrix of `diagnose` from accelerations: shaken, recorded, logged, identified, tracked, diagnosed.

The draws are those of benchmarks/updater/confusion/modes.py, on specimens that several cells share (with one record
from before). Wind at eight places, an anti-alias filter, noise, quantization. A run continues where the last one ended.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/updater/confusion/records.py [--draws N] [--seconds S ...]
[--minutes M] [--seed S] [--cells CELL ...] [--file FILE], or make bench-confusion-records
"""

import argparse
import sys
import tempfile
import time
from functools import lru_cache
from pathlib import Path

import numpy as np

from benchmarks.updater.confusion.run import Task, known_cells, result_of, run
from benchmarks.updater.confusion.table import Result, tables
from daq import Recording, load_recordings, write_recording
from monitor.analysis.explanation import explain
from monitor.analysis.observation import Observation, observe, window_seconds
from monitor.errors import StateError
from oma import OmaError
from tests.examiner.cases import Case, draw, specimen
from tests.examiner.models.specimen import State
from tests.examiner.path import structure_of
from tests.examiner.signals import joined, recorded
from updater import Structure
from updater.errors import UpdaterError


def observed(recording: Recording, structure: Structure) -> Observation:
    """Write, read and identify, as `import` and `diagnose` do."""
    seconds = len(recording.data) / recording.rate
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.mcap"
        write_recording(log, recording)
        return observe(load_recordings(log, window_seconds=window_seconds(structure, seconds)))


@lru_cache(maxsize=2)
def usual(which: str, seed: int, seconds: float) -> Observation:
    """Observe a specimen to which nothing has been done."""
    state, _ = specimen(which, seed)
    return observed(recorded(state, seconds, np.random.default_rng((seed, 8))), structure_of(f"{which}: "))


def before(case: Case, seconds: float) -> Observation:
    """Record the specimen before the change; again where it was not in its drawn state."""
    which, _, _ = case.cell.rpartition(": ")
    if _same(case.done.before, specimen(which, case.seed)[0]):
        return usual(which, case.seed, seconds)
    return observed(recorded(case.done.before, seconds, np.random.default_rng((case.seed, 8))), structure_of(case.cell))


def _same(one: State, other: State) -> bool:
    return one.body == other.body and one.loudness == other.loudness


def after(case: Case, seconds: float) -> Recording:
    """Record it after the change, one state after another where it does not stay the same."""
    random = np.random.default_rng((case.seed, 9))
    states = case.done.wandering or (case.done.after,)
    return joined([recorded(state, seconds / len(states), random) for state in states])


def judged(task: Task) -> Result:
    """Draw, record, diagnose and score one case; the time is that of the diagnosis alone."""
    cell, seed, length = task
    seconds, case = float(length.removesuffix(" s")), draw(cell, seed)
    start = time.process_time()
    try:
        observations = before(case, seconds), observed(after(case, seconds), structure_of(cell))
        start = time.process_time()
        found = explain(structure_of(cell), *observations).diagnosis.model_dump(mode="json")
    except (UpdaterError, OmaError, StateError) as error:
        return result_of(case, length, str(error), time.process_time() - start)
    return result_of(case, length, found, time.process_time() - start)


def main() -> int:
    """Run the missing cases and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=5, help="specimens")
    parser.add_argument("--seconds", type=int, nargs="+", default=[120, 600], help="lengths of the records")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="after which to stop and report")
    parser.add_argument("--seed", type=int, default=7000)
    parser.add_argument(
        "--cells", nargs="+", default=[c for c in known_cells() if c != "small" and not c.startswith("file")]
    )
    parser.add_argument("--file", type=Path, default=Path("confusion_records.jsonl"))
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    tasks = [
        (cell, given.seed + draw, f"{seconds} s")
        for seconds in given.seconds
        for draw in range(given.draws)
        for cell in given.cells
    ]
    chunk = -(-len(given.cells) // 2)
    done = run(judged, tasks, given.file, minutes=given.minutes, processes=given.processes, chunk=chunk)
    for seconds in given.seconds:
        print(f"records of {seconds} s\n\n{tables([r for r in done if r.noise == f'{seconds} s'])}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
