"""`diagnose` with causes, channels, modes and parameters left out or limited."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_helpers import Commands, assert_refused
from updater_helpers import measure, t_frame, true_model

from oma import ModalEstimate
from updater import Body, load_structure, t_structure_toml

BODY = Body(at=(0.2, 0, 1.48), mass=0.3)
CHANNELS = t_frame().channels


def _table(path: Path, estimate: ModalEstimate) -> Path:
    rows = np.column_stack([estimate.frequency, estimate.damping, estimate.frequency_std, estimate.shape.real])
    header = ",".join(("frequency", "damping", "frequency_std", *CHANNELS))
    np.savetxt(path, rows, delimiter=",", header=header, comments="")
    return path


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A structure file, and tables of a frame's modes without and with a body of 300 g."""
    folder = tmp_path_factory.mktemp("tables")
    file = folder / "frame.toml"
    file.write_text(t_structure_toml(), encoding="utf-8")
    bare, loaded = (true_model(np.random.default_rng(411), body) for body in (None, BODY))
    return {
        "structure": file,
        "before": _table(folder / "before.csv", measure(bare, np.random.default_rng((412, 1)), np.ones(12))),
        "after": _table(folder / "after.csv", measure(loaded, np.random.default_rng((412, 2)), np.ones(12))),
        "out": folder / "out",
    }


def _diagnosed(modalwatch: Commands, measured: dict[str, Path], *options: object) -> tuple[dict[str, Any], str]:
    command = ("diagnose", measured["structure"], measured["after"], "--reference", measured["before"])
    done = modalwatch(*command, "--out", measured["out"], *options)
    assert done.code in {0, 1}, done
    found: dict[str, Any] = json.loads((measured["out"] / "diagnosis.json").read_text(encoding="utf-8"))
    return found, done.out


def test_only_the_chosen_causes_are_considered(modalwatch: Commands, measured: dict[str, Path]) -> None:
    found, _ = _diagnosed(modalwatch, measured, "--only", "added_mass", "--only", "sensor_gain")
    assert [cause["cause"] for cause in found["causes"]] == ["added_mass"]
    assert {cause["cause"] for cause in found["rejected"]} == {"sensor_gain"}
    found, _ = _diagnosed(modalwatch, measured, "--without", "added_mass")
    assert "added_mass" not in {cause["cause"] for cause in (*found["causes"], *found["rejected"])}


def test_a_mode_and_a_channel_are_left_out_of_both_states(modalwatch: Commands, measured: dict[str, Path]) -> None:
    few = ("--only", "added_mass")
    whole, _ = _diagnosed(modalwatch, measured, *few)
    left_out = whole["modes"][2]["frequency"]["measured"]
    found, _ = _diagnosed(modalwatch, measured, *few, "--without-mode", left_out, "--without-channel", "beam_left_z")
    frequencies = [mode["frequency"]["measured"] for mode in found["modes"] if mode["frequency"]["measured"]]
    assert len(frequencies) == len(whole["modes"]) - 1
    assert min(abs(f / left_out - 1) for f in frequencies) > 0.02
    mass = found["causes"][0]["parameters"]["mass"]
    assert abs(mass["value"] - 0.3) < max(4 * mass["std"], 0.1)


def test_a_fixed_parameter_keeps_the_file_s_value_and_the_others_are_listed(
    modalwatch: Commands, measured: dict[str, Path]
) -> None:
    few = ("--only", "added_mass")
    _, said = _diagnosed(modalwatch, measured, *few)
    free = load_structure(measured["out"] / "structure_extended.toml").material["steel"].youngs_modulus
    assert free != 210e9
    assert "model parameters fitted to the reference logs" in said
    _diagnosed(modalwatch, measured, *few, "--fix", "column.E")
    assert load_structure(measured["out"] / "structure_extended.toml").material["steel"].youngs_modulus == 210e9
    between = 210e9 + (free - 210e9) / 2
    limits = f"{min(between, 209e9)}:{max(between, 211e9)}" if free > 210e9 else f"{between}:{220e9}"
    _diagnosed(modalwatch, measured, *few, "--bound", f"steel.E={limits}")
    bounded = load_structure(measured["out"] / "structure_extended.toml").material["steel"].youngs_modulus
    assert min(free, 210e9) < bounded < max(free, 210e9) or bounded == pytest.approx(between, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--without", "added_mas"), "did you mean 'added_mass'"),
        (("--fix", "steal.E"), "there is no parameter 'steal.E'"),
        (("--bound", "steel.E=3"), "expected NAME=LEAST:GREATEST"),
        (("--bound", "steel.E=1e9:2e9"), "expected to contain the file's value"),
        (("--without-channel", "mid"), "the structure has no channel 'mid'"),
        (("--without-mode", "-3"), "expected a positive frequency"),
    ],
)
def test_a_choice_that_cannot_be_met_is_refused_in_one_line(
    modalwatch: Commands, measured: dict[str, Path], options: tuple[str, str], said: str
) -> None:
    assert_refused(modalwatch("diagnose", measured["structure"], measured["after"], *options), said)
