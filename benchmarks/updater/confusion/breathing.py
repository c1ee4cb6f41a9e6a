"""The confusion matrix of cracks that open and close, play, gaping, and a linear foot (`make bench-breathing`).

A run continues where the last one ended.
"""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2, ncx2

from benchmarks.updater.confusion.run import Task, run
from benchmarks.updater.confusion.table import Result, tables
from monitor.analysis.explanation import explain
from monitor.analysis.observation import Observation, observe
from monitor.errors import StateError
from oma import OmaError
from tests.examiner.draws import Hidden
from tests.examiner.score import RIGHT, score
from tests.support.portals.cracked_portal import WHOLE, Crack, CrackedPortal, Force, Opens, records
from tests.support.portals.tube_portal import Portal
from updater.errors import UpdaterError
from updater.quantities import Law

_PORTALS = (Portal(0.018, 0.015, 0.0015, 1.0, 1.175), Portal(0.015, 0.018, 0.0015, 0.9, 1.175))
_COMMON, _LEVEL, _POWER = 3e-3, 0.01, 0.99  # of all frequencies; of the test; of a change that is visible
_CELL = "breathing: "
_KINDS = ("closes", "closes by half", "loaded", "stays open")
_FORCES: tuple[Force, ...] = ("white", "low", "blows")
_NEAR = 0.05  # m
_DECIDES = "; decided by the signals"  # of what is reported
_LAWS: dict[Law, str] = {"one_side": "; opens and closes", "within": "; has play", "beyond": "; opens on both sides"}
_FOOT, _LOOSE = "linear foot", 4.0  # kind, and times the flexibility of a crack
_TWO_SIDED: dict[str, tuple[Opens, tuple[float, float]]] = {  # sides of the moment, its range over its deviation
    "play": ("within", (0.6, 1.6)),
    "gapes": ("beyond", (0.4, 1.2)),
}
_GUSTY: tuple[Force, ...] = (*_FORCES, "gusts")


def _kind(seed: int) -> str:
    return _KINDS[seed % len(_KINDS)]


def _drawn(kind: str, seed: int) -> tuple[Portal, Crack, Force]:
    random = np.random.default_rng((seed, 35))
    if kind in _TWO_SIDED:
        return _drawn_two_sided(kind, random, seed)
    opened = float(np.exp(random.uniform(np.log(0.012), np.log(0.05)))) * (_LOOSE if kind == _FOOT else 1.0)
    closed = {"closes by half": opened / 2, "stays open": opened, _FOOT: opened}.get(kind, WHOLE)
    threshold = random.uniform(-0.5, 0.5) if kind == "loaded" else 0.0
    portal = _PORTALS[random.integers(len(_PORTALS))]
    place = 0.0 if kind == _FOOT else int(random.integers(5, 28)) / 32
    return portal, Crack(place, opened, closed, threshold, points=seed), random.choice(_FORCES)


def _drawn_two_sided(kind: str, random: np.random.Generator, points: int) -> tuple[Portal, Crack, Force]:
    """Return play, or a connection that gapes under both signs: half of them in the left foot, half in its post."""
    opens, moments = _TWO_SIDED[kind]
    place = random.choice([0, int(random.integers(5, 28))]) / 32
    opened = float(np.exp(random.uniform(np.log(0.012), np.log(0.05)))) * (1.0 if place else _LOOSE)
    portal = _PORTALS[random.integers(len(_PORTALS))]
    return portal, Crack(place, opened, WHOLE, random.uniform(*moments), opens, points), random.choice(_GUSTY)


def _power(portal: Portal, crack: Crack, open_time: float, before: Observation, after: Observation) -> float:
    """Return how often a chi-square test of the measured frequencies at a level of 1 % detects the mean flexibility.

    As in the other cells (`tests/examiner/cases.py`), the common part of all frequencies counts only beyond 0.3 %. The
    true shifts are those of the modes nearest to the measured ones.
    """
    mean = open_time * crack.opened + (1 - open_time) * crack.closed
    states = (crack.healthy, Crack(crack.place, mean, mean))
    whole, cracked = (np.sqrt(CrackedPortal(portal, one).square) / (2 * np.pi) for one in states)
    measured = np.exp(np.nanmean(before.modes.log_frequency, axis=0))
    nearest = np.argmin(np.abs(whole[:, None] - measured), axis=0)
    shift = np.log(cracked[nearest] / whole[nearest])
    variance = np.nanmean(before.modes.log_frequency_std**2, axis=0) / len(before.modes.log_frequency)
    variance *= 1 + len(before.modes.log_frequency) / len(after.modes.log_frequency)
    noncentrality = float(shift @ np.linalg.solve(np.diag(variance) + _COMMON**2, shift))
    return float(ncx2.sf(chi2.isf(_LEVEL, len(shift)), len(shift), noncentrality))


