"""`identify` with a file of frequency responses: table, JSON, folder; clear errors."""

import json
from pathlib import Path

import numpy as np
import pytest
import pyuff
from PIL import Image

from daq.files import read_responses
from tests.support.daq.tower_file import DECAY, write_tower
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.oma.impact_test import CHANNELS, tower

MASTS = """
name = "mast"
[material.steel]
youngs_modulus = 210e9
shear_modulus = 80e9
density = 7850
[section.bar]
area = 4e-3
second_moment = [1.6e-5, 1.7e-5]
torsion_constant = 3e-6
[[member]]
name = "mast"
from = [0, 0, 0]
to = [0, 0, 4]
material = "steel"
section = "bar"
elements = 8
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]
""" + "".join(
    f'[[sensor]]\nchannel = "{node}_{axis}"\nat = [0, 0, {node}]\ndirection = {way}\n'
    for node in (2, 4)
    for axis, way in (("x", "[1, 0, 0]"), ("y", "[0, 1, 0]"))
)


@pytest.fixture
def modalwatch(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Commands:
    return Commands(monkeypatch, capsys)


@pytest.fixture(scope="module")
def hammer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("hammer") / "hammer.uff"
    write_tower(path)
    return path


def test_modes_masses_and_pictures_of_responses(modalwatch: Commands, hammer: Path, tmp_path: Path) -> None:
    folder, picture = tmp_path / "modes", tmp_path / "modes.png"
    done = modalwatch(
        "identify", hammer, "--exponential-window", DECAY, "--band", 2, 40, "--out", folder, "--picture", picture
    )
    assert done.code == 0, done
    assert "modal mass [kg]" in done.out
    truth, content = tower(), json.loads((folder / "modes.json").read_text())
    assert len(content["modes"]) == 4
    for mode, frequency, damping, shape in zip(
        content["modes"], truth.frequency[:4], truth.damping[:4], truth.shape[:4], strict=True
    ):
        for key, exact in (("frequency", frequency), ("damping", damping), ("modal_mass", 1 / np.sum(shape**2))):
            assert abs(mode[key]["value"] - exact) < 5 * mode[key]["std"], (key, exact)
    assert content["agreement"]["4_x"]["4_x"] > 0.999
    assert content["method"]["weighted_by_coherence"]
    assert content["method"]["header"]["description"] == "hammer test of a tower"
    assert "coherence: weight of lines and responses; lowest median 0.86" in done.out
    assert "header of the file: hammer test of a tower, modalwatch, " in done.out
    measured, source = read_responses(folder / "responses.unv"), read_responses(hammer)
    np.testing.assert_allclose(measured.response, source.response, rtol=1e-5)
    synthesis = read_responses(folder / "synthesis.unv")
    inside = (source.frequency > 2) & (source.frequency < 40)
    left = (synthesis.response - source.response)[inside]
    assert np.linalg.norm(left) < 0.05 * np.linalg.norm(source.response[inside])
    for name in ("stabilization.png", "responses.png", "mac.png", "shapes.png", "complexity.png"):
        with Image.open(folder / name) as drawn:
            assert len(np.unique(np.asarray(drawn.convert("L")))) > 10, name
    with Image.open(picture) as drawn:
        assert drawn.size == (1540, 990)
    sets = pyuff.UFF(str(folder / "modes.unv")).read_sets()
    assert [s["type"] for s in sets] == [151, 15, 82] + [55] * 4
    sets = sets[1:]
    top = np.hypot(truth.shape[0, CHANNELS.index("4_x")], truth.shape[0, CHANNELS.index("4_y")])
    k = list(sets[2]["node_nums"]).index(4)
    assert abs(np.hypot(abs(sets[2]["r1"][k]), abs(sets[2]["r2"][k])) / top - 1) < 0.01  # mass-normalised


def test_responses_are_compared_with_a_structure(modalwatch: Commands, hammer: Path, tmp_path: Path) -> None:
    (tmp_path / "mast.toml").write_text(MASTS, encoding="utf-8")
    arguments = ("identify", hammer, "--exponential-window", DECAY, "--band", 2, 75, "--structure")
    done = modalwatch(*arguments, tmp_path / "mast.toml", "--json", "-")
    assert done.code == 0, done
    modes = json.loads(done.out)["modes"]
    assert set(modes[0]["shape"]) == {"2_x", "4_x", "2_y", "4_y"}
    assert modes[0]["quality"]["model"]["mac"] > 0.9


def test_arguments_that_do_not_fit_are_refused(modalwatch: Commands, hammer: Path, tmp_path: Path) -> None:
    assert_refused(modalwatch("identify", hammer, hammer), "expected one file of frequency responses, found 2 files")
    assert_refused(modalwatch("identify", hammer, "--window", 10), "--window: expected a log, found frequency resp")
    assert_refused(modalwatch("identify", hammer, "--from", 10), "--from: expected a log")
    assert_refused(modalwatch("identify", hammer, "--exponential-window", 0), "expected a positive time in s, found 0")
    (tmp_path / "log.mcap").write_bytes(b"")
    refused = modalwatch("identify", tmp_path / "log.mcap", "--exponential-window", 1)
    assert_refused(refused, "--exponential-window: expected frequency responses (.uff, .unv), found")
    (tmp_path / "none.uff").write_text("t,a\n")
    assert_refused(modalwatch("identify", tmp_path / "none.uff"), "none.uff: holds no frequency response")
    assert_refused(
        modalwatch("identify", hammer, "--animate", tmp_path / "a.html"), "expected a structure (--structure)"
    )


def test_record_that_is_cut_is_remarked(modalwatch: Commands, tmp_path: Path) -> None:
    """Without the window, the motion at the end of 8 s is that of the tower: 11 % of the first mode's."""
    from tests.support.daq.responses import frequency_response
    from tests.support.oma.impact_test import ImpactTest

    line, response = ImpactTest().h1(tower(), 1, (3,))
    sets = [
        frequency_response(response[1:, k, 0], line[1:], rsp_node=int(name[0]), rsp_dir=1, ref_node=4, ref_dir=1)
        for k, name in enumerate(CHANNELS[:4])
    ]
    pyuff.UFF(str(tmp_path / "cut.uff")).write_sets(sets, "overwrite")
    done = modalwatch("identify", tmp_path / "cut.uff", "--band", 2, 40)
    assert done.code == 0, done
    assert "coherence: none in the file; all lines weighted equally" in done.out
    assert "mode 1 has 11 % of its motion left at the end of a record of 8 s" in done.out
