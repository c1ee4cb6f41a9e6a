"""The notebooks and pages of Python: each runs from its first to its last piece of code, with the expected result."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq import export_recording, load_recordings, read_attachments
from monitor.views.run import load_run
from tests.support.snippets import code_blocks, code_cells, run_cells

ROOT = Path(__file__).parents[2]
NOTEBOOKS = ROOT / "examples" / "notebooks"
MAX_CELLS = 12
TRUTH = tomllib.loads((ROOT / "replay_data" / "manifest.toml").read_text(encoding="utf-8"))["log"][0]


@pytest.fixture
def notebook_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Change to a folder that has the replay data where the notebooks look for them."""
    (tmp_path / "replay_data").symlink_to(ROOT / "replay_data")
    (tmp_path / "examples" / "notebooks").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "examples" / "notebooks")


def run(name: str) -> dict[str, Any]:
    return run_cells(code_cells(NOTEBOOKS / name))


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda path: path.name)
def test_notebook_is_short_and_has_no_outputs(path: Path) -> None:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    assert len(cells) < MAX_CELLS
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


@pytest.mark.usefixtures("notebook_folder")
def test_identify() -> None:
    found = run("identify.ipynb")
    baseline = load_run(ROOT / "replay_data" / TRUTH["file"]).results.reference
    assert baseline is not None
    estimate = found["found"].estimate
    for mode in baseline.modes:
        k = np.abs(estimate.frequency - mode.frequency).argmin()
        # the monitor used other windows: the deviation of the difference is larger than the stated one
        assert abs(estimate.frequency[k] - mode.frequency) < 6 * estimate.frequency_std[k]


@pytest.mark.usefixtures("notebook_folder")
def test_diagnose() -> None:
    found = run("diagnose.ipynb")
    (cause,) = found["found"].diagnosis.causes
    mass = cause.parameters["mass"]
    assert cause.cause == "added_mass"
    assert abs(mass.value - TRUTH["mass"]) < 3 * mass.std
    assert len(found["extended"].body) == len(found["structure"].body) + 1


@pytest.mark.usefixtures("notebook_folder", "undrawn")
def test_watch() -> None:
    found = run("watch.ipynb")
    answer, rocking = found["answer"], found["rocking"]
    assert abs(answer.mass - TRUTH["mass"]) < 3 * answer.mass_std
    before, after = (rocking[found["changed"] == state].frequency.mean() for state in (False, True))
    assert after / before == pytest.approx(0.990, abs=0.002)  # 20 standard deviations of a mean over windows
    assert "added on the crossbeam" in Path("report.html").read_text(encoding="utf-8")


@pytest.mark.thorough
def test_page_on_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The code of other programs is left out; the rest is executed where the page has its files."""
    page = ROOT / "docs" / "get_started" / "python.md"
    log = ROOT / "replay_data" / TRUTH["file"]
    monkeypatch.chdir(tmp_path)
    Path("measured.mcap").symlink_to(log)
    Path("structure.toml").write_text(read_attachments(log)["structure.toml"], encoding="utf-8")
    recording = next(load_recordings(log, window_seconds=9))
    export_recording(Path("with_origin.csv"), recording)
    lines = Path("with_origin.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    Path("measured.csv").write_text("".join(line for line in lines if not line.startswith("#")), encoding="utf-8")
    ours = [block for block in code_blocks(page) if "pyoma2" not in block]
    assert len(ours) == 7
    found = run_cells(ours)
    assert (tmp_path / "mac.png").stat().st_size > 10_000
    np.testing.assert_allclose(found["recording"].data, 9.80665 * recording.data, rtol=1e-6, atol=1e-9)
    (cause,) = found["result"].diagnosis.causes
    assert abs(cause.parameters["mass"].value - TRUTH["mass"]) < 3 * cause.parameters["mass"].std
    assert len(page.read_text(encoding="utf-8").split()) < 900
