"""Tables of an unknown T-frame, from import to verdict: the truth is drawn here and is not given to the program."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq import Recording
from tests.measured.accelerometers import Rig, swapped, write_csv
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.thorough import few_of
from updater import Body, build_model, load_structure, t_structure_toml

SECONDS, RATE = 120.0, 500.0
SEED = 4711


@pytest.fixture(scope="module")
def before(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The structure file and a table of the rig as it was."""
    print(f"seed {SEED}")
    path = tmp_path_factory.mktemp("csv")
    (path / "structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    write_csv(path / "before.csv", Rig(seed=SEED).record(0, SECONDS, rate=RATE))
    return path


@pytest.fixture
def folder(before: Path, modalwatch: Commands) -> Path:
    """With the log of that table."""
    if not (before / "before.mcap").exists():
        assert modalwatch("import", before / "before.csv", "-o", before / "before.mcap").code == 0
    return before


Diagnose = Callable[..., tuple[int, dict[str, Any]]]


@pytest.fixture
def diagnosed(folder: Path, modalwatch: Commands) -> Diagnose:
    def command(name: str, recording: Recording, *, drawn: bool = False) -> tuple[int, dict[str, Any]]:
        table, log, out = folder / f"{name}.csv", folder / f"{name}.mcap", folder / name
        write_csv(table, recording)
        assert modalwatch("import", table, "-o", log).code == 0
        answer = out / "diagnosis.json" if drawn else folder / f"{name}.json"
        wanted = ("--out", out) if drawn else ("--json", answer)
        code = modalwatch(
            "diagnose", folder / "structure.toml", log, "--reference", folder / "before.mcap", *wanted
        ).code
        assert (out / "report.html").exists() == drawn
        return code, json.loads(answer.read_text(encoding="utf-8"))

    return command


def test_identified_modes_match_the_rig(folder: Path, modalwatch: Commands) -> None:
    out = folder / "modes.json"
    named = ("--structure", folder / "structure.toml", "--json", out, "--window", "25")
    assert modalwatch("identify", folder / "before.mcap", *named).code == 0
    found = json.loads(out.read_text(encoding="utf-8"))["modes"]
    true = build_model(Rig(seed=SEED).structure(), shear_flexible=True, mass="consistent").modes(12).frequency
    assert len(found) >= 6
    for mode in (
        mode for mode in found if not mode["quality"]["may_be_alias"]
    ):  # the rig has modes above half the rate
        frequency, std = mode["frequency"]["value"], mode["frequency"]["std"]
        assert np.abs(true - frequency).min() < 4 * std


@pytest.mark.thorough
@pytest.mark.usefixtures("undrawn")
def test_body_of_300_g_is_diagnosed(diagnosed: Diagnose) -> None:
    random = np.random.default_rng(SEED)
    x, side = random.uniform(-0.35, 0.35), random.uniform(-0.02, 0.02)
    body = Body(at=(x, 0, 1.48), mass=0.3, offset=(0, side, 0.02), inertia=(1e-4, 1e-4, 1e-4))
    code, found = diagnosed("body", Rig(seed=SEED, body=(body,)).record(1, SECONDS, rate=RATE), drawn=True)
    assert (code, found["verdict"]) == (0, "explained")
    (cause,) = found["causes"]
    assert cause["cause"] == "added_mass"
    assert np.linalg.norm(np.subtract(cause["where"]["position"], (x, 0, 1.48))) < 0.05
    assert cause["parameters"]["mass"]["value"] == pytest.approx(0.3, rel=0.1)
    extended = load_structure(found["extended_model"])
    assert extended.body[0].mass == pytest.approx(cause["parameters"]["mass"]["value"], rel=0.05)


@pytest.mark.thorough
def test_loosened_foot_is_diagnosed(diagnosed: Diagnose) -> None:
    code, found = diagnosed("foot", Rig(seed=SEED, foot=(0.4, 0.4, 0.4)).record(2, SECONDS, rate=RATE))
    assert (code, found["verdict"]) == (0, "explained")
    assert [cause["cause"] for cause in found["causes"]] == ["support_stiffness"]
    assert found["causes"][0]["where"]["position"] == [0, 0, 0]


@pytest.mark.thorough
def test_swapped_channels_are_diagnosed(diagnosed: Diagnose) -> None:
    recording = swapped(Rig(seed=SEED).record(3, SECONDS, rate=RATE), "col_037_x", "col_111_x")
    code, found = diagnosed("swap", recording)
    assert (code, found["verdict"]) == (0, "explained")
    assert [cause["cause"] for cause in found["causes"]] == ["sensor_swap"]
    assert set(found["causes"][0]["where"]["channels"]) == {"col_037_x", "col_111_x"}


@pytest.mark.thorough
@pytest.mark.usefixtures("undrawn")
def test_unchanged_structure_has_no_causes(diagnosed: Diagnose) -> None:
    code, found = diagnosed("nothing", Rig(seed=SEED).record(4, SECONDS, rate=RATE), drawn=True)
    assert (code, found["verdict"], found["causes"]) == (0, "nothing_to_explain", [])
    assert found["gain"] is None
    assert found["extended_model"] is None


@pytest.mark.thorough
def test_channels_present_in_only_one_record_are_reported(folder: Path, modalwatch: Commands) -> None:
    recording = Rig(seed=SEED).record(5, 75.0, rate=RATE)
    channels = [replace(c, name={"col_111_x": "col_112_x"}.get(c.name, c.name)) for c in recording.channels]
    write_csv(folder / "misnamed.csv", replace(recording, channels=tuple(channels)))
    assert modalwatch("import", folder / "misnamed.csv", "-o", folder / "misnamed.mcap").code == 0
    logs = (folder / "misnamed.mcap", "--reference", folder / "before.mcap")
    reported = modalwatch("diagnose", folder / "structure.toml", *logs)
    assert "note: misnamed.mcap: no sensor of the structure, left out: col_112_x" in reported.out
    assert "note: misnamed.mcap: compared without col_111_x, which the reference has" in reported.out


@pytest.mark.thorough
def test_channels_with_identical_samples_are_reported_before_the_result(folder: Path, modalwatch: Commands) -> None:
    recording = Rig(seed=SEED).record(5, SECONDS, rate=RATE)
    names = [channel.name for channel in recording.channels]
    data = recording.data.copy()
    data[:, names.index("col_111_x")] = data[:, names.index("col_037_x")]
    data[:, names.index("beam_mid_y")] = 0.0
    write_csv(folder / "copied.csv", replace(recording, data=data))
    assert modalwatch("import", folder / "copied.csv", "-o", folder / "copied.mcap").code == 0
    logs = (folder / "copied.mcap", "--reference", folder / "before.mcap", "--json", folder / "copied.json")
    reported = modalwatch("diagnose", folder / "structure.toml", *logs).out.splitlines()
    assert reported[0].startswith("warning: copied.mcap: col_037_x and col_111_x contain identical samples (")
    assert reported[1] == "warning: copied.mcap: beam_mid_y is left out: constant"
    (dead,) = json.loads((folder / "copied.json").read_text(encoding="utf-8"))["causes"]
    assert (dead["cause"], dead["where"]["channels"]) == ("sensor_dead", ["beam_mid_y"])


@pytest.mark.parametrize("only", few_of([("--only", "model_parameters", "--only", "added_mass"), ((),)]))
def test_diagnosis_without_reference_log_names_no_added_mass(
    folder: Path, modalwatch: Commands, only: tuple[str, ...]
) -> None:
    """E, density, foot and joint are all a little off: a verdict that a person may have to judge, never a mass."""
    out = folder / "model.json"
    code = modalwatch(
        "diagnose", folder / "structure.toml", folder / "before.mcap", *only, "--json", out, "--force"
    ).code
    found = json.loads(out.read_text(encoding="utf-8"))
    assert code == (0 if found["verdict"] in {"explained", "nothing_to_explain"} else 1)
    if found["verdict"] == "explained":
        assert "added_mass" not in [cause["cause"] for cause in found["causes"]]


@pytest.mark.parametrize(
    ("arguments", "named"),
    few_of(
        [
            (("structure.toml", "missing.mcap"), "missing.mcap"),
            (("structure.toml", "before.mcap", "--window", "119"), "before.mcap"),
            (("missing.toml", "before.mcap"), "missing.toml"),
            (("structure.toml", "before.csv"), "before.csv"),
        ],
        2,
    ),
)
def test_bad_input_gives_one_clear_error(
    folder: Path, modalwatch: Commands, arguments: tuple[str, ...], named: str
) -> None:
    done = modalwatch("diagnose", *(folder / a if "." in a else a for a in arguments))
    assert_refused(done, named)
