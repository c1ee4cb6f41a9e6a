"""The gain that a diagnosis states against that of the written file, loaded and diagnosed again.

Draws of benchmarks/updater/confusion/modes.py: a specimen is measured before and after, its change is diagnosed, and
structure_extended.toml is loaded from its text. Its frequencies are compared with held-out windows and with the true
ones by a pairing of the examiner's own (tests/support/updater/written_models.py), and it is diagnosed against fresh
windows. Prints a table and the misses.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/updater/written_gain.py [--draws N] [--seed S] [--minutes M]
[--cells CELL ...] [--alone], or make bench-written-gain
"""

import argparse
import sys
import time

import numpy as np

from benchmarks.updater.confusion.run import seed_of
from daq import FloatArray
from monitor.errors import StateError
from tests.examiner.cases import CAUSES, CELLS, ELSEWHERE, Case, draw
from tests.support.updater.written_models import Loop, closed_loop
from updater.errors import UpdaterError

_WITHOUT_A_FILE = {"nothing", "small", "amplitude_softening", "damping_change"}  # a file states no level, no damping
_OF_FILES = ("model_parameters", "added_mass", "support_stiffness", "local_stiffness")
_STRUCTURES = ("", "portal: ", "bridge: ", "mast: ")


def cells() -> list[str]:
    """Return the cells of one cause that a structure file can state."""
    causes = [cause for cause in CAUSES if cause not in _WITHOUT_A_FILE]
    return [f"{where}{cause}" for where in _STRUCTURES for cause in causes if f"{where}{cause}" in (*CELLS, *ELSEWHERE)]


def row(where: str, loops: list[Loop]) -> str:
    """Return a line of the table."""
    figures, again = [], 0
    for loop in loops:
        gained = loop.found.explained.gained
        if gained is None or loop.error is None or loop.true_error is None or loop.again is None:
            continue
        changes = gained.gain.change_error_percent.after if gained.gain.change_error_percent else None
        stated = gained.gain.frequency_error_percent.after
        figures.append([np.nan if x is None else x for x in (stated, loop.error, loop.true_error, changes)])
        again += loop.again.explained.diagnosis.verdict == "nothing_to_explain"
    if not figures:
        return f"| {where.removesuffix(': ') or 'T-frame'} | {len(loops)} | 0 | | | | | |"
    reported, files, truth, change = np.array(figures).T
    same = int((np.abs(reported / files - 1) < 1e-3).sum())
    return (
        f"| {where.removesuffix(': ') or 'T-frame'} | {len(loops)} | {len(reported)} | {same} | "
        f"{_spread(reported)} | {_spread(truth)} | {np.median(change):.3f} | {again} |"
    )


def _spread(values: FloatArray) -> str:
    return f"{np.median(values):.3f} / {np.quantile(values, 0.9):.3f}"


def main() -> int:
    """Run the draws and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=1, help="of each cell")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="after which to stop and report")
    parser.add_argument("--cells", nargs="+", default=cells())
    parser.add_argument("--alone", action="store_true", help="seek what was done only, and in the file a few causes")
    given = parser.parse_args()
    start, misses = time.monotonic(), list[str]()
    done: dict[str, list[Loop]] = {}
    for number, cell in ((n, c) for n in range(given.draws) for c in given.cells):
        if time.monotonic() - start > 60 * given.minutes:
            break
        try:
            case = draw(cell, seed_of(cell, given.seed) + number)
            loop = _alone(case) if given.alone else closed_loop(case)
        except (UpdaterError, StateError) as error:
            misses.append(f"- {cell} {number}: {error}")
            continue
        done.setdefault(cell[: -len(cell.rpartition(": ")[2])], []).append(loop)
        misses += _missed(cell, number, loop)
        print(f"{cell} {number}: {time.monotonic() - start:.0f} s", file=sys.stderr, flush=True)
    print("| structure | draws | with a file | stated = file | stated % | without noise % | changes % | nothing more |")
    print("|:--|---:|---:|---:|---:|---:|---:|---:|")
    for where, loops in done.items():
        print(row(where, loops))
    print("\n" + "\n".join(misses))
    return 0


def _alone(case: Case) -> Loop:
    """Return the loop of a case with the causes limited to its own, and in the file to those that files get wrong."""
    own = tuple(dict.fromkeys(hidden.cause for hidden in case.done.hidden))
    return closed_loop(case, only=own, again_only=tuple(dict.fromkeys((*_OF_FILES, *own))))


def _missed(cell: str, number: int, loop: Loop) -> list[str]:
    """Return the differences between the stated gain and the file's, and causes found when it is diagnosed again."""
    found = loop.found.explained
    if loop.again is None or found.gained is None or loop.error is None:
        return [] if found.extended is None else [f"- {cell} {number}: no gain"]
    reported = found.gained.gain.frequency_error_percent.after or np.nan
    text = []
    if abs(reported / loop.error - 1) > 1e-3:
        text.append(f"{reported:.3f} % stated, {loop.error:.3f} % by the file")
    again = loop.again.explained.diagnosis
    if again.verdict != "nothing_to_explain":
        text.append(f"diagnosed again: {again.verdict}, {' + '.join(c.cause for c in again.causes) or 'no cause'}")
    names = " + ".join(c.cause for c in found.diagnosis.causes)
    return [f"- {cell} {number} ({names}): {'; '.join(text)}"] if text else []


if __name__ == "__main__":
    sys.exit(main())
