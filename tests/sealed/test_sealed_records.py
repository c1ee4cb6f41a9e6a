"""Sealed cases from accelerations through the command: recorded, logged, read, identified, tracked, diagnosed."""

import json
from pathlib import Path

import numpy as np
import pytest
from cli_helpers import Commands
from sealed_cases import Case, draw
from sealed_score import score
from sealed_signals import recorded
from sealed_solid import STRUCTURE as BAR

from daq import write_recording
from updater import t_structure_toml

SECONDS = 120.0
CASES = [
    ("nothing", 401),
    ("added_mass", 401),
    ("sensor_delay", 401),
    ("solid: local_stiffness", 402),
]


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where logs from before are kept for all cases of a specimen."""
    return tmp_path_factory.mktemp("sealed")


def log_of(case: Case, folder: Path, when: str) -> Path:
    """Record before or after; the state before is every case's of a specimen, but for one who takes something off."""
    name = f"{case.cell.replace(': ', '-')}-{when}" if when == "after" else f"{case.seed}-{when}"
    path = folder / f"{name}.mcap"
    if not path.exists():
        state = case.done.after if when == "after" else case.done.before
        random = np.random.default_rng((case.seed, 7, len(path.name) if when == "after" else 0))
        write_recording(path, recorded(state, SECONDS, random))
    return path


@pytest.mark.parametrize(("cell", "seed"), CASES)
def test_what_was_done_is_what_is_said(logs: Path, modalwatch: Commands, cell: str, seed: int) -> None:
    """Fixed seeds; benchmarks/confusion_records.py draws others, and says how often this fails."""
    case = draw(cell, seed)
    print(cell, seed, case.done.hidden)
    structure, answer = logs / "structure.toml", logs / "answer.json"
    structure.write_text(BAR if cell.startswith("solid") else t_structure_toml(), encoding="utf-8")
    before, after = log_of(case, logs, "before"), log_of(case, logs, "after")
    code = modalwatch("diagnose", structure, after, "--reference", before, "--json", answer).code
    found = json.loads(answer.read_text(encoding="utf-8"))
    assert code == (0 if found["verdict"] in {"explained", "nothing_to_explain"} else 1)
    judged = score(found, case.done.hidden, case.kind)
    assert judged.fine, judged
