"""What `diagnose` says of records of frames that it has never seen: how often right, and how it errs.

Each record is of a frame of its own, made by another model than the reference's (10 mm Timoshenko elements, flexible
foot and joint, E and density off, gains scattered, noise, quantization), before and after something drawn was done to
it. Prints the table of docs/updater.md.

Usage: PYTHONPATH=tests python benchmarks/causes.py [RECORDS], or make causes
"""

import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from measured_helpers import Rig, swapped

from daq import Recording, load_recordings, write_recording
from monitor.diagnosing import Observation, explain_change, observe, window_seconds
from updater import Body, Cause, Diagnosis, parse_structure, t_structure_toml

SECONDS, RATE, SEED = 240.0, 1000.0, 40000
STRUCTURE = parse_structure(t_structure_toml())
Random = np.random.Generator
Right = Callable[[Cause], bool]
Done = tuple[Recording, Right]  #: what was recorded after, and whether a named cause has the right place and size


def body(rig: Rig, random: Random) -> Done:
    """Clamp 150 to 350 g somewhere above 0.4 m."""
    beam = random.random() < 0.5
    at = (random.uniform(-0.4, 0.4), 0.0, 1.48) if beam else (0.0, 0.0, random.uniform(0.4, 1.45))
    offset = (0.0, 0.015, 0.01) if beam else (0.015, 0.01, 0.0)
    mass = random.uniform(0.15, 0.35)
    hung = Body(at=at, mass=mass, offset=offset, inertia=(2e-4, 2e-4, 2e-4))

    def right(cause: Cause) -> bool:
        if cause.where is None or cause.where.position is None:
            return False
        away = np.linalg.norm(np.subtract(cause.where.position, at))
        return bool(away < 0.1 and abs(cause.parameters["mass"].value / mass - 1) < 0.15)

    return replace(rig, body=(hung,)).record(1, SECONDS, rate=RATE), right


def foot(rig: Rig, random: Random) -> Done:
    """Leave 30 to 80 % of the foot's stiffness about each axis."""
    left = random.uniform(0.3, 0.8, 3)
    after = replace(rig, foot=(left[0], left[1], left[2])).record(1, SECONDS, rate=RATE)
    return after, lambda cause: cause.where is not None and cause.where.position == (0, 0, 0)


def joint(rig: Rig, random: Random) -> Done:
    """Leave 30 to 80 % of the joint's stiffness about each axis."""
    left = random.uniform(0.3, 0.8, 3)
    after = replace(rig, joint=(left[0], left[1], left[2])).record(1, SECONDS, rate=RATE)
    return after, lambda cause: cause.where is not None and cause.where.position == (0, 0, 1.48)


def stiffness(rig: Rig, random: Random) -> Done:
    """Lower or raise all stiffness by 2 to 5 %."""
    factor = 1 + random.choice([-1, 1]) * random.uniform(0.02, 0.05)
    after = replace(rig, stiffness=factor).record(1, SECONDS, rate=RATE)

    return after, lambda cause: abs(1 - cause.parameters["loss"].value - factor) < 0.01


def swap(rig: Rig, random: Random) -> Done:
    """Exchange two channels."""
    after = rig.record(1, SECONDS, rate=RATE)
    first, second = (STRUCTURE.channels[i] for i in random.choice(len(STRUCTURE.channels), 2, replace=False))
    right = {first, second}
    return swapped(after, first, second), lambda cause: cause.where is not None and set(cause.where.channels) == right


def _scaled(rig: Rig, random: Random, factor: float) -> Done:
    after = rig.record(1, SECONDS, rate=RATE)
    channel = int(random.integers(len(STRUCTURE.channels)))
    data = after.data.copy()
    data[:, channel] *= factor
    right = (STRUCTURE.channels[channel],)
    return replace(after, data=data), lambda cause: cause.where is not None and cause.where.channels == right


def polarity(rig: Rig, random: Random) -> Done:
    """Turn one channel round."""
    return _scaled(rig, random, -1.0)


def gain(rig: Rig, random: Random) -> Done:
    """Scale one channel by 10 to 25 %."""
    return _scaled(rig, random, float(random.choice([0.75, 0.8, 0.9, 1.1, 1.2, 1.25])))


def nothing(rig: Rig, random: Random) -> Done:
    """Measure again."""
    del random
    return rig.record(1, SECONDS, rate=RATE), lambda _: True


DONE = {
    "added_mass": body,
    "support_stiffness": foot,
    "joint_stiffness": joint,
    "global_stiffness": stiffness,
    "sensor_swap": swap,
    "sensor_polarity": polarity,
    "sensor_gain": gain,
    "nothing": nothing,
}


def observed(recording: Recording) -> Observation:
    """Write, read and identify, as `import` and `diagnose` do."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.mcap"
        write_recording(log, recording)
        return observe(load_recordings(log, window_seconds=window_seconds(STRUCTURE, SECONDS)))


def outcome(diagnosis: Diagnosis, name: str, right: Right) -> str:
    """Return one word for how a verdict compares with the truth."""
    if name == "nothing" or diagnosis.verdict == "nothing_to_explain":
        return "right" if (name, diagnosis.verdict) == ("nothing", "nothing_to_explain") else _said(diagnosis)
    if diagnosis.verdict == "explained" and [c.cause for c in diagnosis.causes] == [name]:
        return "right" if right(diagnosis.causes[0]) else "wrong place or size"
    if diagnosis.verdict == "ambiguous" and all(right(c) for c in diagnosis.causes if c.cause == name):
        among = {n for c in diagnosis.causes for n in (c.cause, *c.cannot_be_told_from)}
        return "among those named" if name in among else _said(diagnosis)
    return _said(diagnosis)


def _said(diagnosis: Diagnosis) -> str:
    return "; ".join([diagnosis.verdict, *(c.cause for c in diagnosis.causes)])


def main() -> None:
    """Print the table."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 15
    print("| done | records | right | among those named | else |\n|:--|---:|---:|---:|:--|")
    for k, (name, do) in enumerate(DONE.items()):
        outcomes = Counter(one(name, do, SEED + 1000 * k + i) for i in range(n))
        rest = ", ".join(
            f"{count} {what}" for what, count in outcomes.items() if what not in {"right", "among those named"}
        )
        print(f"| {name} | {n} | {outcomes['right']} | {outcomes['among those named']} | {rest} |", flush=True)


def one(name: str, do: Callable[[Rig, Random], Done], seed: int) -> str:
    """Record a rig before and after, diagnose, and judge."""
    rig = Rig(seed=seed)
    after, right = do(rig, np.random.default_rng((seed, 4)))
    diagnosis = explain_change(STRUCTURE, observed(rig.record(0, SECONDS, rate=RATE)), observed(after)).diagnosis
    found = outcome(diagnosis, name, right)
    if found != "right":
        print(f"{name} {seed}: {found}; {diagnosis.causes}", file=sys.stderr, flush=True)
    return found


if __name__ == "__main__":
    main()
