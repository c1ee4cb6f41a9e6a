"""Runs the cases of a confusion matrix that a file does not hold yet, and judges them."""

import json
import sys
import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.updater.confusion.table import Result, read_results, version
from tests.examiner.cases import CAUSES, CELLS, N_AFTER, N_BEFORE, Case
from tests.examiner.score import score
from tests.examiner.signals import N_MODES, modal_std
from updater.causes import CATALOGUE

Task = tuple[str, int, str]  #: cell, seed, noise
_MAX_DRAWS = 1000  # of a cell in one run


def known_cells() -> list[str]:
    """Return the cells whose causes are in the catalogue; changes outside the catalogue belong to every matrix."""
    return [
        c
        for c in CELLS
        if set(c.removeprefix("solid: ").removeprefix("file: ").split(" + ")) & set(CAUSES) <= set(CATALOGUE)
    ]


def seed_of(cell: str, seed: int) -> int:
    """Return the first seed of a cell's draws: its own, whatever other cells there are, and no other run's."""
    return _MAX_DRAWS * zlib.crc32(f"{cell} {seed}".encode())


def result_of(case: Case, noise: str, answer: Mapping[str, Any] | str, seconds: float) -> Result:
    """Judge an answer, or the error that was given instead."""
    done = "; ".join(f"{h.cause} {h.position or ', '.join(h.channels)} {h.parameters}" for h in case.done.hidden)
    both: dict[str, Any] = {"cell": case.cell, "seed": case.seed, "noise": noise, "kind": case.kind, "done": done}
    if isinstance(answer, str):
        return Result(**both, outcome="refused", reported=answer)
    judged = score(answer, case.done.hidden, case.kind, near=case.near, built=case.built)
    gain = answer["gain"]["change_error_percent"] if answer["gain"] else {"before": None, "after": None}
    return Result(
        **both,
        outcome=judged.outcome,
        reported=judged.reported,
        away=judged.away,
        errors=judged.errors,
        deviations=judged.deviations,
        inside=judged.inside,
        probability=judged.probability,
        first_is_right=judged.first_is_right,
        true=case.done.hidden[0].parameters if case.done.hidden else {},
        before=gain["before"],
        after=gain["after"],
        floor=None if noise.endswith(" s") else _floor(case, noise),
        seconds=seconds,
    )


def _floor(case: Case, noise: str) -> float:
    """Return the error of frequencies held out [%] that noise alone leaves: root mean square over the band's modes."""
    seen = case.done.before.claimed_frequency(N_MODES) < case.done.before.scale.band
    std, _ = modal_std(case.done.before, N_MODES, noise)
    return float(100 * np.sqrt((std[seen] ** 2).mean() * (1 / N_BEFORE + 1 / N_AFTER)))


def run(
    judged: Callable[[Task], Result],
    tasks: Sequence[Task],
    file: Path,
    *,
    minutes: float,
    processes: int,
    chunk: int = 1,
) -> list[Result]:
    """Judge the tasks that the file does not hold of this version of the code; return all results it then holds.

    Parameters
    ----------
    judged : does one task in a process of its own
    tasks : in the order in which they are done
    file : results are appended to it as they come
    minutes : after which to stop
    processes : at a time
    chunk : tasks that stay together in one process
    """
    code, start = version(), time.monotonic()
    wanted = set(tasks)
    done = [r for r in read_results(file, code) if (r.cell, r.seed, r.noise) in wanted]
    have = {(r.cell, r.seed, r.noise) for r in done}
    left = [t for t in tasks if t not in have]
    with Pool(processes) as pool, file.open("a", encoding="utf-8") as out:
        for i, result in enumerate(pool.imap_unordered(judged, left, chunksize=chunk), start=1):
            out.write(json.dumps({"version": code} | result.model_dump()) + "\n")
            out.flush()
            done.append(result)
            spent = (time.monotonic() - start) / 60
            if i % 20 == 0:
                print(f"{i} of {len(left)} in {spent:.1f} min", file=sys.stderr, flush=True)
            if spent > minutes:
                pool.terminate()
                break
    return done
