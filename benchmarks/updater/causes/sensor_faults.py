"""Accuracy of the causes and sizes of faults of the measuring chain, and coverage of their deviations.

The cases are those of the confusion matrix (tests/examiner, finite elements of their own, modes with noise by the
law of identification), each on a fresh rig with gains off by half a per cent and clocks by 20 us. Prints the table of
the documentation.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/updater/causes/sensor_faults.py [--draws N] [--seed S]
or make bench-sensors
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.updater.confusion.by_cause import print_rows
from tests.examiner.draws import Hidden

#: cell -> the parameter that is scored, its unit in the table, and how many of those the contract's unit is
CELLS: dict[str, tuple[str, str, float] | None] = {
    "sensor_gain": ("gain", "%", 100.0),
    "sensor_polarity": None,
    "sensor_swap": None,
    "sensor_orientation": ("angle", "degrees", float(np.degrees(1))),
    "sensor_position": ("shift", "mm", 1e3),
    "exchanged_devices": None,
    "turned_device": ("angle", "degrees", float(np.degrees(1))),
    "cable_mass": ("mass", "g", 1e3),
    "sensor_delay": ("delay", "us", 1e6),
    "sensor_dead": None,
}


@dataclass
class Tally:
    """Counts of one cause."""

    draws: int = 0
    named: int = 0
    ambiguous: int = 0
    error: list[float] = field(default_factory=list)  #: in the contract's unit
    over_std: list[float] = field(default_factory=list)

    def count(self, found: dict[str, Any], hidden: Hidden) -> None:
        """Add one answer."""
        self.draws += 1
        own = [c for c in found["causes"] if c["cause"] == hidden.cause]
        if len(found["causes"]) != 1 or not own or not set(own[0]["where"]["channels"]) <= set(hidden.channels):
            return
        self.named += 1
        self.ambiguous += found["verdict"] == "ambiguous"
        for name, true in hidden.parameters.items():
            label = own[0]["parameters"].get(name)
            if label:
                self.error.append(abs(label["value"] - true))
                self.over_std.append(abs(label["value"] - true) / label["std"])

    def cells(self, name: str) -> Iterator[str]:
        """Return them as cells of a table."""
        yield f"`{name}`"
        yield f"{self.named} of {self.draws}"
        yield str(self.ambiguous)
        scored = CELLS[name]
        if scored is None or not self.error:
            yield from ("", "", "")
            return
        _, unit, factor = scored
        yield f"{factor * np.median(self.error):.2g} {unit}"
        yield f"{factor * np.quantile(self.error, 0.9):.2g} {unit}"
        yield f"{100 * np.mean(np.array(self.over_std) < 2):.0f} %"


HEAD = (
    "| cause | named | of these ambiguous | off by, median | 9 of 10 within | within two deviations |\n"
    "| --- | ---: | ---: | ---: | ---: | ---: |"
)

if __name__ == "__main__":
    print_rows(__doc__, CELLS, Tally, head=HEAD, seed=9_000)
