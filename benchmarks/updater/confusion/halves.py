"""Answers without reference logs from each half of a record and from the whole: do they agree, and are they right.

Specimens of the independent finite element code, none as in its file: moduli, density, walls, feet, joints, masses of
sensors. Cells are those of "built": no change, or a change beyond the errors of the file; "rigid" has the same
specimens, and a file with rigid feet and joints. Eight windows are drawn; the halves are four each.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/updater/confusion/halves.py [--draws N] [--seed S] [--minutes M]
[--cells CELL ...] [--file FILE], or make bench-halves
"""

import argparse
import json
import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.updater.confusion.run import seed_of
from benchmarks.updater.confusion.table import version
from monitor.analysis.explanation import explain
from monitor.errors import StateError
from tests.examiner.cases import Case, draw
from tests.examiner.path import observation, structure_of
from tests.examiner.score import score
from tests.examiner.signals import estimated
from updater import Structure
from updater.errors import UpdaterError

CELLS = (
    *(f"{file} {name}: nothing" for file, name in (("built", "frame"), ("built", "portal"), ("rigid", "portal"))),
    *("built mast: nothing", "built bridge: nothing"),
    *(f"{file} portal: {name}" for file in ("built", "rigid") for name in ("added_mass", "local_stiffness")),
)
_WINDOWS = 8
_PARTS = {"whole": slice(None), "first": slice(None, _WINDOWS // 2), "second": slice(_WINDOWS // 2, None)}
_SAME_PLACE = 0.10  # of the length of the structure, as in the matrices
_TURNS = ("rx", "ry", "rz")


def with_rigid_connections(structure: Structure) -> Structure:
    """Return a structure whose feet do not turn, and whose members are joined rigidly."""
    supports = tuple(
        support.model_copy(
            update={
                "fixed": (*support.fixed, *(axis for axis in support.stiffness if axis in _TURNS)),
                "stiffness": {axis: k for axis, k in support.stiffness.items() if axis not in _TURNS},
            }
        )
        for support in structure.support
    )
    return structure.model_copy(update={"support": supports, "joint": ()})


def answers(cell: str, seed: int) -> dict[str, Any]:
    """Return the answers of the halves and of the whole record, as JSON would hold them, with their scores."""
    rigid = cell.startswith("rigid ")
    case = draw(cell.replace("rigid ", "built "), seed)
    structure = structure_of(case.cell)
    structure = with_rigid_connections(structure) if rigid else structure
    windows = estimated(case.done.after, _WINDOWS, np.random.default_rng((seed, 16)), noise="law")
    found: dict[str, Any] = {"cell": cell, "seed": seed}
    for part, of in _PARTS.items():
        start = time.process_time()
        try:
            answer = explain(structure, None, observation(case.done.after, windows[of])).diagnosis.model_dump(
                mode="json"
            )
        except (UpdaterError, StateError) as error:
            found[part] = {"verdict": f"error: {error}", "leading": [], "outcome": "refused", "right": None}
        else:
            found[part] = judged(answer, case)
        found[part]["seconds"] = time.process_time() - start
    found["same"] = {part: _same(found["whole"], found[part], case.near) for part in ("first", "second")}
    return found


def judged(answer: dict[str, Any], case: Case) -> dict[str, Any]:
    """Return the first set of causes with its probability, and whether it and the answer are right.

    All parameters of the file are off: the first set is right if it has them and, beyond them, the change alone.
    """
    causes = [c for c in answer["causes"] if c["probability"] == answer["causes"][0]["probability"]]
    leading = [
        {"cause": c["cause"], "at": (c["where"] or {}).get("position"), "probability": c["probability"]} for c in causes
    ]
    result = score(answer, case.done.hidden, case.kind, near=case.near, built=True)
    alone = score(
        {**answer, "verdict": "explained", "causes": [{**c, "cannot_be_told_from": []} for c in causes]},
        case.done.hidden,
        case.kind,
        near=case.near,
        built=True,
    )
    names = {c["cause"] for c in leading}
    unchanged = answer["verdict"] == "nothing_to_explain"
    of_file = "model_parameters" in names and not names & {"joint_stiffness", "support_stiffness"}
    right = None if not leading else of_file and alone.fine
    return {
        "verdict": answer["verdict"],
        "leading": leading,
        "all": [c["cause"] for c in answer["causes"]],
        "outcome": result.outcome,
        "right": True if unchanged and case.kind == "nothing" else right,
    }


def _same(one: dict[str, Any], other: dict[str, Any], near: float) -> bool:
    """Return whether the first answers are the same causes at the same places."""
    first, second = ({(c["cause"], tuple(c["at"] or ())) for c in part["leading"]} for part in (one, other))
    if sorted(name for name, _ in first) != sorted(name for name, _ in second):
        return False
    return all(any(a == b and (not p or np.linalg.norm(np.subtract(p, q)) < near) for b, q in second) for a, p in first)


def table(done: Sequence[dict[str, Any]]) -> str:
    """Return counts of each cell: halves that agree with the whole, first answers that are right, and probabilities."""
    by_cell = defaultdict(list)
    for one in done:
        by_cell[one["cell"]].append(one)
    lines = ["| | draws | halves that agree | right: whole | right: halves | stated: whole | stated: halves |"]
    lines.append("|:--|--:|--:|--:|--:|--:|--:|")
    for cell, draws in [*by_cell.items(), ("all", list(done))]:
        halves = [one[part] for one in draws for part in ("first", "second")]
        wholes = [one["whole"] for one in draws]
        agree = sum(one["same"][part] for one in draws for part in ("first", "second"))
        cells = [cell, len(draws), f"{agree} of {len(halves)}"]
        cells += [f"{sum(bool(p['right']) for p in parts)} of {len(parts)}" for parts in (wholes, halves)]
        cells += [_stated(parts) for parts in (wholes, halves)]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def _stated(parts: Sequence[dict[str, Any]]) -> str:
    """Return the mean stated probability of first answers, and how many of those over 95 % are right."""
    pairs = [(p["leading"][0]["probability"], bool(p["right"])) for p in parts if p["leading"]]
    if not pairs:
        return ""
    sure = [right for probability, right in pairs if probability > 0.95]
    return f"{np.mean([p for p, _ in pairs]):.3f} ({sum(sure)} of {len(sure)})"


def main() -> int:
    """Run the missing draws and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=12, help="of each cell")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="after which to stop and report")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cells", nargs="+", default=CELLS)
    parser.add_argument("--file", type=Path, default=Path("halves.jsonl"))
    given = parser.parse_args()
    code, start = version(), time.monotonic()
    tasks = [(cell, seed_of(cell, given.seed) + i) for i in range(given.draws) for cell in given.cells]
    lines = given.file.read_text(encoding="utf-8").splitlines() if given.file.exists() else []
    done = [one for one in map(json.loads, lines) if one["version"] == code and (one["cell"], one["seed"]) in tasks]
    have = {(one["cell"], one["seed"]) for one in done}
    with given.file.open("a", encoding="utf-8") as out:
        for cell, seed in (task for task in tasks if task not in have):
            if time.monotonic() - start > 60 * given.minutes:
                break
            done.append({"version": code, **answers(cell, seed)})
            print(json.dumps(done[-1]), file=out, flush=True)
    print(f"seed {given.seed}\n\n{table(done)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
