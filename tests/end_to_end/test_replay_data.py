"""The recorded log of the repository: it opens, repeats the live results, and agrees with its manifest."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq import read_attachments
from monitor.results.windows import WindowResult
from monitor.service.replay import ReplayReport, replay
from monitor.settings import parse_settings
from monitor.watch.commissioning import gather, prove
from monitor.watch.memory import parse_memory
from updater import parse_structure

FOLDER = Path(__file__).parents[2] / "replay_data"
LOGS = tomllib.loads((FOLDER / "manifest.toml").read_text(encoding="utf-8"))["log"]


@pytest.fixture(scope="module", params=LOGS, ids=[entry["file"] for entry in LOGS])
def replayed(request: pytest.FixtureRequest) -> tuple[dict[str, Any], ReplayReport]:
    """Return the manifest of a log, and its replay."""
    return request.param, replay(FOLDER / request.param["file"], None, lambda _: None)


def test_replay_repeats_the_live_run_and_finds_the_mass(replayed: tuple[dict[str, Any], ReplayReport]) -> None:
    """Other processors round differently.

    Where the analysis was changed, the log is recorded again by `replay_data/make.py`.
    """
    entry, report = replayed
    assert report.comparison.kind != "different", report.comparison.text
    live = [r for r in report.logged if isinstance(r, WindowResult)]
    found = [r for r in report.found if isinstance(r, WindowResult)]
    assert len(live) == len(found)
    answer = [w.answer for w in found if w.answer][-1]
    assert np.linalg.norm(np.subtract(answer.position, entry["position"])) < 0.10
    assert answer.mass == pytest.approx(entry["mass"], rel=0.15)


def test_commissioning_with_the_recorded_mass_passes(replayed: tuple[dict[str, Any], ReplayReport]) -> None:
    """The rig's frame differs from the model; its mass is found within the stated deviation, and scales the modes.

    The rig draws its density within 1 % of the model's, and its modes differ from the model's by as much again.
    """
    entry, report = replayed
    attached = read_attachments(FOLDER / entry["file"])
    structure, settings = parse_structure(attached["structure.toml"]), parse_settings(attached["site.toml"])
    evidence = gather(parse_memory(report.memory), structure, settings)
    proof = prove(evidence, entry["mass"], entry["position"])
    assert proof.passed, proof.checks
    assert len(proof.scales) >= 4
    assert proof.modal_mass is not None
    mean, std = proof.modal_mass
    assert std < 0.05
    assert abs(mean - 1.0) < 3 * std + 0.02
    heavier = prove(evidence, 2 * entry["mass"], entry["position"])
    assert [check.what for check in heavier.checks if not check.passed] == ["mass"]
    elsewhere = prove(evidence, entry["mass"], (0.0, 0.0, 0.5))
    assert [check.what for check in elsewhere.checks if not check.passed] == ["place"]
