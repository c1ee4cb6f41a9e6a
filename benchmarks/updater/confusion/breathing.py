"""The confusion matrix of cracks that open and close, or stay open, from accelerations (`make bench-breathing`).

A run continues where the last one ended.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from benchmarks.updater.confusion.run import Task, run
from benchmarks.updater.confusion.table import Result, tables
from monitor.analysis.explanation import explain
from monitor.analysis.observation import observe
from monitor.errors import StateError
from oma import OmaError
from tests.examiner.draws import Hidden
from tests.examiner.score import RIGHT, score
from tests.support.portals.cracked_portal import WHOLE, Crack, Force, records
from tests.support.portals.tube_portal import Portal
from updater.errors import UpdaterError
from updater.quantities import BREATHES

_PORTALS = (Portal(0.018, 0.015, 0.0015, 1.0, 1.175), Portal(0.015, 0.018, 0.0015, 0.9, 1.175))
_KINDS = ("closes", "closes by half", "loaded", "stays open")
_FORCES: tuple[Force, ...] = ("white", "low", "blows")
_NEAR = 0.05  # m
_CLOSES = "; opens and closes"  # of what is reported


def _drawn(seed: int) -> tuple[str, Portal, Crack, Force]:
    random = np.random.default_rng((seed, 35))
    kind, opened = _KINDS[seed % len(_KINDS)], float(np.exp(random.uniform(np.log(0.012), np.log(0.05))))
    closed = {"closes by half": opened / 2, "stays open": opened}.get(kind, WHOLE)
    threshold = random.uniform(-0.5, 0.5) if kind == "loaded" else 0.0
    portal = _PORTALS[random.integers(len(_PORTALS))]
    return kind, portal, Crack(int(random.integers(5, 28)) / 32, opened, closed, threshold), random.choice(_FORCES)


def judged(task: Task) -> Result:
    """Draw, record, diagnose and score one crack; the time is that of the diagnosis alone."""
    cell, seed, noise = task
    kind, portal, crack, force = _drawn(seed)
    before, _ = records(portal, crack.healthy, 2 * seed, force)
    after, open_time = records(portal, crack, 2 * seed + 1, force)
    records.cache_clear()
    x, y, z = portal.at("left", crack.place)
    truth = {"share": crack.share(open_time), "open_time": open_time}
    both = {"cell": cell, "seed": seed, "noise": noise, "kind": "detectable", "true": truth}
    done = f"{kind}, {force}, {1000 * crack.opened:.0f} mm at {1000 * z:.0f} mm"
    start = time.process_time()
    try:
        observed = observe(before), observe(after)
        start = time.process_time()
        found = explain(portal.file(), *observed).diagnosis.model_dump(mode="json")
    except (UpdaterError, OmaError, StateError) as error:
        return Result.model_validate(both | {"outcome": "refused", "reported": str(error), "done": done})
    seconds = time.process_time() - start
    scored = score(found, [Hidden(cause="local_stiffness", position=(x, y, z))], "detectable", near=_NEAR)
    breathing = found["causes"][0]["breathing"] if len(found["causes"]) == 1 and scored.outcome == RIGHT else None
    known = {name: breathing[name] for name in truth if breathing[name]} if breathing else {}
    closes = breathing is not None and breathing["p_value"] < BREATHES
    return Result.model_validate(
        both
        | {
            "outcome": scored.outcome,
            "reported": scored.reported + _CLOSES * closes,
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
    """Return how many cracks are stated to open and close, of those that are named in their place."""
    rows = ["| crack | draws | named alone, in place | opens and closes |", "|:--|---:|---:|---:|"]
    for kind in _KINDS:
        own = [r for r in results if r.cell == f"breathing: {kind}"]
        right = [r for r in own if r.outcome == RIGHT]
        rows.append(f"| {kind} | {len(own)} | {len(right)} | {sum(r.reported.endswith(_CLOSES) for r in right)} |")
    return "\n".join(rows)


def main() -> int:
    """Run the missing draws and print the tables of docs/validation/diagnosis/breathing.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="after which to stop and report")
    parser.add_argument("--file", type=Path, default=Path("confusion_breathing.jsonl"))
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    seeds = range(given.seed, given.seed + given.draws)
    tasks = [(f"breathing: {_KINDS[seed % len(_KINDS)]}", seed, "records of 180 s") for seed in seeds]
    done = run(judged, tasks, given.file, minutes=given.minutes, processes=given.processes)
    print(f"{tables(done)}\n\n{_closing(done)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
