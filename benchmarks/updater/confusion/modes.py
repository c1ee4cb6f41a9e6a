"""Confusion matrix of `diagnose`, from modes: true against stated causes, with errors of size and position.

Every draw is a separate specimen, by an independent finite element code (tests/examiner, which imports nothing of the
code under test): another element, theory and mesh, weld, cables, sensors' masses, sensors off their positions and
turned, gains scattered; or a solid bar by scikit-fem. Results are appended to a file as they are computed, and a run
continues where the last one ended, unless the code under test has changed since. Prints tables of the documentation and
the misses.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/updater/confusion/modes.py [--draws N] [--nulls N] [--minutes M]
[--noise law|coarse] [--seed S] [--cells CELL ... | --elsewhere | --built | --far] [--file FILE],
or make bench-confusion
"""

import argparse
import sys
import time
from pathlib import Path

from benchmarks.updater.confusion.run import Task, known_cells, result_of, run, seed_of
from benchmarks.updater.confusion.table import Result, tables
from monitor.errors import StateError
from tests.examiner.cases import BUILT, ELSEWHERE, FAR, draw
from tests.examiner.path import answer
from updater.errors import UpdaterError


def judged(task: Task) -> Result:
    """Draw, diagnose and score one case."""
    cell, seed, noise = task
    case, start = draw(cell, seed, noise=noise), time.process_time()
    try:
        found = answer(case, noise=noise)
    except (UpdaterError, StateError) as error:
        return result_of(case, noise, str(error), time.process_time() - start)
    return result_of(case, noise, found, time.process_time() - start)


def tasks_of(cells: list[str], draws: int, nulls: int, seed: int, noise: str) -> list[Task]:
    """List cases so that a run that is cut short has as many of each cell."""
    count = {cell: nulls if cell == "nothing" else draws for cell in cells}
    most = max(count.values())
    return [
        (cell, seed_of(cell, seed) + i, noise)
        for share in range(most)
        for cell in cells
        for i in range(share * count[cell] // most, (share + 1) * count[cell] // most)
    ]


def main() -> int:
    """Run the missing cases and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=100, help="of each cell")
    parser.add_argument("--nulls", type=int, default=300, help="draws of nothing")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="after which to stop and report")
    parser.add_argument("--noise", choices=("law", "coarse"), default="law")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cells", nargs="+", default=known_cells())
    parser.add_argument("--file", type=Path, default=Path("confusion.jsonl"))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--elsewhere", action="store_true", help="on a portal, a bridge, a mast and a grid instead")
    parser.add_argument("--built", action="store_true", help="without reference logs, of files that are a little off")
    parser.add_argument(
        "--far", action="store_true", help="likewise, of files that are 15 to 35 %% too stiff or too soft"
    )
    given = parser.parse_args()
    cells = list(ELSEWHERE if given.elsewhere else BUILT if given.built else FAR if given.far else given.cells)
    tasks = tasks_of(cells, given.draws, given.nulls, given.seed, given.noise)
    done = run(judged, tasks, given.file, minutes=given.minutes, processes=given.processes)
    print(f"noise {given.noise}, seed {given.seed}\n\n{tables(done)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
