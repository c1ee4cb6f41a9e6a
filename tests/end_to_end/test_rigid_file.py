"""Diagnosis with a file whose feet are rigid, of a portal whose feet yield: its first mode is far below the file's."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daq import write_recording
from tests.end_to_end.test_loose_foot import RATE, record
from tests.support.monitor.cli import Commands
from tests.support.portals.tube_portal import LEFT, Portal
from tests.support.thorough import few_of

PORTAL = Portal(across=0.025, along=0.02, wall=0.002, height=0.9, width=1.2)
SEED, RIGHT = 4, 700.0  # N m/rad, from 2000
SECONDS = 168  # nine windows by the first mode of the file


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the file and of records before and after."""
    print(f"seed {SEED}")
    folder = tmp_path_factory.mktemp("rigid")
    (folder / "structure.toml").write_text(PORTAL.file_text(rigid=True), encoding="utf-8")
    for name, foot in (("before", LEFT), ("now", RIGHT)):
        one = record(PORTAL, foot, SEED)
        channels = tuple(replace(channel, axis=k) for k, channel in enumerate(one.channels))
        write_recording(folder / f"{name}.mcap", replace(one, channels=channels, data=one.data[: SECONDS * RATE]))
    return folder


def diagnosed(modalwatch: Commands, folder: Path, *more: object, reference: bool = True) -> tuple[str, float]:
    """Return the output of `diagnose` of both records, and the lowest frequency that it measured."""
    before = ["--reference", folder / "before.mcap"] if reference else []
    logs = folder / "now.mcap", *before, "--json", folder / "found.json", "--force"
    done = modalwatch("diagnose", folder / "structure.toml", *logs, *more)
    print(done.out, done.err)
    modes = json.loads((folder / "found.json").read_text(encoding="utf-8"))["modes"]
    return " ".join(done.out.split()), min(mode["frequency"]["measured"] or np.inf for mode in modes)


@pytest.mark.parametrize(
    ("reference", "only"),
    few_of([(True, ["--only", "support_stiffness"]), (False, ["--only", "model_parameters"]), (True, [])]),
)
def test_the_lowest_mode_is_found_by_default(
    modalwatch: Commands, folder: Path, reference: bool, only: list[str]
) -> None:
    """In the windows by the first mode of the file (19 s) it has 97 periods, of which it is not sought."""
    out, lowest = diagnosed(modalwatch, folder, *only, reference=reference)
    assert "not found" not in out
    assert (
        f"support stiffness at the foot of the right post, ({PORTAL.width:.3f}, 0.000, 0.000) m" in out or not reference
    )
    assert lowest == pytest.approx(PORTAL.modes(RIGHT)[0][0], rel=0.005)


def test_a_mode_that_the_window_is_too_short_for_is_named(modalwatch: Commands, folder: Path) -> None:
    out, _ = diagnosed(modalwatch, folder, "--window", 18, "--only", "support_stiffness")
    first = PORTAL.modes(LEFT)[0][0]
    assert "note: 1 mode of the reference logs not found in the current ones (" in out
    assert "Repeat with windows twice as long (--window), or record longer." in out
    assert first * 18 > 100 > PORTAL.modes(RIGHT)[0][0] * 18
