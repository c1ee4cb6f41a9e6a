"""Diagnosis of records within which the structure changed: causes, sizes, rates and times against the truth.

    python benchmarks/updater/causes/record_course.py [--draws 10] [--seed 0]

The frames are those of the confusion matrix, by an independent finite element code. A body grows on a member, or the
springs of the foot loosen: gradually, saturating, or at once, within 24 windows.
"""

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from daq import FloatArray
from monitor.analysis.explanation import explain
from monitor.analysis.states.record_course import explain_record
from monitor.results.comparison import DiagnosisAnswer, WithinRecord
from tests.examiner.draws import log_uniform, somewhere, with_lump
from tests.examiner.models.bar import vector
from tests.examiner.models.frame import Lump
from tests.examiner.models.specimen import Random, State, draw_state
from tests.examiner.path import FRAME, observation
from tests.examiner.signals import estimated

N_BEFORE, N_WINDOWS = 8, 24
COURSES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "gradual": lambda u: u,
    "saturating": lambda u: 1 - np.exp(-4 * u),
    "sudden": lambda u: (u > 0.6).astype(float),
    "none": np.zeros_like,
}


def bodies(state: State, share: FloatArray, random: Random) -> tuple[list[State], float]:
    """Return the states in which a body of 50 to 500 g has grown to shares (n_windows,), and its final mass [kg]."""
    bar, s = somewhere(state, random, lowest=0.3)
    mass = log_uniform(random, 0.05, 0.5)
    return [with_lump(state, Lump(bar=bar, s=s, mass=mass * u)) if u > 0 else state for u in share], mass


def foot(state: State, share: FloatArray, random: Random) -> tuple[list[State], float]:
    """Return the states in which the foot's springs are loosened by shares (n_windows,) of 40 to 80 %, and the loss."""
    (ground,) = state.frame.grounds
    loss = random.uniform(0.4, 0.8)

    def loosened(u: float) -> State:
        about = vector(np.multiply(ground.about, 1 - loss * u))
        return state.of_frame(replace(state.frame, grounds=(replace(ground, about=about),)))

    return [loosened(float(u)) for u in share], loss


CHANGES = {"added_mass": bodies, "support_stiffness": foot}


def answer(cause: str, course: str, seed: int) -> tuple[DiagnosisAnswer, float]:
    """Return the answer on one record, and the final size of its change."""
    random, state = np.random.default_rng((seed, 78)), draw_state(seed)
    share = COURSES[course]((np.arange(N_WINDOWS) + 0.5) / N_WINDOWS)
    states, size = CHANGES[cause](state, share, random)
    before = observation(state, estimated(state, N_BEFORE, random, noise="law"))
    windows = [estimated(one, 1, random, first=w, noise="law")[0] for w, one in enumerate(states)]
    now = observation(states[-1], windows, [one.loudness for one in states])
    return explain_record(explain, FRAME, before, now).diagnosis, size


def true_rate(size: float, within: WithinRecord) -> float:
    """Return the rate per hour of a change that reaches a size in all windows of a record."""
    window = (within.course[-1].time - within.course[0].time) * 1e-9 / 3600 / (N_WINDOWS - 1)
    return size / (N_WINDOWS * window)


def rates_text(rates: list[tuple[float, float, float]]) -> str:
    """Return the mean ratio of found rates to true ones, and how many are within two stated deviations."""
    if not rates:
        return "- | -"
    found, std, true = np.transpose(rates)
    ratio, inside = found / true, np.abs(found - true) < 2 * std
    return f"{ratio.mean():.3f} ± {ratio.std(ddof=1) / len(ratio) ** 0.5:.3f} | {inside.sum()} of {len(rates)}"


def main() -> int:
    """Print a row per cause and course."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=10, help="of each row")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    print(
        "| change | course | course found | end state named | wrong | change within named | wrong "
        "| rate over true | within two deviations | CPU s |"
    )
    print("| --- | --- |" + " ---: |" * 8)
    for cause in CHANGES:
        for course in COURSES:
            found, rates, started = np.zeros(5, int), [], time.process_time()
            for draw in range(given.draws):
                answered, size = answer(cause, course, given.seed + draw)
                within = answered.within_record
                wanted = {"saturating": "gradual", "none": None}.get(course, course)
                found[0] += (within.kind if within else None) == wanted
                for k, causes in ((1, answered.causes), (3, within.causes if within else ())):
                    if causes:
                        found[k + (causes[0].cause != cause)] += 1
                if cause == "added_mass" and course == "gradual" and within:
                    rates += [(r.per_hour, r.std, true_rate(size, within)) for r in within.rates if r.cause == cause]
            each = (time.process_time() - started) / given.draws
            counts = " | ".join(f"{n} of {given.draws}" for n in found)
            print(f"| {cause} | {course} | {counts} | {rates_text(rates)} | {each:.1f} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
