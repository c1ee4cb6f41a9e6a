"""Unattended selection on simulated windows, compared with pyOMA2's: all modes found, and no false ones.

Prints the documented table. pyOMA2's `hier_avg` is the best of its selections; it runs on the first windows only,
in a child process with one BLAS thread as ours.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/oma/selection.py [WINDOWS [THEIRS]]; make bench-oma-selection
"""

import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.common.peers import measured, peer_python
from daq import FloatArray
from oma import IdentificationError, identify_all
from tests.support.oma.scenes import RATE, SCENES, Scene, pairs

_NEAR_TONE = 2e-3  # relative frequency difference


@dataclass
class Score:
    """Results of a selection on the windows of one scene."""

    complete: list[bool] = field(default_factory=list)
    found: list[int] = field(default_factory=list)
    false: list[int] = field(default_factory=list)
    named: list[bool] = field(default_factory=list)
    cpu: float = 0.0

    def add(self, scene: Scene, frequency: FloatArray, shape: FloatArray) -> None:
        """Count the modes of one window."""
        n_right, n_true = len(pairs(frequency, shape, scene.structure)), len(scene.structure.frequency)
        self.found.append(n_right)
        self.false.append(len(frequency) - n_right)
        self.complete.append(n_right == n_true == len(frequency))

    @property
    def row(self) -> str:
        """Cells of the table."""
        cells = f"{np.mean(self.complete):.0%} | {np.mean(self.found):.2f} / {np.mean(self.false):.2f}"
        return f"{cells} | {self.cpu / len(self.found):.2f}"


def ours(scene: Scene, n_windows: int) -> Score:
    """Run our selection."""
    score = Score()
    for seed in range(n_windows):
        recording = scene.record(seed)
        began = time.process_time()
        try:
            result = identify_all(recording)
        except IdentificationError as error:
            print(f"seed {seed}: {error}", file=sys.stderr)
            score.add(scene, np.empty(0), np.empty((0, len(recording.channels))))
            continue
        score.cpu += time.process_time() - began
        score.add(scene, result.estimate.frequency, result.estimate.shape.real)
        if scene.tone:
            off = np.abs(result.harmonics / scene.tone.frequency - 1)
            score.named.append(bool(len(off)) and bool(np.all(off < _NEAR_TONE)))
    return score


def theirs(scene: Scene, n_windows: int) -> Score:
    """Run pyOMA2's."""
    score = Score()
    with tempfile.TemporaryDirectory() as folder:
        files = [str(Path(folder) / f"{seed}.npy") for seed in range(n_windows)]
        for seed, file in enumerate(files):
            np.save(file, scene.record(seed).data)
        child = Path(__file__).with_name("pyoma2_hier_avg.py")
        done = measured(peer_python(), child, "hier_avg", 1, files=files, rate=RATE)
    score.cpu = done["cpu"]
    for frequency, shape in done["result"]:
        score.add(scene, np.array(frequency), np.array(shape).reshape(len(frequency), -1))
    return score


def main() -> int:
    """Print the table."""
    n_ours = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    n_theirs = int(sys.argv[2]) if len(sys.argv) > 2 else 20
    print(f"{n_ours} windows a line (seeds 0 to {n_ours - 1}), of which pyOMA2 had the first {n_theirs}\n")
    columns = "all 8, none false | found / false | CPU s"
    print(f"| window | {columns} | tone named | hier_avg: {columns} |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for scene in SCENES.values():
        mine = ours(scene, n_ours)
        named = f"{np.mean(mine.named):.0%}" if mine.named else ""
        other = theirs(scene, n_theirs).row if n_theirs else ""
        print(f"| {scene.label} | {mine.row} | {named} | {other} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
