"""Modes of simulated impact tests, compared with sdypy-EMA: modes found, errors, deviations, CPU time.

Every scene is a time-domain simulation (`tests.support.oma.impact_test`). Ours choose their modes themselves. sdypy-EMA
(LSCF of all responses at once, order 40) is given the true frequencies: of a mode it has the median of the poles within
0.5 % in the upper half of the orders, if a third of them have one. The decay of the exponential window is subtracted
for it. It runs in a child process with one BLAS thread, as ours, and not with THEIRS = 0.
A second row per scene has lines and responses weighed by their coherences.

Usage: python benchmarks/oma/impact_tests.py [TESTS [THEIRS]], or make bench-oma-impact
"""

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.peers import measured, peer_python
from daq import FloatArray
from oma import identify_responses_all
from tests.support.oma.impact_test import CHANNELS, DISTURBED, REFERENCES, SCENES, ImpactTest, tower

BAND = (2.0, 75.0)
ORDER = 40
FORCES = tuple(CHANNELS[k] for k in REFERENCES)
NEAR = 5e-3  # relative: a mode is found
Work = tuple[Callable[[], Any], Callable[[Any], Any]]


def sdypy_poles(files: list[str], truth: list[float], decay: float) -> Work:
    """Return frequencies and damping ratios of sdypy-EMA near the true ones, per file; NaN where there are none."""
    import warnings

    from sdypy import EMA  # type: ignore[import-not-found]

    def near(model: Any, frequency: float) -> tuple[float, float]:
        found = []
        for order in model.all_poles[ORDER // 2 :]:
            poles = order[order.imag > 0] + decay
            size = np.abs(poles) / (2 * np.pi)
            if len(poles) and np.abs(size / frequency - 1).min() < NEAR:
                best = poles[np.abs(size / frequency - 1).argmin()]
                found.append((abs(best) / (2 * np.pi), -best.real / abs(best)))
        enough = len(found) >= ORDER / 2 / 3
        return tuple(np.median(found, axis=0).tolist()) if enough else (np.nan, np.nan)

    def work() -> list[Any]:
        result = []
        for file in files:
            data = np.load(file)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                model = EMA.Model(data[1:], data[0].real, lower=BAND[0], upper=BAND[1], pol_order_high=ORDER)
                model.get_poles(show_progress=False)
            result.append([near(model, frequency) for frequency in truth])
        return result

    return work, lambda outcome: outcome


def ours(test: ImpactTest, n_tests: int, folder: Path, *, weighted: bool) -> tuple[str, list[str]]:
    """Return the row of our results, with coherences as weights or not, and the files of the tests."""
    structure, files, cpu = tower(), [], 0.0
    counts, errors, ratios = [], [], []
    masses = 1 / np.sum(structure.shape**2, axis=1)
    for seed in range(n_tests):
        line, response, coherence = test.h1_with_coherence(structure, seed)
        flat = response.reshape(len(line), -1).T
        files.append(str(folder / f"{seed}.npy"))
        np.save(files[-1], np.concatenate([line[None], flat]))
        began = time.process_time()
        known = coherence if weighted else None
        found = identify_responses_all(line, response, CHANNELS, FORCES, BAND, test.decay, known)
        cpu += time.process_time() - began
        estimate = found.estimate
        near = np.abs(np.log(estimate.frequency[:, None] / structure.frequency))
        place = near.argmin(axis=0)
        counts.append((int(np.sum(near.min(axis=0) < NEAR)), int(np.sum(near.min(axis=1) >= NEAR))))
        off = [
            estimate.frequency[place] - structure.frequency,
            estimate.damping[place] - structure.damping,
            found.modal_mass[place] - masses,
        ]
        stated = [estimate.frequency_std, estimate.damping_std, found.modal_mass_std]
        errors.append([e / t for e, t in zip(off, (structure.frequency, structure.damping, masses), strict=True)])
        ratios.append([e / s[place] for e, s in zip(off, stated, strict=True)])
    complete = sum(c == (len(structure.frequency), 0) for c in counts)
    rms = np.sqrt(np.mean(np.square(errors), axis=(0, 2)))
    z = np.array(ratios)
    inside = np.mean(np.abs(z) < 1.96, axis=(0, 2))
    cells = [f"{complete} of {n_tests}", f"{1e6 * rms[0]:.1f}", f"{100 * rms[1]:.2f}", f"{100 * rms[2]:.2f}"]
    cells += [f"{r:.2f} ({c:.0%})" for r, c in zip(np.sqrt(np.mean(z**2, axis=(0, 2))), inside, strict=True)]
    return " | ".join([*cells, f"{cpu / n_tests:.2f}"]), files


def theirs(test: ImpactTest, files: list[str]) -> str:
    """Return the row of sdypy-EMA's results."""
    structure = tower()
    decay = 1 / test.decay if test.decay else 0.0
    done = measured(
        peer_python(), Path(__file__), "sdypy_poles", 1, files=files, truth=structure.frequency.tolist(), decay=decay
    )
    found: FloatArray = np.array(done["result"])  # (n_files, n_modes, 2)
    seen = np.isfinite(found[:, :, 0])
    off = found / np.stack([structure.frequency, structure.damping], axis=1) - 1
    rms = np.sqrt(np.nanmean(np.square(off), axis=(0, 1)))
    return (
        f"{seen.sum(axis=1).mean():.1f} of 8 | {1e6 * rms[0]:.1f} | {100 * rms[1]:.2f} | {done['cpu'] / len(files):.2f}"
    )


def main() -> int:
    """Print the table."""
    n_ours = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    n_theirs = int(sys.argv[2]) if len(sys.argv) > 2 else 30
    print(f"{n_ours} tests a row (seeds 0 to {n_ours - 1}), of which sdypy-EMA had the first {n_theirs}\n")
    print(
        "| test | all 8, none false | frequency [ppm] | damping [%] | modal mass [%] | error over deviation: frequency "
        "| damping | modal mass | CPU s | sdypy-EMA: modes near | frequency [ppm] | damping [%] | CPU s |"
    )
    print("| --- |" + " ---: |" * 12)
    for name, test in (SCENES | DISTURBED).items():
        with tempfile.TemporaryDirectory() as folder:
            row, files = ours(test, n_ours, Path(folder), weighted=False)
            print(f"| {name} | {row} | {theirs(test, files[:n_theirs]) if n_theirs else ''} |", flush=True)
            print(f"| the same, with coherences | {ours(test, n_ours, Path(folder), weighted=True)[0]} | |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
