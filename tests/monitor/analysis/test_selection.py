"""`diagnose` with causes, channels, modes and parameters left out or limited."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from oma import ModalEstimate
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Body, Structure, load_structure, t_structure_toml
from updater.causes import CATALOGUE

pytestmark = pytest.mark.usefixtures("undrawn")

BODY = Body(at=(0.2, 0, 1.48), mass=0.3)
CHANNELS = t_frame().channels
MASS_ONLY = ("--only", "added_mass")


@dataclass(frozen=True)
class Found:
    """Output of a diagnosis, written and printed."""

    diagnosis: dict[str, Any]
    message: str
    extended: Structure | None


@dataclass(frozen=True)
class Tables:
    """A structure file, tables of its modes before and after a change, and their diagnosis."""

    structure: Path
    before: Path
    after: Path
    out: Path
    known: dict[tuple[object, ...], Found] = field(default_factory=dict)  #: by the options


def _table(path: Path, estimate: ModalEstimate) -> Path:
    rows = np.column_stack([estimate.frequency, estimate.damping, estimate.frequency_std, estimate.shape.real])
    header = ",".join(("frequency", "damping", "frequency_std", *CHANNELS))
    np.savetxt(path, rows, delimiter=",", header=header, comments="")
    return path


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Tables:
    """A frame without and with a body of 300 g."""
    folder = tmp_path_factory.mktemp("tables")
    file = folder / "frame.toml"
    file.write_text(t_structure_toml(), encoding="utf-8")
    bare, loaded = (true_model(np.random.default_rng(411), body) for body in (None, BODY))
    return Tables(
        structure=file,
        before=_table(folder / "before.csv", measure(bare, np.random.default_rng((412, 1)), np.ones(12))),
        after=_table(folder / "after.csv", measure(loaded, np.random.default_rng((412, 2)), np.ones(12))),
        out=folder / "out",
    )


def _diagnosed(modalwatch: Commands, measured: Tables, *options: object) -> Found:
    if options not in measured.known:
        command = ("diagnose", measured.structure, measured.after, "--reference", measured.before)
        done = modalwatch(*command, "--out", measured.out, "--force", *options)
        assert done.code in {0, 1}, done
        diagnosis = json.loads((measured.out / "diagnosis.json").read_text(encoding="utf-8"))
        extended = load_structure(measured.out / "structure_extended.toml") if diagnosis["extended_model"] else None
        measured.known[options] = Found(diagnosis, done.out, extended)
    return measured.known[options]


def _steel(found: Found) -> float:
    """Return Young's modulus in the extended model [Pa]."""
    assert found.extended is not None
    return found.extended.material["steel"].youngs_modulus


def test_only_the_chosen_causes_are_considered(modalwatch: Commands, measured: Tables) -> None:
    found = _diagnosed(modalwatch, measured, *MASS_ONLY, "--only", "sensor_gain").diagnosis
    assert [cause["cause"] for cause in found["causes"]] == ["added_mass"]
    assert {cause["cause"] for cause in found["rejected"]} == {"sensor_gain"}
    left_out = [name for name in CATALOGUE if name not in {"global_stiffness", "sensor_gain"}]
    options = [word for name in left_out for word in ("--without", name)]
    found = _diagnosed(modalwatch, measured, *options).diagnosis
    considered = {cause["cause"] for cause in (*found["causes"], *found["rejected"])}
    assert considered
    assert considered.isdisjoint(left_out)


@pytest.mark.thorough
def test_excluded_mode_and_channel_are_ignored_in_both_states(modalwatch: Commands, measured: Tables) -> None:
    whole = _diagnosed(modalwatch, measured, *MASS_ONLY).diagnosis
    left_out = whole["modes"][2]["frequency"]["measured"]
    without = ("--without-mode", left_out, "--without-channel", "beam_left_z")
    found = _diagnosed(modalwatch, measured, *MASS_ONLY, *without).diagnosis
    frequencies = [mode["frequency"]["measured"] for mode in found["modes"] if mode["frequency"]["measured"]]
    assert len(frequencies) == len(whole["modes"]) - 1
    assert min(abs(f / left_out - 1) for f in frequencies) > 0.02
    mass = found["causes"][0]["parameters"]["mass"]
    assert abs(mass["value"] - 0.3) < max(4 * mass["std"], 0.1)


@pytest.mark.thorough
def test_fixed_parameter_keeps_its_value_and_bounds_are_respected(modalwatch: Commands, measured: Tables) -> None:
    whole = _diagnosed(modalwatch, measured, *MASS_ONLY)
    free = _steel(whole)
    assert free != 210e9
    assert "model parameters fitted to the reference logs" in whole.message
    assert _steel(_diagnosed(modalwatch, measured, *MASS_ONLY, "--fix", "column.E")) == 210e9
    between = 210e9 + (free - 210e9) / 2
    limits = f"{min(between, 209e9)}:{max(between, 211e9)}" if free > 210e9 else f"{between}:{220e9}"
    bounded = _steel(_diagnosed(modalwatch, measured, *MASS_ONLY, "--bound", f"steel.E={limits}"))
    assert min(free, 210e9) < bounded < max(free, 210e9) or bounded == pytest.approx(between, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--without", "added_mas"), "did you mean 'added_mass'"),
        (("--fix", "steal.E"), "there is no parameter 'steal.E'"),
        (("--bound", "steel.E=3"), "expected NAME=MIN:MAX"),
        (("--bound", "steel.E=1e9:2e9"), "expected to contain the file's value"),
        (("--without-channel", "mid"), "the structure has no channel 'mid'"),
        (("--without-mode", "-3"), "expected a positive frequency"),
    ],
)
def test_invalid_selection_option_is_refused_with_a_one_line_error(
    modalwatch: Commands, measured: Tables, options: tuple[str, str], message: str
) -> None:
    assert_refused(modalwatch("diagnose", measured.structure, measured.after, *options), message)
