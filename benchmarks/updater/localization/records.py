"""Accuracy of position and mass of one added mass from accelerations: simulated, logged, read, identified, located.

Ten true frames (10 mm Timoshenko elements, flexible foot and joint, E and density off, gains, damping and forces of
their own, sensor noise, quantization) teach references by eight windows each; one window shows each of the bodies.
Prints a table of the documentation. The bound is that of places.py, with frequency noise by the uncertainty law and
the deviations of shapes that identification stated.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/updater/localization/records.py [PLACES] [SECONDS ...], or make
localization-records
"""

import sys
import tempfile
from dataclasses import dataclass, replace
from multiprocessing import Pool
from pathlib import Path

import numpy as np

from benchmarks.common.random_bodies import HEAD, TOTAL, Judged, Limit, draw, judge, row
from daq import FloatArray, IndexArray, Recording, load_recordings, write_recording
from monitor.analysis.observation import Observation, observe
from oma import identify
from oma.selection import uncertainty_law
from tests.measured.accelerometers import Rig
from updater import Reference, learn_reference, locate_mass, matched, parse_structure, stack_tracks, t_structure_toml
from updater.errors import UpdaterError
from updater.modal_data import ModalMean

FRAMES, N_BASELINE, SEED = 10, 8, 50000
SHARES = (0.005, 0.01, 0.02, 0.04)
STRUCTURE = parse_structure(t_structure_toml())


@dataclass(frozen=True, eq=False)
class Watched:
    """A true frame with its learned baseline."""

    rig: Rig
    limit: Limit
    reference: Reference

    def least(self, event: ModalMean, seconds: float) -> tuple[FloatArray, FloatArray]:
        """Return the noise of log frequencies and shapes (n_modes,), as if the baseline were as noisy as the event."""
        law = [
            uncertainty_law(float(np.exp(f)), float(z), seconds)[0] / np.exp(f)
            for f, z in zip(event.log_frequency, event.damping, strict=True)
        ]
        both = np.sqrt((1 + 1 / N_BASELINE) / 2)
        return both * np.array(law), both * np.sqrt((event.shape_std**2).mean(1))


def read_back(recording: Recording, seconds: float) -> list[Recording]:
    """Write a log, and read its windows."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.mcap"
        write_recording(log, recording)
        return list(load_recordings(log, window_seconds=seconds))


def watched(frame: int, seconds: float) -> Watched:
    """Learn a frame's reference."""
    rig = Rig(seed=SEED + frame)
    windows = read_back(rig.record(0, N_BASELINE * seconds), seconds)
    baseline: Observation = observe(windows)
    reference = learn_reference(STRUCTURE, baseline.estimates, baseline.tracks)
    return Watched(rig, Limit(rig.structure()), reference)


def judged(here: Watched, number: int, seconds: float) -> Judged | None:
    """Add a body at a random position, measure one window, locate; None without an answer."""
    random = np.random.default_rng((here.rig.seed, number))
    placed = draw(STRUCTURE, SHARES[number % len(SHARES)] * TOTAL, random)
    (window,) = read_back(replace(here.rig, body=(placed.body,)).record(number + 1, seconds), seconds)
    estimate = identify(window)
    modes: IndexArray = np.arange(estimate.n_modes)
    event = matched(here.reference.baseline, here.reference.mean_of(stack_tracks([estimate], [modes])))
    try:
        found = locate_mass(here.reference, event)
    except UpdaterError:
        return None
    seen = np.flatnonzero(np.isfinite(event.log_frequency))
    return judge(found, placed, here.limit.only(here.reference.paired[seen]), *here.least(event.only(seen), seconds))


def of_frame(task: tuple[int, int, float]) -> list[Judged | None]:
    """Judge all places of one frame; runs in a process of its own."""
    frame, places, seconds = task
    here = watched(frame, seconds)
    return [judged(here, number, seconds) for number in range(places)]


def main() -> int:
    """Print the table."""
    places = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    print(f"seed {SEED}, {FRAMES} frames\n\n{HEAD}")
    with Pool() as pool:
        for seconds in map(float, sys.argv[2:] or ("60", "120", "600")):
            tasks = [(frame, places // FRAMES, seconds) for frame in range(FRAMES)]
            found = [j for judgements in pool.map(of_frame, tasks, chunksize=1) for j in judgements]
            stated = [j for j in found if j]
            print(row(f"records of {seconds:.0f} s ({len(found) - len(stated)} not answered)", stated), flush=True)
            for share in SHARES:
                these = [j for j in stated if np.isclose(j.share, share)]
                print(row(f"of these {100 * share:g} % of the mass", these), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
