"""Channels with faults: the modes found nevertheless, and the coverage of stated standard deviations.

Prints the table of the documentation.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/oma/faults.py [WINDOWS], or make bench-oma-faults
"""

import sys
from dataclasses import dataclass, field, replace

import numpy as np

from oma import Identification, identify_all
from tests.support.oma.scenes import FAULTS, SCENES, faulty, pairs

SCENE = SCENES["clean"]


@dataclass
class Tally:
    """Errors in standard deviations, and the messages."""

    frequency: list[float] = field(default_factory=list)
    damping: list[float] = field(default_factory=list)
    shape: list[float] = field(default_factory=list)
    complete: int = 0
    label: set[str] = field(default_factory=set)

    def add(self, found: Identification) -> None:
        """Compare with the truth on the channels that are left."""
        estimate, truth = found.estimate, SCENE.structure
        kept = [truth.channels.index(name) for name in estimate.channels]
        shapes = truth.shapes[:, kept] / np.linalg.norm(truth.shapes[:, kept], axis=1, keepdims=True)
        couples = pairs(estimate.frequency, estimate.shape, replace(truth, shapes=shapes))
        self.complete += len(couples) == estimate.n_modes == len(shapes)
        self.label |= {f"{name}: {state.split(':')[0]}" for name, state in found.channels.items() if state != "ok"}
        for i, j in couples:
            self.frequency.append((estimate.frequency[i] - truth.frequency[j]) / estimate.frequency_std[i])
            self.damping.append((estimate.damping[i] - truth.damping[j]) / estimate.damping_std[i])
            off = estimate.shape[i].real - shapes[j] * np.sign(estimate.shape[i].real @ shapes[j])
            self.shape.extend((off / estimate.shape_std[i]).tolist())


def main() -> int:
    """Print the table."""
    n_windows = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    print(
        f"{n_windows} windows of 300 s a line, seeds 200 to {199 + n_windows}; errors within two standard deviations\n"
    )
    print("| fault | all 8, none false | f | ζ | shape | mean error of f, of ζ [std] | flagged |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | --- |")
    for fault, text in FAULTS.items():
        tally = Tally()
        for seed in range(200, 200 + n_windows):
            tally.add(identify_all(faulty(SCENE.record(seed), fault, seed)))
        covered = " | ".join(f"{np.mean(np.abs(z) < 2):.1%}" for z in (tally.frequency, tally.damping, tally.shape))
        bias = f"{np.mean(tally.frequency):+.2f}, {np.mean(tally.damping):+.2f}"
        label = "those: gaps" if len(tally.label) > 2 else ", ".join(sorted(tally.label))
        print(f"| {text} | {tally.complete / n_windows:.0%} | {covered} | {bias} | {label} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
