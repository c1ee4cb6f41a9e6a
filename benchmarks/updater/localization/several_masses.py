"""Share of several masses that are counted correctly, and the position error of the worse one.

Plain masses of 2 to 4 % of the structure each, anywhere, at least 0.3 m apart, on the true frames and with the noise of
benchmarks/updater/localization/modes.py. Prints a table.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/updater/localization/several_masses.py [CASES], or make bench-several
"""

import itertools
import sys
from dataclasses import dataclass
from multiprocessing import Pool

import numpy as np

from benchmarks.common.random_bodies import TOTAL, Placed, share
from benchmarks.updater.localization.modes import (
    FRAMES,
    LINES,
    N_BASELINE,
    N_EVENT,
    N_MODES,
    SEED,
    STRUCTURE,
    Frame,
    Line,
    calibrated,
    frame,
    learnt_anew,
)
from daq import FloatArray
from tests.support.updater.frames import unmoved
from updater import MassChange, build_model, locate_masses, matched, stack_tracks

NUMBERS = (1, 2)
NOISES = ("0.05/1", "0.1/2")
APART = 0.3  # m
SHOWN = 5.0  # standard deviations
SHARES = (0.02, 0.04)  # of the structure's mass
HEAD = (
    "| | cases | counted correctly [%] | larger position error, median [mm] | 90 % [mm] "
    "| larger mass error, median [%] |\n"
    "| --- |" + " ---: |" * 5
)


@dataclass(frozen=True)
class Counted:
    """Result of one case."""

    right: bool
    seen: bool  # whether each of the masses by itself would show in the frequencies
    off: float  # m, of the worse mass; NaN if the number is wrong
    mass_error: float  # share of its mass, of the worse mass; NaN if the number is wrong


def drawn(number: int, random: np.random.Generator) -> list[Placed]:
    """Return masses that are far enough from one another."""
    length = np.array([member.length for member in STRUCTURE.member])
    while True:
        chosen = random.choice(len(length), number, p=length / length.sum())
        members = [STRUCTURE.member[int(m)] for m in chosen]
        masses = TOTAL * random.uniform(*SHARES, number)
        found = [
            Placed(member=m, distance=float(random.uniform(0, m.length)), mass=float(kg))
            for m, kg in zip(members, masses, strict=True)
        ]
        if all(np.linalg.norm(point(a) - point(b)) > APART for a, b in itertools.combinations(found, 2)):
            return found


def point(placed: Placed) -> FloatArray:
    """Return where it is [m]."""
    return placed.member.point(placed.distance)


def one(task: tuple[str, int, int]) -> Counted:
    """Count the masses of one case; runs in a process of its own."""
    name, number, case = task
    line, here, random = LINES[name], frame(case % FRAMES), np.random.default_rng((SEED, number, case))
    placed = drawn(number, random)
    structure = here.truth.structure.with_bodies([p.body for p in placed])
    loaded = build_model(structure, shear_flexible=True, mass="consistent").modes(N_MODES)
    reference = learnt_anew(calibrated(case % FRAMES, line), here.windows(here.bare, line, N_BASELINE, random))
    windows = stack_tracks(here.windows(loaded, line, N_EVENT, random), unmoved(N_EVENT))
    seen = all(shown(p, here, line) for p in placed)
    masses = locate_masses(reference, matched(reference.baseline, reference.mean_of(windows))).masses
    return judged(placed, masses, seen)


def shown(placed: Placed, here: Frame, line: Line) -> bool:
    """Return whether a mass alone moves the frequencies by five standard deviations in total, to first order."""
    moved = (here.truth.model().read(point(placed))[:3] @ here.bare.shape) ** 2
    shift = 0.5 * placed.mass * moved.sum(0)
    return bool(np.linalg.norm(shift / (np.sqrt(2) * line.frequency_std(here.bare.frequency))) > SHOWN)


def judged(placed: list[Placed], found: tuple[MassChange, ...], seen: bool) -> Counted:
    """Judge an answer by the order of masses that fits it best."""
    if len(found) != len(placed):
        return Counted(False, seen, np.nan, np.nan)
    at = [STRUCTURE.member_named(change.member).point(change.distance) for change in found]
    orders = itertools.permutations(range(len(placed)))
    off, best = min((max(float(np.linalg.norm(at[i] - point(placed[k]))) for i, k in enumerate(o)), o) for o in orders)
    return Counted(True, seen, off, max(abs(found[i].mass / placed[k].mass - 1) for i, k in enumerate(best)))


def main() -> int:
    """Print the table."""
    cases = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    print(f"seed {SEED}\n\n{HEAD}")
    with Pool() as pool:
        for name, number in itertools.product(NOISES, NUMBERS):
            found = pool.map(one, [(name, number, case) for case in range(cases)], chunksize=2)
            print(row(f"{number} mass{'es' * (number > 1)}, {LINES[name].label}", found))
            print(row("– each mass is detectable", [f for f in found if f.seen]), flush=True)
    return 0


def row(label: str, found: list[Counted]) -> str:
    """Return a line of the table."""
    off = 1000 * np.array([f.off for f in found if f.right])
    error = 100 * np.array([f.mass_error for f in found if f.right])
    cells = [share([f.right for f in found]), f"{np.median(off):.1f}", f"{np.percentile(off, 90):.0f}"]
    return " | ".join([f"| {label}", str(len(found)), *cells, f"{np.median(error):.1f}"]) + " |"


if __name__ == "__main__":
    sys.exit(main())
