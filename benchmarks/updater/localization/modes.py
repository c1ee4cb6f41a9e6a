"""Accuracy of position and mass of one added mass, from modes with known noise, at a thousand positions per line.

Every place is on one of ten true frames that differ from the reference in kind, with a baseline of its own that is as
noisy as the event. Prints tables of the documentation.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/updater/localization/modes.py [PLACES] [LINES ...], or make
localization
"""

import sys
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing import Pool

import numpy as np

from benchmarks.common.random_bodies import HEAD, TOTAL, Judged, Limit, Placed, draw, judge, row
from daq import FloatArray
from oma import ModalEstimate
from tests.support.updater.frames import Truth, as_estimate, t_frame, t_truth, unmoved
from updater import Reference, learn_reference, learn_scatter, locate_mass, mean_modes, stack_tracks
from updater.fe import Modes
from updater.modal_data import ModalMean
from updater.reference import first_stage

FRAMES, N_BASELINE, N_EVENT, N_MODES = 10, 8, 4, 8
SEED = 2026
DAMPING = 0.004
SHARES = (0.005, 0.01, 0.02, 0.04)
STRUCTURE = t_frame()


@dataclass(frozen=True, kw_only=True)
class Line:
    """Conditions of one line of a table."""

    label: str
    shares: tuple[float, ...] = SHARES  # of the structure's mass, in turn
    noise: float = 0.0  # of frequencies
    shape_noise: float = 0.0  # of a shape's rms component
    seconds: float = 0.0  # of a record: noise by the uncertainty law if given
    drift: float = 0.0  # common to all frequencies between baseline and event
    at: tuple[str, float] | None = None  # member and distance: a plain mass there instead of any body anywhere

    def frequency_std(self, frequency: FloatArray) -> FloatArray:
        """Of log frequencies (n_modes,), of the baseline's mean as of the event's."""
        if self.seconds:
            return np.asarray(np.sqrt(DAMPING / (2 * np.pi * frequency * self.seconds)))
        return np.full(len(frequency), self.noise)

    def shape_std(self, n_channels: int) -> float:
        """Of unit shapes' components."""
        return float(self.shape_noise / np.sqrt(n_channels))


LINES = {
    **{
        f"{noise}/{shape}": Line(label=f"noise {noise} % / {shape} %", noise=noise / 100, shape_noise=shape / 100)
        for noise, shape in ((0.05, 1), (0.1, 2), (0.3, 3))
    },
    "drift": Line(label="noise 0.1 % / 2 %, all frequencies 0.5 % off", noise=1e-3, shape_noise=0.02, drift=5e-3),
    **{
        f"law{seconds}": Line(
            label=f"noise of {seconds} s by the law, shapes {shape} %", seconds=seconds, shape_noise=shape / 100
        )
        for seconds, shape in ((60, 1.0), (120, 0.7), (600, 0.3))
    },
    "304": Line(
        label="304 g at location 1, noise 0.1 % / 2 %",
        shares=(0.304 / TOTAL,),
        noise=1e-3,
        shape_noise=0.02,
        at=("crossbeam", 0.65),
    ),
    "152": Line(
        label="152 g at location 2, noise 0.1 % / 2 %",
        shares=(0.152 / TOTAL,),
        noise=1e-3,
        shape_noise=0.02,
        at=("column", 0.92),
    ),
}


@dataclass(frozen=True, eq=False)
class Frame:
    """A true frame."""

    truth: Truth
    limit: Limit
    bare: Modes
    rows: FloatArray

    def windows(self, modes: Modes, line: Line, n: int, random: np.random.Generator) -> list[ModalEstimate]:
        """Return n windows whose mean has the line's noise."""
        std = line.frequency_std(modes.frequency) * np.sqrt(n)
        shape = (self.rows @ modes.shape).T * self.truth.gain
        shape /= np.linalg.norm(shape, axis=1, keepdims=True)
        shape_std = line.shape_std(shape.shape[1]) * np.sqrt(n)
        return [
            as_estimate(
                modes.frequency * (1 + std * random.standard_normal(len(std))),
                shape + shape_std * random.standard_normal(shape.shape),
                channels=STRUCTURE.channels,
                frequency_std=std * modes.frequency,
                shape_std=shape_std,
            )
            for _ in range(n)
        ]


