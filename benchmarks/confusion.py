"""The confusion matrix of `diagnose`, from modes: what was done against what was said, and how far off.

Every draw is a specimen of its own, by a finite element code of its own (tests/sealed_*.py, which import nothing of
what they judge): another element, theory and mesh, weld, cables, sensors' masses, sensors off their places and turned,
gains scattered. Results are appended to a file as they come, and a run goes on where the last one ended, unless the
code that is judged has changed since. Prints the tables of docs/diagnosis.md, with the misses.

Usage: PYTHONPATH=tests OPENBLAS_NUM_THREADS=1 python benchmarks/confusion.py [--draws N] [--nulls N] [--minutes M]
[--noise law|coarse] [--seed S] [--cells CELL ...] [--file FILE] [--report], or make confusion
"""

import argparse
import json
import sys
import time
import zlib
from multiprocessing import Pool
from pathlib import Path

from confusion_table import Result, read_results, tables, version
from sealed_cases import CAUSES, CELLS, draw
from sealed_path import answer
from sealed_score import score

from updater.causes.catalogue import CATALOGUE
from updater.errors import UpdaterError

ALIASES = {"global_density", "temperature", "sampling_clock"}  # may stand in another's alias set only
Task = tuple[str, int, str]  #: cell, seed, noise


def known(cell: str) -> bool:
    """Say whether the catalogue has what the cell does; what stands in none belongs to every matrix."""
    return set(cell.removeprefix("solid: ").split(" + ")) & set(CAUSES) <= {*CATALOGUE, *ALIASES}


def judged(task: Task) -> Result:
    """Draw, diagnose and score one case."""
    cell, seed, noise = task
    case = draw(cell, seed, noise=noise)
    start = time.process_time()
    try:
        found = answer(case, noise=noise)
    except UpdaterError as error:
        return Result(cell=cell, seed=seed, noise=noise, kind=case.kind, outcome="refused", said=str(error))
    took = time.process_time() - start
    judged = score(found, case.done.hidden, case.kind)
    gain = found["gain"]["frequency_error_percent"] if found["gain"] else {"before": None, "after": None}
    return Result(
        cell=cell,
        seed=seed,
        noise=noise,
        kind=case.kind,
        outcome=judged.outcome,
        said=judged.said,
        done="; ".join(f"{h.cause} {h.position or ', '.join(h.channels)} {h.parameters}" for h in case.done.hidden),
        away=judged.away,
        errors=judged.errors,
        true=case.done.hidden[0].parameters if case.done.hidden else {},
        before=gain["before"],
        after=gain["after"],
        seconds=took,
    )


def tasks_of(cells: list[str], draws: int, nulls: int, seed: int, noise: str) -> list[Task]:
    """List cases so that a run that is cut short has as many of each cell."""
    count = {cell: nulls if cell == "nothing" else draws for cell in cells}
    first = {cell: seed + 100_000 * (zlib.crc32(cell.encode()) % 10_000) for cell in cells}
    most = max(count.values())
    return [
        (cell, first[cell] + i, noise)
        for share in range(most)
        for cell in cells
        for i in range(share * count[cell] // most, (share + 1) * count[cell] // most)
    ]


def main() -> int:
    """Run what is missing and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=100, help="of each cell")
    parser.add_argument("--nulls", type=int, default=300, help="draws of nothing")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="after which to stop and report")
    parser.add_argument("--noise", choices=("law", "coarse"), default="law")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cells", nargs="+", default=[c for c in CELLS if known(c)])
    parser.add_argument("--file", type=Path, default=Path("confusion.jsonl"))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--report", action="store_true", help="only print what the file holds")
    given = parser.parse_args()
    code, start = version(), time.monotonic()
    done = [r for r in read_results(given.file, code) if r.noise == given.noise and r.cell in given.cells]
    have = {(r.cell, r.seed) for r in done}
    tasks = tasks_of(given.cells, given.draws, given.nulls, given.seed, given.noise)
    left = [] if given.report else [t for t in tasks if t[:2] not in have]
    with Pool(given.processes) as pool, given.file.open("a", encoding="utf-8") as file:
        for i, result in enumerate(pool.imap_unordered(judged, left), start=1):
            file.write(json.dumps({"version": code} | result.model_dump()) + "\n")
            file.flush()
            done.append(result)
            minutes = (time.monotonic() - start) / 60
            if i % 20 == 0:
                print(f"{i} of {len(left)} in {minutes:.1f} min", file=sys.stderr, flush=True)
            if minutes > given.minutes:
                pool.terminate()
                break
    print(f"noise {given.noise}, seed {given.seed}\n\n{tables(done)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
