"""Ratio of errors to the smallest possible ones, and coverage of the stated standard deviations.

Prints the documented tables: root mean square errors over the Cramér-Rao bound of Whittle's likelihood, and the
share of the errors within two stated standard deviations.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/oma/accuracy.py [WINDOWS], or make bench-oma-accuracy
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from daq import FloatArray, Recording
from oma import identify
from oma.selection import uncertainty_law
from tests.support.oma.cramer_rao import Bound, whittle_bound
from tests.support.oma.scenes import SCENES, pairs
from tests.support.oma.structures import Structure, frame, simulate

_BAND, _NOISE = (10.0, 300.0), 0.05  # Hz, of the rig


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """Windows of one structure."""

    label: str
    structure: Structure
    record: Callable[[int], Recording]
    noise: float
    band: tuple[float, float] | None = None
    gaussian: bool = True  # else the bound does not hold

    def bound(self) -> Bound:
        """Return the smallest errors; the noise is a share of the rms of the signals, taken from one window."""
        recording = self.record(0)
        variance = self.noise**2 / (1 + self.noise**2) * float(np.mean(recording.data**2))
        return whittle_bound(self.structure, recording.duration, recording.rate, variance)


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors and stated standard deviations, NaN where a mode was missed."""

    frequency: FloatArray  # (n_windows, n_modes) Hz
    frequency_std: FloatArray
    damping: FloatArray
    damping_std: FloatArray
    shape: FloatArray  # (n_windows, n_modes, n_channels)
    shape_std: FloatArray


def rig() -> Structure:
    """Return the frame with 0.4 % damping and its two lowest modes 2 % apart."""
    return frame(0.004)


def cases() -> Iterator[Case]:
    """Yield the measured cases."""
    for name in ("clean", "noise", "close", "weak", "short"):
        scene = SCENES[name]
        label = f"8 ch, {scene.duration:.0f} s, {scene.label}"
        yield Case(label=label, structure=scene.structure, record=scene.record, noise=scene.noise)
    for seconds, taps in ((300.0, 0), (60.0, 0), (60.0, 12)):
        yield Case(
            label=f"12 ch, 1 kHz, {seconds:.0f} s, {taps} taps",
            structure=rig(),
            record=partial(rig_record, seconds, taps),
            noise=_NOISE,
            band=_BAND,
            gaussian=not taps,
        )


def rig_record(seconds: float, taps: int, seed: int) -> Recording:
    """Return a window of the frame."""
    return simulate(rig(), seconds, 1000.0, seed, noise=_NOISE, taps=taps)


def errors(case: Case, n_windows: int) -> Errors:
    """Identify all windows."""
    truth = case.structure
    m, n = truth.shapes.shape
    shapes = truth.shapes / np.linalg.norm(truth.shapes, axis=1, keepdims=True)
    values, components = np.full((4, n_windows, m), np.nan), np.full((2, n_windows, m, n), np.nan)
    result = Errors(*values, *components)
    for seed in range(n_windows):
        found = identify(case.record(seed), band=case.band)
        for i, j in pairs(found.frequency, found.shape, truth):
            shape = found.shape[i].real
            result.frequency[seed, j] = found.frequency[i] - truth.frequency[j]
            result.frequency_std[seed, j] = found.frequency_std[i]
            result.damping[seed, j] = found.damping[i] - truth.damping[j]
            result.damping_std[seed, j] = found.damping_std[i]
            result.shape[seed, j] = shape - shapes[j] * np.sign(shape @ shapes[j])
            result.shape_std[seed, j] = found.shape_std[i]
    return result


def over(error: FloatArray, least: FloatArray) -> str:
    """Return the root mean square error over the least possible one: of all modes, and of the worst."""
    ratio = np.sqrt(np.nanmean(error**2, axis=0)) / least
    return f"{np.sqrt(np.mean(ratio**2)):.2f} ({ratio.max():.2f})"


def covered(error: FloatArray, std: FloatArray) -> str:
    """Return the share of errors within two standard deviations."""
    known = np.isfinite(error)
    return f"{np.mean(np.abs(error[known]) < 2 * std[known]):.1%}"


def row(case: Case, n_windows: int) -> str:
    """Return a line of the table."""
    found, truth = errors(case, n_windows), case.structure
    duration = case.record(0).duration
    law = np.array([uncertainty_law(f, z, duration) for f, z in zip(truth.frequency, truth.damping, strict=True)]).T
    bound = case.bound() if case.gaussian else None
    cells = [over(found.frequency, bound.frequency), over(found.damping, bound.damping)] if bound else ["", ""]
    cells += [over(found.frequency, law[0]), over(found.damping, law[1])]
    cells += [covered(found.frequency, found.frequency_std), covered(found.damping, found.damping_std)]
    missed = np.isnan(found.frequency).sum()
    bias = np.nanmean(found.damping / found.damping_std)
    return " | ".join([f"| {case.label}", *cells, covered(found.shape, found.shape_std), f"{bias:+.2f}", f"{missed} |"])


def main() -> int:
    """Print the table."""
    n_windows = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print(f"{n_windows} windows a line (seeds 0 to {n_windows - 1}); of all modes (of the worst)\n")
    print("| window | f / bound | ζ / bound | f / law | ζ / law | f in 2 std | ζ | shape | ζ off, std | missed |")
    print("| --- |" + " ---: |" * 9)
    for case in cases():
        print(row(case, n_windows), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
