"""Frequency responses in the place of logs: modes with deviations, and the diagnosis of a body that was added."""

from pathlib import Path

import numpy as np
import pytest
import pyuff

from daq import LogError
from monitor.analysis.modal_table.responses import identify_file
from monitor.analysis.modal_table.table import read_tables
from tests.support.daq.responses import frequency_response
from tests.support.monitor.cli import Commands, assert_refused
from updater import build_model, parse_structure, t_structure_toml

TEXT = t_structure_toml()
BODY = "\n[[body]]\nat = [0.0, 0.0, 0.74]\nmass = 0.3\n"
FORCES = (0, 1, 9)  # channels that the hammer hits
DAMPING = 0.008


@pytest.fixture
def modalwatch(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Commands:
    return Commands(monkeypatch, capsys)


def write_responses(path: Path, text: str, seed: int, forces: tuple[int, ...] = FORCES, spacing: float = 0.25) -> Path:
    """Write accelerances of a structure with noise of half a per cent of their mean, in lines up to 280 Hz."""
    structure, random = parse_structure(text), np.random.default_rng(seed)
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = model.modes(12)
    at = model.sensor_rows @ modes.shape
    line = np.arange(1, round(280 / spacing)) * spacing
    ratio = line[:, None] / modes.frequency
    resonance = -(ratio**2) / (1 - ratio**2 + 2j * DAMPING * ratio)
    found = np.einsum("lk,ok,ik->loi", resonance, at, at[list(forces)])
    noise = random.standard_normal(found.shape) + 1j * random.standard_normal(found.shape)
    found = found + 0.005 * np.abs(found).mean() * noise
    sets = [
        frequency_response(found[:, k, n], line, id1=name, rsp_node=0, rsp_dir=0, ref_node=force + 1)
        for n, force in enumerate(forces)
        for k, name in enumerate(structure.channels)
    ]
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")
    return path


def test_modes_of_responses_are_those_of_the_structure(tmp_path: Path) -> None:
    structure = parse_structure(TEXT)
    path = write_responses(tmp_path / "frf.uff", TEXT, 1)
    modes = build_model(structure, shear_flexible=True, mass="consistent").modes(12).frequency
    found = read_tables(structure, [path]).estimates[0]
    assert found.n_modes >= 5
    assert found.channels == structure.channels
    for frequency in found.frequency:
        assert np.abs(modes / frequency - 1).min() < 1e-4
    np.testing.assert_allclose(found.damping, DAMPING, rtol=0.02)
    # as if a window had added 1 / (20 s) to each rate of decay
    without = read_tables(structure, [path], window=20.0).estimates[0]
    np.testing.assert_allclose(without.frequency, found.frequency, rtol=1e-5)
    np.testing.assert_allclose(without.damping, found.damping - 1 / (20.0 * 2 * np.pi * found.frequency), rtol=2e-3)


def test_responses_of_no_sensor_are_refused(tmp_path: Path) -> None:
    line = np.arange(1, 200) * 0.5
    one = frequency_response(np.exp(1j * line), line, id1="top", rsp_node=0, rsp_dir=0, ref_node=2)
    pyuff.UFF(str(tmp_path / "frf.uff")).write_sets([one], "overwrite")
    with pytest.raises(LogError, match=r"frf\.uff: expected responses at two sensors of the structure or more"):
        read_tables(parse_structure(TEXT), [tmp_path / "frf.uff"])
    (tmp_path / "none.uff").write_text("t,a\n")
    with pytest.raises(LogError, match=r"none\.uff: "):
        read_tables(parse_structure(TEXT), [tmp_path / "none.uff"])


def test_hammer_that_moves_gives_shapes_at_the_sensors(tmp_path: Path) -> None:
    """Blows against the direction of the sensors, which stay: the mode is that of the sensors."""
    line, shape = np.arange(1, 400) * 0.1, np.array([0.3, -0.2, 0.4])
    ratio = line / 20.0
    resonance = -(ratio**2) / (1 - ratio**2 + 0.02j * ratio)
    sets = [
        frequency_response(
            -value * shape[0] * resonance, line, rsp_node=1, rsp_dir=1, ref_node=k + 1, ref_dir=-1,
            rsp_ent_name="NONE", ref_ent_name="NONE",
        )
        for k, value in enumerate(shape)
    ]  # fmt: skip
    pyuff.UFF(str(tmp_path / "frf.uff")).write_sets(sets, "overwrite")
    found = identify_file(tmp_path / "frf.uff", ("3_x", "1_x", "2_x", "top")).modes
    assert found.estimate.channels == ("1_x", "2_x", "3_x")
    np.testing.assert_allclose(found.estimate.shape[0].real, shape / np.linalg.norm(shape), atol=1e-6)
    assert found.modal_mass[0] == pytest.approx(1 / np.sum(shape**2), rel=1e-5)
    free = identify_file(tmp_path / "frf.uff").modes
    assert free.estimate.channels == ("1_-x", "2_-x", "3_-x")


def test_exponential_window_of_no_responses_is_refused(modalwatch: Commands, tmp_path: Path) -> None:
    arguments = ("diagnose", tmp_path / "structure.toml", tmp_path / "a.csv", "--exponential-window")
    assert_refused(modalwatch(*arguments, 1), "--exponential-window: expected frequency responses (.uff, .unv), found")
    assert_refused(modalwatch(*arguments, 0), "--exponential-window: expected a positive time in s, found 0")


@pytest.mark.thorough
def test_added_body_is_found_from_responses(modalwatch: Commands, tmp_path: Path) -> None:
    (tmp_path / "structure.toml").write_text(TEXT, encoding="utf-8")
    before = write_responses(tmp_path / "before.uff", TEXT, 1, spacing=0.125)
    after = write_responses(tmp_path / "after.uff", TEXT + BODY, 2, spacing=0.125)
    done = modalwatch("diagnose", tmp_path / "structure.toml", after, "--reference", before)
    assert done.code == 0, done
    assert "added on the column at (0.000, 0.000, 0.7" in " ".join(done.out.split())
