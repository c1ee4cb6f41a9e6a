"""Reliability of the number of masses that `locate_masses` states: its probability against the share that is right.

One, two or three masses, equally often, on models that share nothing with the one under test: the examiner's T-frame
with frequencies and shapes, and a Ritz model of a cantilever with frequencies alone. Results are appended to a file as
they are computed, and a run continues where the last one ended.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/updater/localization/count_masses.py [--cases N] [--seed S]
[--minutes M] [--only LINE ...] [--file FILE] [--processes N], or make bench-counting
"""

import argparse
import itertools
import json
import sys
import time
from collections.abc import Sequence
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import factorial

from benchmarks.common.random_bodies import share
from daq import FloatArray, IndexArray
from oma import ModalEstimate
from tests.examiner.draws import log_uniform
from tests.support.updater.mass_counts import APART, N_AFTER, N_BEFORE, SHARES, frame_with_masses
from tests.support.updater.ritz_cantilever import BEAM, LENGTH, Clamp, frequencies, structure_file
from updater import learn_reference, locate_masses, matched, parse_structure, stack_tracks

LINES = ("frame law", "frame coarse", "cantilever 8", "cantilever 6")
NUMBERS = (1, 2, 3)
STD = 3e-4  # of a cantilever's frequency in one window
BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.99, 1.0)
FORMER = 0.02  # prior probability of one mass more over that of one fewer in the prior used before
MIN = 1e-6  # probability, in logarithms


def counted(task: tuple[str, int, int, int]) -> dict[str, Any]:
    """Return the stated numbers of one case."""
    line, number, case, seed = task
    random = np.random.default_rng((seed, LINES.index(line), number, case))
    what, how = line.split()
    start = time.process_time()
    found = _frame(number, how, random) if what == "frame" else _cantilever(number, int(how), random)
    return {
        "line": line,
        "number": number,
        "case": case,
        "seed": seed,
        "probability": found.tolist(),
        "seconds": time.process_time() - start,
    }


def _frame(number: int, noise: str, random: np.random.Generator) -> FloatArray:
    """Return the probability of none, one, two and three masses on a frame of the examiner's."""
    case = frame_with_masses(number, noise, random)
    return locate_masses(case.reference, case.event).probability


def _cantilever(number: int, n_modes: int, random: np.random.Generator) -> FloatArray:
    """Return the same of masses taken off a cantilever of which frequencies alone are known."""
    truth = Clamp(
        shifts=log_uniform(random, 4e-5, 6e-5),
        turns=log_uniform(random, 0.04, 0.06),
        mass=random.uniform(0.2, 0.4),
        taper=random.uniform(-0.02, 0.02),
    )
    while True:
        at = random.uniform(0.1 * LENGTH, LENGTH, number)
        if all(abs(a - b) > APART * LENGTH for a, b in itertools.combinations(at, 2)):
            break
    bodies = [(float(x), BEAM * log_uniform(random, *SHARES)) for x in at]
    structure = parse_structure(structure_file(bodies, Clamp(shifts=5e-5, turns=0.05, mass=truth.mass)))
    before, after = (
        [_estimate(frequencies(on, truth, n_modes) * np.exp(STD * random.standard_normal(n_modes))) for _ in range(n)]
        for on, n in ((bodies, N_BEFORE), ([], N_AFTER))
    )
    track = np.arange(n_modes)
    reference = learn_reference(structure, before, [track] * N_BEFORE)
    event = matched(reference.baseline, reference.mean_of(stack_tracks(after, [track] * N_AFTER)))
    return locate_masses(reference, event.without_shapes()).probability


def _estimate(frequency: FloatArray) -> ModalEstimate:
    """Return frequencies with a clamped beam's shapes at the tip and the middle, which are only there to pair by."""
    k = np.arange(len(frequency))
    root = np.append([1.8751, 4.6941, 7.8548], (k[3:] + 0.5) * np.pi)[: len(k)]
    middle = _clamped(root, 0.5) / _clamped(root, 1.0)
    shape = np.column_stack([np.ones(len(k)), middle]).astype(complex)
    return ModalEstimate(
        channels=("tip_z", "middle_z"),
        frequency=frequency,
        frequency_std=STD * frequency,
        damping=np.full(len(k), 0.005),
        damping_std=np.full(len(k), 0.0005),
        shape=shape / np.linalg.norm(shape, axis=1, keepdims=True),
        shape_std=np.full(shape.shape, 0.02),
        support=np.ones(len(k)),
        law_ratio=np.ones(len(k)),
        start=0,
        end=0,
    )


