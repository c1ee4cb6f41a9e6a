"""One added mass and the same modes for every method: the paper's increments, its alternative, and methods of others.

The cases are those of localization.py. Prints a table of the documentation.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/updater/other_methods.py [PLACES] [LINE], or make bench-rivals
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing import Pool

import numpy as np
from scipy.optimize import minimize, nnls

from benchmarks.updater.localization.modes import LINES, SEED, STRUCTURE, Case, case
from daq import FloatArray
from updater import MassUpdater, Reference, locate_mass
from updater.inference import Comparison, compare, no_effect, picked, predict, reanalyse
from updater.localization import spread_mass
from updater.modal_data import ModalMean


@dataclass(frozen=True, eq=False)
class Answer:
    """Position and mass."""

    point: FloatArray  # (3,) [m]
    mass: float  # [kg]


Method = Callable[[Reference, ModalMean], Answer]


def ours(reference: Reference, event: ModalMean) -> Answer:
    """Likelihood over positions."""
    found = locate_mass(reference, event)
    return Answer(STRUCTURE.member_named(found.member).point(found.distance), found.mass)


def increments(reference: Reference, event: ModalMean) -> Answer:
    """Highest normalised increment (eq. 14), and the total in its direction."""
    update = MassUpdater(reference).update(event)
    size = np.abs(np.nan_to_num(update.normalised))
    node, direction = np.unravel_index(np.argmax(size), size.shape)
    return Answer(reference.model.nodes[node], float(update.totals[direction]))


def sensitivity(reference: Reference, event: ModalMean) -> Answer:
    """Masses at all nodes by the iterative sensitivity method: the largest, and their sum."""
    found = spread_mass(reference, event)
    return Answer(reference.model.nodes[found.node[np.argmax(found.mass)]], float(found.mass.sum()))


def non_negative(reference: Reference, event: ModalMean) -> Answer:
    """Non-negative masses at all nodes that fit the frequencies to first order: the largest, and their sum."""
    data, model = compare(reference, event), reference.model
    padded = np.vstack([reference.shape, np.zeros(reference.shape.shape[1])])
    moved = (padded[model.dofs[:, :3]] ** 2).sum(1)[:, data.paired]  # (n_nodes, n)
    std = np.sqrt(event.log_frequency_std**2 + reference.baseline.log_frequency_std**2)[data.tracks]
    mass, _ = nnls(-0.5 * moved.T / std[:, None], data.log_ratio / std)
    return Answer(model.nodes[np.argmax(mass)], float(mass.sum()))


def misfit(reference: Reference, event: ModalMean) -> Answer:
    """Least |(f_model - f) / f_model|^2 + 1 / |MAC|^2, as INTO-CPS's example-shm has it, from each member's middle."""
    data = compare(reference, event)
    total, best = reference.model.total_mass(), None
    for member in reference.structure.member:

        def cost(x: FloatArray, start: FloatArray, along: FloatArray) -> float:
            return _misfit(reference, data, start + x[0] * along, x[1] * total)

        ends = np.array(member.start), np.subtract(member.end, member.start)
        found = minimize(cost, [0.5, 0.01], args=ends, method="L-BFGS-B", bounds=[(0.0, 1.0), (-0.1, 0.2)])
        if best is None or found.fun < best[0]:
            best = found.fun, Answer(ends[0] + found.x[0] * ends[1], float(found.x[1] * total))
    assert best is not None
    return best[1]


def _misfit(reference: Reference, data: Comparison, point: FloatArray, mass: float) -> float:
    moved = reference.model.read(point)[:3] @ reference.shape
    effect = replace(no_effect(1, data), mass=mass * (moved.T @ moved)[None])
    predicted = predict(data, *picked(reanalyse(data, effect)), effect)
    relative, shape = 1 - np.exp(data.log_ratio - predicted.log_ratio[0]), predicted.shape[0]
    assurance = (shape * data.shape).sum(1) ** 2 / (shape**2).sum(1)
    return float(relative @ relative + 1 / (assurance @ assurance))


METHODS: dict[str, Method] = {
    "likelihood over positions": ours,
    "normalised increments of the paper, peak and total": increments,
    "iterative sensitivity method, a mass at every node": sensitivity,
    "non-negative least squares of frequencies": non_negative,
    "objective of INTO-CPS example-shm": misfit,
}


def one(task: tuple[str, int]) -> FloatArray:
    """Return errors of place [m] and mass [-] (n_methods, 2) in one case; runs in a process of its own."""
    given: Case = case(LINES[task[0]], task[1])
    truth = given.placed.member.point(given.placed.distance)
    answers = [method(given.reference, given.event) for method in METHODS.values()]
    return np.array([(np.linalg.norm(a.point - truth), abs(a.mass / given.placed.mass - 1)) for a in answers])


def main() -> int:
    """Print the table."""
    places = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    name = sys.argv[2] if len(sys.argv) > 2 else "0.1/2"
    with Pool() as pool:
        errors = np.array(pool.map(one, [(name, number) for number in range(places)], chunksize=5))
    print(f"seed {SEED}, {places} places, 0.5 to 4 % of the mass, {LINES[name].label}\n")
    print("| method | off, median [mm] | 90 % [mm] | mass off, median [%] | 90 % [%] |\n| --- |" + " ---: |" * 4)
    for k, method in enumerate(METHODS):
        off, mass = 1000 * errors[:, k, 0], 100 * errors[:, k, 1]
        cells = [np.median(off), np.percentile(off, 90), np.median(mass), np.percentile(mass, 90)]
        print(" | ".join([f"| {method}", *(f"{cell:.0f}" for cell in cells)]) + " |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
