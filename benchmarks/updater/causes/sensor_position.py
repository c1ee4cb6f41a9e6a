"""Sensors at another place than stated: verdicts, errors and coverage by the size of the shift.

Each draw is a fresh T-frame (tests/examiner, finite elements of their own, modes with noise by the law of
identification, every device 2 mm off its place and turned by one degree, gains off by half a per cent). One device is
moved along its bar, with its mass. With `--file` the structure file is the only knowledge. Prints the table of the
documentation.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/updater/causes/sensor_position.py [--draws N] [--seed S] [--file]
or make bench-position
"""

import argparse
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tests.examiner.cases import Case
from tests.examiner.models.specimen import draw_state
from tests.examiner.path import answer
from tests.examiner.score import score
from tests.examiner.sensor_chain import moved
from tests.examiner.structure_file import draw_as_filed

SHIFTS = (0.02, 0.04, 0.08, 0.12, 0.2)  # m
_HELD = 1.96  # standard deviations: 95 %
_OUTCOMES = ("right", "alias", "wrong", "misplaced", "refused", "missed")


def drawn(shift: float, seed: int, *, file: bool) -> Case:
    """Draw a frame with one device moved by a distance [m], in either direction that its bar has room for."""
    print(f"shift {shift:g} m, seed {seed}", flush=True)
    random, state = np.random.default_rng((seed, 5)), draw_as_filed(seed) if file else draw_state(seed)
    rooms = [
        (s.device, way * shift)
        for s in {s.device: s for s in state.sensors}.values()
        for way in (1.0, -1.0)
        if 0 <= s.s + way * shift <= state.frame.bar(s.bar).length
    ]
    done = moved(state, *rooms[int(random.integers(len(rooms)))])
    cell = "file: sensor_position" if file else "sensor_position"
    return Case(cell=cell, kind="detectable", seed=seed, done=done)


@dataclass
class Tally:
    """Counts of one size."""

    outcomes: list[str] = field(default_factory=list)
    error: list[float] = field(default_factory=list)  #: of the shift, where it is named [m]
    over_std: list[float] = field(default_factory=list)

    def count(self, case: Case, found: dict[str, Any]) -> None:
        """Add one answer."""
        judged = score(found, case.done.hidden, case.kind, near=case.near)
        self.outcomes.append(judged.outcome)
        if judged.outcome != "right":
            print(f"{case.seed}: {judged.outcome}: {judged.reported} (was {case.done.hidden[0]})", flush=True)
        if "shift" in judged.errors:
            std = found["causes"][0]["parameters"]["shift"]["std"]
            self.error.append(abs(judged.errors["shift"]))
            self.over_std.append(abs(judged.errors["shift"]) / std)

    @property
    def row(self) -> str:
        """Cells of the table."""
        counts = " | ".join(str(self.outcomes.count(o) or "") for o in _OUTCOMES)
        if not self.error:
            return f"{len(self.outcomes)} | {counts} | | | "
        within = sum(x < _HELD for x in self.over_std)
        median, most = 1e3 * np.median(self.error), 1e3 * np.quantile(self.error, 0.9)
        return f"{len(self.outcomes)} | {counts} | {median:.2g} mm | {most:.2g} mm | {within} of {len(self.over_std)}"


def main() -> None:
    """Draw, diagnose, count and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=20, help="of each size")
    parser.add_argument("--seed", type=int, default=4_700_000)
    parser.add_argument("--file", action="store_true", help="without reference logs")
    given = parser.parse_args()
    rows = []
    for number, shift in enumerate(SHIFTS):
        tally = Tally()
        for draw in range(given.draws):
            case = drawn(shift, given.seed + 1000 * number + draw, file=given.file)
            tally.count(case, answer(case))
        rows.append(f"| {100 * shift:g} cm | {tally.row} |")
        print(rows[-1], flush=True)
    print(f"\n| shift | draws | {' | '.join(_OUTCOMES)} | off by, median | 9 of 10 within | in the 95 % interval |")
    print("|---:" * (5 + len(_OUTCOMES)) + "|")
    print("\n".join(rows))


if __name__ == "__main__":
    main()
