"""The pages for users of other programs: the same task in both gives the same modes."""

import json
import os
import runpy
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.common.peers import ENVIRONMENT
from daq import export_recording, read_data
from oma import ModalEstimate, identify, mac
from tests.support.monitor.cli import Commands
from tests.support.snippets import code_blocks, shell_lines

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "docs" / "howto" / "from"
N_MODES = 7  # in the band of modalwatch
SAVE = '\nnp.savez("modes.npz", frequency=frequency, damping=damping, shape=shape)'

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def portal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the tables of the example and its structure file."""
    folder = tmp_path_factory.mktemp("portal")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["portal_tables.py", str(folder)])
        runpy.run_path(str(ROOT / "examples" / "portal_tables.py"))
    (line,) = (line for line in shell_lines(ROOT / "docs/get_started/data.md") if "new structure" in line)
    program = [sys.executable, "-c", "from monitor.cli.main import main; main()"]
    subprocess.run([*program, *shlex.split(line)[1:]], cwd=folder, check=True)
    return folder


@pytest.fixture(scope="module")
def modes(portal: Path) -> ModalEstimate:
    return identify(read_data(str(portal / "before.csv")))  # as text, as in the pages


def test_page_of_pyoma2_has_the_identified_modes(
    portal: Path, modes: ModalEstimate, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(portal)
    found: dict[str, object] = {}
    exec(code_blocks(PAGES / "pyoma2.md")[1], found)
    np.testing.assert_array_equal(found["frequency"], modes.frequency)
    rows = [line.split("|") for line in (PAGES / "pyoma2.md").read_text().splitlines() if "±" in line]
    assert len(rows) == len(modes.frequency) == N_MODES
    for row, frequency, damping in zip(rows, modes.frequency, modes.damping, strict=True):
        for cell, value in ((row[3], frequency), (row[5], 100 * damping)):
            stated, deviation = map(float, cell.split("±"))
            assert abs(value - stated) <= 0.1 * deviation  # rounding


@pytest.mark.skipif(not (ENVIRONMENT / ".done").exists(), reason="pyOMA2 is not installed: make bench-log-speed does")
def test_pyoma2_finds_the_same_modes(portal: Path, modes: ModalEstimate) -> None:
    code = code_blocks(PAGES / "pyoma2.md")[0] + SAVE
    environment = os.environ | {"PYTHONPATH": "", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run([ENVIRONMENT / "bin" / "python", "-c", code], cwd=portal, env=environment, check=True)
    theirs = np.load(portal / "modes.npz")
    assert theirs["frequency"].shape == (N_MODES + 2,)
    for k in range(N_MODES):  # of the same data: the scatter of a method is part of the deviation of either
        assert abs(theirs["frequency"][k] - modes.frequency[k]) < 4 * modes.frequency_std[k]
        assert abs(theirs["damping"][k] - modes.damping[k]) < 4 * modes.damping_std[k]
        assert mac(theirs["shape"][k], modes.shape[k]) > 0.99


def test_universal_file_of_time_responses_gives_the_same_modes(
    portal: Path, modes: ModalEstimate, modalwatch: Commands, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(portal)
    export_recording("measured.uff", read_data("before.csv"))
    assert modalwatch("import", "measured.uff", "--out", "measured.mcap").code == 0
    assert modalwatch("identify", "measured.mcap", "--out", "modes").code == 0
    found = json.loads(Path("modes/modes.json").read_text())["modes"]
    np.testing.assert_allclose([mode["frequency"]["value"] for mode in found], modes.frequency, rtol=1e-5)
    assert Path("modes/modes.unv").stat().st_size > 0


def test_model_is_updated_from_one_test(portal: Path, modalwatch: Commands, monkeypatch: pytest.MonkeyPatch) -> None:
    """The block that examples/portal_tables.py clamps on is an error of the model, as there is no reference."""
    monkeypatch.chdir(portal)
    assert modalwatch("import", "after.csv", "--out", "after.mcap").code == 0
    assert modalwatch("diagnose", "structure.toml", "after.mcap", "--out", "found").code == 0
    (cause,) = json.loads(Path("found/diagnosis.json").read_text())["causes"]
    assert cause["cause"] == "added_mass"
    assert "[[body]]" in Path("found/structure_extended.toml").read_text()