def judged(task: Task) -> Result:
    """Draw, record, diagnose and score one crack; the time is that of the diagnosis alone."""
    cell, seed, noise = task
    kind = cell.removeprefix(_CELL)
    portal, crack, force = _drawn(kind, seed)
    before, _ = records(portal, crack.healthy, 2 * seed, force)
    after, open_time = records(portal, crack, 2 * seed + 1, force)
    records.cache_clear()
    x, y, z = portal.at("left", crack.place)
    truth = {"share": crack.share(open_time), "open_time": open_time}
    both: dict[str, Any] = {"cell": cell, "seed": seed, "noise": noise, "kind": "detectable", "true": truth}
    done = f"{kind}, {force}, {1000 * crack.opened:.0f} mm at {1000 * z:.0f} mm"
    start = time.process_time()
    try:
        observed = observe(before), observe(after)
        both["true"] = truth | {"power": _power(portal, crack, open_time, *observed)}
        start = time.process_time()
        found = explain(portal.file(), *observed).diagnosis.model_dump(mode="json")
    except (UpdaterError, OmaError, StateError) as error:
        return Result.model_validate(both | {"outcome": "refused", "reported": str(error), "done": done})
    seconds = time.process_time() - start
    cause = "local_stiffness" if crack.place else "support_stiffness"
    scored = score(found, [Hidden(cause=cause, position=(x, y, z))], "detectable", near=_NEAR)
    breathing = found["causes"][0]["breathing"] if len(found["causes"]) == 1 and scored.outcome == RIGHT else None
    if breathing and kind in _TWO_SIDED and not breathing["law"]:
        breathing = None  # the share is that of the other law
    known = {name: breathing[name] for name in truth if breathing[name]} if breathing else {}
    laws = [c["breathing"]["law"] for c in found["causes"] if c["breathing"] and c["breathing"]["law"]]
    decides = any(c["signals"] and c["signals"]["decides"] for c in found["causes"])
    return Result.model_validate(
        both
        | {
            "outcome": scored.outcome,
            "reported": scored.reported + "".join(_LAWS[law] for law in laws) + _DECIDES * decides,
            "done": done,
            "away": scored.away,
            "errors": {name: quantity["value"] - truth[name] for name, quantity in known.items()},
            "deviations": {name: quantity["std"] for name, quantity in known.items()},
            "inside": scored.inside,
            "probability": scored.probability,
            "first_is_right": scored.first_is_right,
            "seconds": seconds,
        }
    )


def _closing(results: list[Result]) -> str:
    """Return how many losses are named in their place, stated to open by each law, and decided by the signals."""
    rows = [
        "| loss | draws | named alone, in place | visible, of these named | one side, play, gapes | decided, wrong |",
        "|:--|---:|---:|---:|---:|---:|",
    ]
    for kind in (*_KINDS, _FOOT, *_TWO_SIDED):
        own = [r for r in results if r.cell == _CELL + kind]
        right = [r for r in own if r.outcome == RIGHT]
        visible = [r for r in own if r.true.get("power", 1.0) >= _POWER]
        seen = f"{len(visible)}, {sum(r.outcome == RIGHT for r in visible)}"
        decided = [r for r in own if _DECIDES in r.reported]
        closing = ", ".join(str(sum(law in r.reported for r in right)) for law in _LAWS.values())
        wrong = sum(r.outcome != RIGHT for r in decided)
        rows.append(f"| {kind} | {len(own)} | {len(right)} | {seen} | {closing} | {len(decided)}, {wrong} |")
    return "\n".join(rows)


def main() -> int:
    """Run the missing draws and print the tables of docs/validation/diagnosis/breathing.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--feet", type=int, default=40, help="draws of a linear loss of a foot")
    parser.add_argument("--two-sided", type=int, default=31, help="draws of play, and of gaping under both signs")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="after which to stop and report")
    parser.add_argument("--file", type=Path, default=Path("confusion_breathing.jsonl"))
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    seeds = range(given.seed, given.seed + given.draws)
    cells = [(_CELL + _kind(seed), seed) for seed in seeds]
    cells += [(_CELL + _FOOT, seed) for seed in range(given.seed, given.seed + given.feet)]
    cells += [(_CELL + kind, seed) for seed in range(given.seed, given.seed + given.two_sided) for kind in _TWO_SIDED]
    tasks = [(*cell, "records of 180 s") for cell in cells]
    done = run(judged, tasks, given.file, minutes=given.minutes, processes=given.processes)
    print(f"{tables(done)}\n\n{_closing(done)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