@cache
def frame(number: int) -> Frame:
    """Return one of the true frames."""
    truth = t_truth(100 + number)
    model = truth.model()
    return Frame(truth, Limit(truth.structure), model.modes(N_MODES), model.sensor_rows)


@cache
def calibrated(number: int, line: Line) -> Reference:
    """Return a reference of a frame, calibrated to a first baseline."""
    random = np.random.default_rng((SEED, number))
    return learn_reference(STRUCTURE, frame(number).windows(frame(number).bare, line, N_BASELINE, random), unmoved(8))


def learnt_anew(reference: Reference, windows: list[ModalEstimate]) -> Reference:
    """Return the reference with another baseline and all that follows from it but the physical calibration."""
    tracked = stack_tracks(windows, unmoved(len(windows)))
    scatter = learn_scatter(tracked)
    baseline = mean_modes(tracked, frequency_factor=scatter.frequency_factor, shape_factor=scatter.shape_factor)
    fitted = reference.calibration
    modes = first_stage(fitted.model, fitted.modes, fitted.paired, baseline)
    return replace(
        reference,
        frequency=modes.frequency,
        shape=modes.shape,
        baseline=baseline,
        scatter=scatter,
        windows=tracked,
    )


@dataclass(frozen=True, eq=False)
class Case:
    """One place, before and after."""

    frame: Frame
    placed: Placed
    reference: Reference
    event: ModalMean

    def judged(self, line: Line) -> Judged:
        """Locate, and judge."""
        std = line.frequency_std(self.frame.bare.frequency)
        found = locate_mass(self.reference, self.event)
        shape_std = np.full(len(std), line.shape_std(len(STRUCTURE.channels)))
        return judge(found, self.placed, self.frame.limit, std, shape_std)


def case(line: Line, number: int) -> Case:
    """Return a place, measured before and after."""
    random = np.random.default_rng((SEED, number))
    here = frame(number % FRAMES)
    placed = place(line, line.shares[number // FRAMES % len(line.shares)] * TOTAL, random)
    baseline = here.windows(here.bare, line, N_BASELINE, random)
    loaded = here.truth.model(placed.body).modes(N_MODES)
    loaded = Modes(frequency=loaded.frequency * np.exp(line.drift * random.choice([-1, 1])), shape=loaded.shape)
    reference = learnt_anew(calibrated(number % FRAMES, line), baseline)
    event = reference.mean_of(stack_tracks(here.windows(loaded, line, N_EVENT, random), unmoved(N_EVENT)))
    return Case(here, placed, reference, event)


def place(line: Line, mass: float, random: np.random.Generator) -> Placed:
    """Return a body as the line requires."""
    if line.at is None:
        return draw(STRUCTURE, mass, random)
    name, distance = line.at
    return Placed(member=STRUCTURE.member_named(name), distance=distance, mass=mass)


def one(task: tuple[str, int]) -> Judged:
    """Judge one case; runs in a process of its own."""
    line = LINES[task[0]]
    return case(line, task[1]).judged(line)


def main() -> int:
    """Print the tables."""
    places = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    print(f"seed {SEED}\n\n{HEAD}")
    with Pool() as pool:
        for name in sys.argv[2:] or LINES:
            line = LINES[name]
            judged = pool.map(one, [(name, number) for number in range(places)], chunksize=5)
            print(row(line.label, judged), flush=True)
            for share in line.shares if len(line.shares) > 1 else ():
                these = [j for j in judged if np.isclose(j.share, share)]
                print(row(f"of these {100 * share:g} % of the mass", these), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
