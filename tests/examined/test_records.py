"""Sealed cases from accelerations through the command: recorded, logged, read, identified, tracked, diagnosed."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daq import Recording, write_recording
from tests.examiner.cases import Case, draw
from tests.examiner.models.solid import STRUCTURE as BAR
from tests.examiner.models.specimen import State
from tests.examiner.score import score
from tests.examiner.signals import recorded
from tests.support.monitor.cli import Commands
from tests.support.thorough import few_of
from updater import t_structure_toml

SECONDS = 120.0
CASES = [
    ("added_mass", 401),
    ("solid: local_stiffness", 402),
    ("nothing", 401),
    ("sensor_delay", 401),
]


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of logs from before for all cases of a specimen."""
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


@pytest.mark.thorough
@pytest.mark.parametrize("share", few_of([0.004, 0.1]))
def test_overdriven_channels_are_not_diagnosed_as_cause(logs: Path, modalwatch: Commands, share: float) -> None:
    """Nothing changed; a tone 1 % from a mode clips the two loudest channels in the current record only."""
    case = draw("nothing", 401)
    structure, answer = logs / "structure.toml", logs / "answer.json"
    structure.write_text(t_structure_toml(), encoding="utf-8")
    before, after = log_of(case, logs, "before"), logs / f"overdriven-{share:g}.mcap"
    recording = overdriven(case.done.after, recorded(case.done.after, SECONDS, np.random.default_rng(8)), share)
    write_recording(after, recording)
    done = modalwatch("diagnose", structure, after, "--reference", before, "--json", answer, "--force")
    assert json.loads(answer.read_text(encoding="utf-8"))["verdict"] == "nothing_to_explain", done.out
    assert done.code == 0
    assert ("left out: clipped" in done.out) == (share > 0.02)


def overdriven(state: State, recording: Recording, share: float) -> Recording:
    """Add a tone that the structure amplifies, and clip that share of the samples of the two loudest channels."""
    motion = state.motion(16)
    mode = int(np.argmax(motion.frequency > 20.0))
    tone = np.sin(2 * np.pi * 1.012 * motion.frequency[mode] * np.arange(len(recording.data)) / recording.rate)
    shape = (motion.at_sensors[mode] * state.gain)[state.order]
    data = recording.data + 6 * recording.data.std(axis=0).max() / np.abs(shape).max() * np.outer(tone, shape)
    for channel in np.argsort(-np.abs(data).max(axis=0))[:2]:
        limit = np.quantile(np.abs(data[:, channel]), 1 - share)
        data[:, channel] = np.clip(data[:, channel], -limit, limit)
    return replace(recording, data=data)


@pytest.mark.thorough
@pytest.mark.parametrize(("cell", "seed"), few_of(CASES))
def test_diagnosis_from_records_matches_the_applied_change(
    logs: Path, modalwatch: Commands, cell: str, seed: int
) -> None:
    """Fixed seeds; benchmarks/updater/confusion/records.py draws others, and measures the failure rate."""
    case = draw(cell, seed)
    print(cell, seed, case.done.hidden)
    structure, answer = logs / "structure.toml", logs / "answer.json"
    structure.write_text(BAR if cell.startswith("solid") else t_structure_toml(), encoding="utf-8")
    before, after = log_of(case, logs, "before"), log_of(case, logs, "after")
    code = modalwatch("diagnose", structure, after, "--reference", before, "--json", answer, "--force").code
    found = json.loads(answer.read_text(encoding="utf-8"))
    assert code == (0 if found["verdict"] in {"explained", "nothing_to_explain"} else 1)
    judged = score(found, case.done.hidden, case.kind)
    assert judged.fine, judged
