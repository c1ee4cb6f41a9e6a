"""Accuracy with reference models: as in the file, one-step updated, calibrated by sensitivities, or both.

One body of 4 % of the mass at random places of ten frames that differ from the reference in kind, located by the
likelihood from the same data with each of the four references. Prints a table of the documentation.

Usage: python benchmarks/updater/paper/reference.py [PLACES A FRAME], or make bench-paper
"""

import sys
from dataclasses import replace

import numpy as np
from scipy.stats import beta

from daq import FloatArray
from tests.support.updater.frames import t_frame, unmoved
from tests.support.updater.one_step import N_EVENT, Rig
from updater import Body, MassChange, Reference, locate_mass, stack_tracks
from updater.reference import best_model, first_stage, pair_baseline
from updater.structure import with_springs

SEEDS = range(3, 13)
SHARE = 0.04  # of the structure's mass
NOISE = 2.0  # over the helper's: 0.2 % at 10 Hz, 0.1 % at 40 Hz, and 2 % of a shape's rms component


def references(rig: Rig) -> dict[str, Reference]:
    """Return the four references that one baseline teaches."""
    both = rig.relearnt(rig.windows(rig.bare, 8, 1, NOISE))
    structure = with_springs(t_frame())
    model = best_model(structure)
    modes = model.modes(len(both.frequency))
    paired = pair_baseline(model, modes, both.baseline)
    raw = replace(both.calibration, structure=structure, model=model, modes=modes, paired=paired)
    found = {}
    for label, calibration in (("as in the file", raw), ("calibrated by sensitivities", both.calibration)):
        shape = calibration.modes.shape.copy()
        seen = both.rows(calibration.model) @ shape[:, calibration.paired]
        shape[:, calibration.paired] *= np.sign((seen * both.baseline.shape.T).sum(0))  # as the measured ones point
        plain = replace(both, calibration=calibration, frequency=calibration.modes.frequency, shape=shape)
        updated = first_stage(calibration.model, calibration.modes, calibration.paired, both.baseline)
        found[label] = plain
        found[f"{label}, one-step updated"] = replace(plain, frequency=updated.frequency, shape=updated.shape)
    return found


def judge(answer: MassChange, member: str, distance: float, kilograms: float) -> tuple[float, float, bool]:
    """Return how far off place [m] and mass [-] are, and whether the region holds the place."""
    structure = t_frame()
    place = structure.member_named(member).point(distance)
    away = float(np.linalg.norm(structure.member_named(answer.member).point(answer.distance) - place))
    held = any(s.member == member and s.start <= distance <= s.stop for s in answer.region)
    return away, abs(answer.mass / kilograms - 1), held


def places(random: np.random.Generator, n: int) -> list[tuple[str, float]]:
    """Return members and distances [m], every metre alike; the foot's 0.2 m, where a mass hardly moves, left out."""
    found = []
    for along in random.uniform(0.2, 2.28, n):
        found.append(("column", float(along)) if along < 1.48 else ("crossbeam", float(along) - 1.48))
    return found


def main() -> int:
    """Print the table."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    stated: dict[str, list[tuple[float, float, bool]]] = {}
    for seed in SEEDS:
        rig = Rig(seed)
        learnt = references(rig)
        kilograms = SHARE * rig.truth.model().total_mass()
        for i, (member, distance) in enumerate(places(np.random.default_rng(seed), n)):
            at = tuple(t_frame().member_named(member).point(distance).tolist())
            modes = rig.truth.model(Body(at=at, mass=kilograms)).modes(8)
            windows = stack_tracks(rig.windows(modes, N_EVENT, 100 + i, NOISE), unmoved(N_EVENT))
            for label, reference in learnt.items():
                answer = locate_mass(reference, reference.mean_of(windows))
                stated.setdefault(label, []).append(judge(answer, member, distance, kilograms))
    print(
        print(
            "| reference | position error, median | 90 % within | mass error, median "
            "| position in 95 % region | 95 % interval |"
        )
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for label, answers in stated.items():
        print(line(label, np.array(answers)))
    return 0


def line(label: str, answers: FloatArray) -> str:
    """Return the table's line of one reference, with Clopper and Pearson's interval of the coverage."""
    away, mass, held = answers.T
    k, n = int(held.sum()), len(held)
    low, high = beta.ppf(0.025, k, n - k + 1), beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
    cells = [
        f"{1000 * np.median(away):.1f} mm",
        f"{1000 * np.quantile(away, 0.9):.0f} mm",
        f"{100 * np.median(mass):.1f} %",
    ]
    return f"| {label} | " + " | ".join([*cells, f"{k} of {n}", f"{100 * low:.0f} to {100 * high:.0f} %"]) + " |"


if __name__ == "__main__":
    sys.exit(main())
