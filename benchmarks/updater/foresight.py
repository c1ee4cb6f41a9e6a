"""Predictions of `structure --target-mass` compared with outcomes, on other frames and with modes of accelerations.

Each frame is made by another model than the reference's (10 mm Timoshenko elements, flexible foot and joint, E and
density off, gains scattered). A body is put anywhere along the members; a record before teaches the reference, one
after is searched. Prints the tables of the documentation.

Usage: python benchmarks/updater/foresight.py [PLACES], or make bench-foresight
"""

import sys
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import beta, chi2

from daq import Recording
from monitor.analysis.observation import Observation, observe, window_seconds
from oma import identify
from tests.measured.accelerometers import Rig
from tests.support.updater.frames import t_frame
from tests.support.updater.planned_records import N_AFTER, TrueRig, away, in_order
from updater import Body, Record, Structure, learn_reference, locate_mass, matched, stack_tracks, study_detectability
from updater.fe import Modes
from updater.modal_data import ModalMean
from updater.planning import DetectabilityStudy, LocalizationSimulation, Target
from updater.planning.record_noise import shape_errors

PLACES_A_FRAME = 10
CASES = ((0.02, 60.0), (0.05, 60.0), (0.15, 60.0), (0.02, 600.0), (0.05, 600.0), (0.15, 600.0))
SEED = 6000


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One body searched."""

    foreseen: float  # chance of an alarm and an answer within 50 mm
    found: bool
    alarm: bool
    off: float  # m
    bound: float  # m
    weakest: float  # kg


def alarmed(base: ModalMean, event: ModalMean, record: Record) -> bool:
    """Return the result of the alarm's test for the frequencies of the two records."""
    z2 = (event.log_frequency - base.log_frequency) ** 2 / (event.log_frequency_std**2 + base.log_frequency_std**2)
    z2 = z2[np.isfinite(z2)]  # without modes that a record does not show
    return bool(z2.sum() > chi2.isf(record.false_alarm_probability, len(z2)))


