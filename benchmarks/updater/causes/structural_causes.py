"""Accuracy of places and sizes of stretches, props and axial forces, and coverage of their deviations and regions.

The cases are those of the confusion matrix (tests/examiner, independent finite elements), with further questions: is
the truth in the 95 % region, and within two deviations of the estimate? Prints the table of the documentation.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/updater/causes/structural_causes.py [--draws N] [--seed S]
or make bench-structural
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.updater.confusion.by_cause import print_rows
from tests.examiner.draws import Hidden

CELLS = ("local_stiffness", "distributed_mass", "support_spring", "axial_force")
_MARGIN = 0.0025  # m: regions are of cells of 5 mm


@dataclass
class Tally:
    """Counts of one cause."""

    draws: int = 0
    named: int = 0
    away: list[float] = field(default_factory=list)  #: [m]
    inside: list[bool] = field(default_factory=list)  #: the region
    error: dict[str, list[float]] = field(default_factory=dict)  #: relative
    within: dict[str, list[bool]] = field(default_factory=dict)  #: two deviations

    def count(self, found: dict[str, Any], hidden: Hidden) -> None:
        """Add one answer."""
        self.draws += 1
        own = [c for c in found["causes"] if c["cause"] == hidden.cause]
        if len(found["causes"]) != 1 or not own or hidden.position is None:
            return
        self.named += 1
        where = own[0]["where"]
        self.away.append(float(np.linalg.norm(np.subtract(where["position"], hidden.position))))
        self.inside.append(any(_between(hidden.position, *ends) for ends in where["region"]))
        for name, true in hidden.parameters.items():
            label = own[0]["parameters"].get(name)
            if label:
                self.error.setdefault(name, []).append(abs(label["value"] / true - 1))
                self.within.setdefault(name, []).append(abs(label["value"] - true) < 2 * label["std"])

    def cells(self, name: str) -> Iterator[str]:
        """Return them as cells of a table."""
        yield name
        yield f"{self.named} of {self.draws}"
        placed = name != "axial_force"  # all of the member
        yield f"{1e3 * np.median(self.away):.0f} / {1e3 * np.quantile(self.away, 0.9):.0f} mm" if placed else ""
        yield f"{100 * np.mean(self.inside):.0f} %" if placed else ""
        sizes = [(k, 100 * np.median(self.error[k]), 100 * np.mean(self.within[k])) for k in self.error]
        yield "; ".join(f"{key.replace('_', ' ')} {off:.1f} % ({within:.0f} %)" for key, off, within in sizes)


def _between(point: Any, start: Any, end: Any) -> bool:
    """Return whether a point is on a line, within half a cell."""
    along = np.subtract(end, start)
    share = np.clip(np.subtract(point, start) @ along / max(along @ along, 1e-12), 0, 1)
    return bool(np.linalg.norm(np.asarray(start) + share * along - point) <= _MARGIN)


HEAD = (
    "| cause | named alone | place off, median / 90 % | in its 95 % region | off, median (within two deviations) |\n"
    "| --- | ---: | ---: | ---: | --- |"
)

if __name__ == "__main__":
    print_rows(__doc__, CELLS, Tally, head=HEAD, seed=700_000)