def _clamped(root: FloatArray, x: float) -> FloatArray:
    """Return deflections (n,) of a clamped-free beam's functions at a share x of its length."""
    tip = (np.cosh(root) + np.cos(root)) / (np.sinh(root) + np.sin(root))
    s = root * x
    return np.asarray(np.exp(-s) + (1 - tip) * np.sinh(s) - np.cos(s) + tip * np.sin(s))


def fiftieth(probability: FloatArray) -> FloatArray:
    """Return probabilities (n, 4) with each further mass a fiftieth as probable beforehand, the prior used before."""
    number = np.arange(probability.shape[1])
    found = probability * factorial(number) * FORMER ** np.maximum(number - 1, 0)
    return np.asarray(found / found.sum(axis=1, keepdims=True))


def tables(results: Sequence[dict[str, Any]]) -> str:
    """Return counts and reliability by line, and the reliability of all lines in bins of the stated probability."""
    line, number = np.array([r["line"] for r in results]), np.array([r["number"] for r in results])
    stated = np.array([r["probability"] for r in results])
    text = (
        "| line | masses | cases | counted 0 | 1 | 2 | 3 | mean P of the true number |\n| --- |" + " ---: |" * 7 + "\n"
    )
    for name, true in itertools.product(LINES, NUMBERS):
        own = stated[(line == name) & (number == true)]
        if len(own):
            cells = [len(own), *np.bincount(own.argmax(axis=1), minlength=4)]
            text += f"| {name} | {true} | {' | '.join(map(str, cells))} | {own[:, true].mean():.2f} |\n"
    head = (
        "| prior | line | cases | mean stated [%] | right [%] (95 %) | log likelihood |\n| --- | --- |" + " ---: |" * 4
    )
    text += f"\n{head}\n"
    for prior, found in (("Poisson", stated), ("a fiftieth", fiftieth(stated))):
        for name in (*LINES, "all"):
            rows = np.flatnonzero((line == name) | (name == "all"))
            if len(rows):
                likelihood = np.log(np.maximum(found[rows, number[rows]], MIN)).sum()
                text += f"| {prior} | {name} | {_reliability(found[rows], number[rows])} | {likelihood:.1f} |\n"
    head = "| prior | stated | cases | mean stated [%] | right [%] (95 %) |\n| --- | --- |" + " ---: |" * 3
    text += f"\n{head}\n"
    for prior, found in (("Poisson", stated), ("a fiftieth", fiftieth(stated))):
        for low, high in itertools.pairwise(BINS):
            most = found.max(axis=1)
            rows = np.flatnonzero((low < most) & (most <= high))
            if len(rows):
                text += f"| {prior} | {low:.2f} to {high:.2f} | {_reliability(found[rows], number[rows])} |\n"
    text += "\nWith one, two and three masses as frequent as the Poisson prior takes them, over all lines:\n"
    for prior, found in (("Poisson", stated), ("a fiftieth", fiftieth(stated))):
        weight = np.array([1 / factorial(true) / (number == true).sum() for true in number])
        mean, right = (np.average(v, weights=weight) for v in (found.max(axis=1), found.argmax(axis=1) == number))
        text += f"{prior}: mean stated {100 * mean:.1f} %, right {100 * right:.1f} %\n"
    return text


def _reliability(stated: FloatArray, number: IndexArray) -> str:
    """Return cells: cases, mean stated probability of the answer, share of right answers."""
    right = share((stated.argmax(axis=1) == number).tolist())
    return f"{len(stated)} | {100 * stated.max(axis=1).mean():.1f} | {right}"


def main() -> int:
    """Compute the missing cases and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=60, help="of each number in each line")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="after which to stop and report")
    parser.add_argument("--only", nargs="+", default=LINES, choices=LINES)
    parser.add_argument("--file", type=Path, default=Path("count_masses.jsonl"))
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    done = [json.loads(line) for line in given.file.read_text().splitlines()] if given.file.exists() else []
    known = {(r["line"], r["number"], r["case"], r["seed"]) for r in done}
    tasks = [(ln, n, case, given.seed) for case in range(given.cases) for ln in given.only for n in NUMBERS]
    end = time.monotonic() + 60 * given.minutes
    with Pool(given.processes) as pool, given.file.open("a") as file:
        for result in pool.imap(counted, [t for t in tasks if t not in known]):
            done.append(result)
            file.write(json.dumps(result) + "\n")
            file.flush()
            if time.monotonic() > end:
                pool.terminate()
                break
    print(f"seed {given.seed}\n\n{tables(done)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