def trials(outlook: DetectabilityStudy, mass: float, n: int) -> list[Trial]:
    """Search a mass at n random places, ten on each of n / 10 frames."""
    foresight, record = LocalizationSimulation(outlook, Target(mass=mass)), outlook.record
    place_bound, weakest = outlook.bound(mass)[0], outlook.weakest_mass()
    random = np.random.default_rng((SEED, round(1e4 * mass), round(record.seconds)))
    found = []
    for frame in range(n // PLACES_A_FRAME):
        rig = TrueRig(seed=SEED + frame, record=record)
        reference = rig.reference()
        for draw in range(PLACES_A_FRAME):
            place = int(random.choice(foresight.places))
            x, y, z = outlook.point[place].tolist()
            body = Body(at=(x, y, z), mass=mass)
            windows = rig.windows(body, N_AFTER, 100 + draw)
            alarm = alarmed(reference.baseline, reference.mean_of(stack_tracks(windows, in_order(windows))), record)
            off = away(rig.located(reference, body, 100 + draw), body)
            chance = float(foresight.chance(record.seconds, np.array([place]))[0])
            found.append(
                Trial(
                    foreseen=chance,
                    found=alarm and off <= foresight.target.within,
                    alarm=alarm,
                    off=off,
                    bound=float(place_bound[place]),
                    weakest=float(weakest[place]),
                )
            )
    return found


def share(hits: int, n: int) -> str:
    """Return a share with Clopper and Pearson's 95 % interval, in percent."""
    low = beta.ppf(0.025, hits, n - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, n - hits) if hits < n else 1.0
    return f"{100 * hits / n:.0f} % ({100 * low:.0f} to {100 * high:.0f} %)"


def found_line(mass: float, seconds: float, done: list[Trial]) -> str:
    """Return the line of one case: predicted and actual results, for the sure and the unsure answers."""
    n = len(done)
    sure = [t for t in done if t.foreseen >= 0.95]
    unsure = [t for t in done if t.foreseen < 0.5]
    off, bound = np.array([t.off for t in sure]), np.array([t.bound for t in sure])
    return (
        f"| {1000 * mass:.0f} g | {seconds:.0f} s | {100 * np.mean([t.foreseen for t in done]):.0f} % | "
        f"{share(sum(t.found for t in done), n)} | {share(sum(t.found for t in sure), len(sure))} | "
        f"{sum(t.found for t in unsure)} of {len(unsure)} | "
        f"{1000 * np.median(off):.1f} mm | {np.median(off / bound) / 0.6745:.2f} |"
    )


def weakest_line(outlook: DetectabilityStudy, factor: float, n: int) -> str:
    """Return how often the weakest mass times a factor raises the alarm, on other frames at random places."""
    weakest, heaviest = outlook.weakest_mass(), 0.1 * outlook.reference.model.total_mass()
    usable = np.flatnonzero(weakest < heaviest)
    random = np.random.default_rng((SEED, round(outlook.record.seconds)))
    alarms = 0
    for frame in range(n // PLACES_A_FRAME):
        rig = TrueRig(seed=SEED + frame, record=outlook.record)
        for draw in range(PLACES_A_FRAME):
            place = int(random.choice(usable))
            x, y, z = outlook.point[place].tolist()
            body = Body(at=(x, y, z), mass=factor * float(weakest[place]))
            alarms += rig_alarm(rig, body, draw)
    n = n // PLACES_A_FRAME * PLACES_A_FRAME
    return f"| {outlook.record.seconds:.0f} s | {factor:g} | {share(alarms, n)} |"


def rig_alarm(rig: TrueRig, body: Body | None, draw: int) -> bool:
    """Return whether the alarm's test distinguishes a record with a body from one without."""
    record = rig.record
    random = np.random.default_rng((rig.seed, draw, 17))
    before, after = (np.log(rig.model(b).modes(12).frequency) for b in (None, body))
    measured = np.exp(before) <= record.highest
    std = np.sqrt(2) * record.log_frequency_std(np.exp(before[measured]))
    z = ((after - before)[measured] + std * random.standard_normal(len(std))) / std
    return bool((z**2).sum() > chi2.isf(record.false_alarm_probability, len(std)))


def observed(recording: Recording, structure: Structure) -> Observation:
    """Return the modes of a record in the windows that `diagnose` would cut it into."""
    seconds = len(recording.data) / recording.rate
    n = round(seconds / window_seconds(structure, seconds))
    length = len(recording.data) // n
    starts = [k * length for k in range(n)]
    return observe(
        replace(
            recording,
            data=recording.data[k : k + length],
            start=recording.start + round(k / recording.rate * 1e9),
        )
        for k in starts
    )


def heard_line(outlook: DetectabilityStudy, mass: float, rigs: int) -> str:
    """Return the line of a mass searched in accelerations: two bodies on each of some frames."""
    structure, seconds, random = t_frame(), outlook.record.seconds, np.random.default_rng((SEED, round(1e4 * mass)))
    foresight = LocalizationSimulation(outlook, Target(mass=mass))
    foreseen, found = [], []
    for seed in range(SEED, SEED + rigs):
        rig = Rig(seed=seed)
        before = observed(rig.record(0, seconds), structure)
        reference = learn_reference(structure, before.estimates, before.tracks)
        for log in (1, 2):
            place = int(random.choice(foresight.places))
            x, y, z = outlook.point[place].tolist()
            body = Body(at=(x, y, z), mass=mass)
            after = observed(replace(rig, body=(body,)).record(log, seconds), structure)
            event = matched(reference.baseline, reference.mean_of(after.modes))
            near = away(locate_mass(reference, event), body) <= foresight.target.within
            found.append(near and alarmed(reference.baseline, event, outlook.record))
            foreseen.append(float(foresight.chance(seconds, np.array([place]))[0]))
    return (
        f"| {1000 * mass:.0f} g | {seconds:.0f} s | {100 * np.mean(foreseen):.0f} % | {share(sum(found), len(found))} |"
    )


def law_line(seconds: float, rigs: int) -> str:
    """Return the errors that identification states over the laws', median and range over modes and frames."""
    frequency, shapes = [], []
    for seed in range(rigs):
        estimate = identify(Rig(seed=seed).record(0, seconds, rate=1000.0))
        model = study_detectability(t_frame(), Record(seconds=seconds)).reference
        modes: Modes = model.calibration.modes
        nearest = [int(np.argmin(np.abs(np.log(modes.frequency / f)))) for f in estimate.frequency]
        for k, mode in enumerate(nearest):
            record = Record(seconds=seconds, damping=float(estimate.damping[k]))
            at = model.model.sensor_rows @ modes.shape
            own = np.array([mode])
            error = shape_errors(at, record.leaks(modes.frequency, own), at[:, own].T)
            law = np.sqrt((error**2).sum() + len(at) * record.blur(modes.frequency[own])[0] ** 2)
            frequency.append(
                estimate.frequency_std[k] / estimate.frequency[k] / record.log_frequency_std(modes.frequency[own])[0]
            )
            shapes.append(float(np.linalg.norm(estimate.shape_std[k])) / law)
    parts = [
        f"{np.median(x):.2f} | {np.quantile(x, 0.1):.2f} to {np.quantile(x, 0.9):.2f}" for x in (frequency, shapes)
    ]
    return f"| {seconds:.0f} s | {len(shapes)} | {parts[0]} | {parts[1]} |"


def main() -> int:
    """Print the four tables."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    print("| record | modes | frequency over the law | 10 to 90 % | shape over the law | 10 to 90 % |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: |")
    for seconds, rigs in ((60.0, 6), (120.0, 6), (600.0, 2)):
        print(law_line(seconds, max(1, rigs * n // 200)), flush=True)
    print("\n| record | times the weakest mass | raise the alarm |\n| ---: | ---: | ---: |")
    outlooks = {seconds: study_detectability(t_frame(), Record(seconds=seconds)) for seconds in (60.0, 600.0)}
    for outlook in outlooks.values():
        for factor in (0.5, 1.0):
            print(weakest_line(outlook, factor, n), flush=True)
    print(
        "\n| mass | record | foreseen | found | of those foreseen at 95 % or more | under 50 % | off | over the bound |"
    )
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for mass, seconds in CASES:
        print(found_line(mass, seconds, trials(outlooks[seconds], mass, n)), flush=True)
    print("\n| mass | record | foreseen | found in accelerations |\n| ---: | ---: | ---: | ---: |")
    print(heard_line(study_detectability(t_frame(), Record(seconds=120.0)), 0.05, max(1, n // 20)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
