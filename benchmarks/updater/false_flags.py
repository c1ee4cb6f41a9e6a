"""Flags of the one-step update: false ones, those of added masses, and the places that it claims.

Eight windows teach the reference, four make an event, as in a demo; noise by the uncertainty law. Prints the tables
of the documentation, and false flags of the stiffness twin.

Usage: python benchmarks/updater/false_flags.py [BASELINES], or make bench-flags
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import beta

from oma import ModalEstimate
from tests.support.updater.flags import FRAMES, specimen
from tests.support.updater.frames import unmoved
from tests.support.updater.one_step import N_BASELINE, N_EVENT, Rig
from updater import Body, MassUpdater, Reference, StiffnessUpdater, stack_tracks
from updater.modal_data import COMMON_STD, ModalMean

EVENTS = 8  # a baseline
RIGS = (3, 4, 5, 6)  # seeds of true frames
PLACE = (0.25, 0.0, 1.48)
FIRST_SPECIMEN = 300  # of the examiner's seeds
NEAR = 0.1  # m
GRAMS = (10, 20, 30, 40, 76, 152, 304)


Method = type[MassUpdater] | type[StiffnessUpdater]


@dataclass(frozen=True, kw_only=True)
class Undisturbed:
    """Changes of the modes of a frame without added mass."""

    label: str
    noise: float = 1.0  # over what the windows state of themselves
    common: float = 0.0  # standard deviation of a change of all frequencies alike
    mixing: float = 0.0  # standard deviation of how far the two lowest, close modes turn into each other [rad]


CASES = (
    Undisturbed(label="noise as it is stated"),
    Undisturbed(label="noise twice what is stated", noise=2.0),
    Undisturbed(label="all frequencies drift together by 0.3 %", common=COMMON_STD),
    Undisturbed(label="the two close modes mix by 0.05 rad", mixing=0.05),
)


def mix(window: ModalEstimate, angle: float) -> ModalEstimate:
    """Turn the two lowest shapes into each other."""
    shape = window.shape.copy()
    shape[0], shape[1] = window.shape[0] + angle * window.shape[1], window.shape[1] - angle * window.shape[0]
    return replace(window, shape=shape / np.linalg.norm(shape, axis=1, keepdims=True))


def undisturbed(rig: Rig, case: Undisturbed, seed: int) -> tuple[Reference, Iterator[ModalMean]]:
    """Return a new reference and events without a change."""
    random = np.random.default_rng(seed)
    n = N_BASELINE + EVENTS * N_EVENT
    stated = rig.windows(rig.bare, n, seed, case.noise)
    windows = [
        mix(replace(w, frequency_std=w.frequency_std / case.noise, shape_std=w.shape_std / case.noise), angle)
        for w, angle in zip(stated, case.mixing * random.standard_normal(n), strict=True)
    ]
    learnt = rig.relearnt(windows[:N_BASELINE])
    return learnt, (event_of(learnt, windows[N_BASELINE + i :: EVENTS], case.common, random) for i in range(EVENTS))


def event_of(learnt: Reference, windows: list[ModalEstimate], common: float, random: np.random.Generator) -> ModalMean:
    """Return the mean of an event's windows."""
    mean = learnt.mean_of(stack_tracks(windows, unmoved(len(windows))))
    return replace(mean, log_frequency=mean.log_frequency + common * random.standard_normal())


def false_flags(rigs: list[Rig], case: Undisturbed, baselines: int, method: Method = MassUpdater) -> str:
    """Return the table's line of one case."""
    flagged = 0
    for i in range(baselines):
        learnt, events = undisturbed(rigs[i % len(rigs)], case, 1000 + i)
        updater = method(learnt)
        flagged += sum(bool(len(updater.update(event).flagged)) for event in events)
    n = baselines * EVENTS
    low = beta.ppf(0.025, flagged, n - flagged + 1) if flagged else 0.0  # Clopper-Pearson
    high = beta.ppf(0.975, flagged + 1, n - flagged)
    return f"| {case.label} | {flagged} of {n} | {100 * flagged / n:.2f} % | {100 * low:.2f} to {100 * high:.2f} % |"


def detection(rigs: list[Rig], grams: int, baselines: int) -> str:
    """Return the table's line of one mass."""
    counts, distances = [], []
    for i in range(baselines):
        rig = rigs[i % len(rigs)]
        learnt, _ = undisturbed(rig, CASES[0], 5000 + i)
        loaded = rig.truth.model(Body(at=PLACE, mass=1e-3 * grams)).modes(8)
        windows = rig.windows(loaded, N_EVENT, 9000 + i)
        found = MassUpdater(learnt).update(learnt.mean_of(stack_tracks(windows, unmoved(N_EVENT))))
        counts.append(len(found.flagged))
        if found.location:
            distances.append(float(np.linalg.norm(found.location.position - PLACE)))
    share = 100 * np.mean(np.array(counts) > 0)
    away = f"{np.median(distances):.2f} m" if distances else ""
    return f"| {grams} g | {share:.0f} % | {np.median(counts):.0f} | {away} |"


def claims(frame: str, specimens: int) -> str:
    """Return the table's line of one frame: ten bodies on each of some specimens of the examiner's."""
    n, off, everywhere, peaks, held, n_flagged = 0, [], [], [], 0, 0
    for seed in range(FIRST_SPECIMEN, FIRST_SPECIMEN + specimens):
        one = specimen(frame, seed)
        updater, model = MassUpdater(one.reference), one.reference.model
        for place, event in one.bodies(10):
            n += 1
            found = updater.update(event)
            if found.location is None:
                continue
            n_flagged += 1
            away = float(np.linalg.norm(found.location.position - place))
            everywhere.append(away)
            off += [away] if found.location.is_located else []
            peak = int(np.argmax(np.nan_to_num(np.abs(found.normalised)).sum(1)))
            peaks.append(float(np.linalg.norm(model.nodes[peak] - place)))
            held += any(
                np.linalg.norm(place - a) + np.linalg.norm(place - b) < np.linalg.norm(a - b) + 0.01
                for _, a, b in found.location.region
            )
    near = sum(distance < NEAR for distance in off)
    low = beta.ppf(0.025, near, len(off) - near + 1)
    spread = [f"{1000 * np.median(d):.0f} / {1000 * np.quantile(d, 0.9):.0f} mm" for d in (peaks, everywhere, off)]
    cells = [frame, f"{n_flagged} of {n}", *spread[:2], str(len(off)), spread[2], f"{near} (over {100 * low:.0f} %)"]
    return f"| {' | '.join([*cells, f'{held} of {n_flagged}'])} |"


def main() -> int:
    """Print the tables."""
    baselines = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    print("| frame | flagged | largest increment off | best position off | claimed | off | within 0.1 m | in region |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for frame in FRAMES:
        print(claims(frame, max(1, baselines // 20)), flush=True)
    print()
    rigs = [Rig(seed) for seed in RIGS]
    print("| nothing changed, but | events flagged | | 95 % interval |\n| --- | ---: | ---: | ---: |")
    for case in CASES:
        print(false_flags(rigs, case, baselines), flush=True)
    print("\n| stiffness twin: nothing changed, but | events flagged | | 95 % interval |\n| --- | ---: | ---: | ---: |")
    for case in CASES:
        print(false_flags(rigs, case, baselines // 2, StiffnessUpdater), flush=True)
    print("\n| added at (0.25, 0, 1.48) | flagged | flags, median | place off by, median |")
    print("| ---: | ---: | ---: | ---: |")
    for grams in GRAMS:
        print(detection(rigs, grams, min(baselines, 40)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
