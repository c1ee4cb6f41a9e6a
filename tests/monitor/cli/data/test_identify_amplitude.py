"""`identify --amplitude`: slopes of a building whose joint slips, as a table and as JSON."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from daq import write_recording
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.oma.nonlinear_building import Element, vibrations

SEED = 4300


def test_windows_are_pooled_and_significant_slopes_are_printed(modalwatch: Commands, tmp_path: Path) -> None:
    windows = vibrations(Element("stiffening", 0.05), 900, range(SEED, SEED + 2))
    recording = replace(windows[0], data=np.concatenate([window.data for window in windows]))
    write_recording(tmp_path / "building.mcap", recording)
    done = modalwatch(
        "identify", tmp_path / "building.mcap", "--window", 900, "--amplitude", "--json", tmp_path / "m.json"
    )
    assert (done.code, done.err) == (0, "")
    assert "change with the amplitude, per rms amplitude" in done.out
    assert "mode 1: frequency 2.0" in done.out
    first = json.loads((tmp_path / "m.json").read_text())["modes"][0]["amplitude"]
    assert first["channel"] == "floor_4"
    assert first["frequency"]["p_value"] < 1e-3
    assert first["frequency"]["slope"] > 3 * first["frequency"]["std"]
    assert first["damping"]["p_value"] > 1e-3


def test_modes_that_cannot_be_tested_are_listed(modalwatch: Commands, tmp_path: Path) -> None:
    (recording,) = vibrations(Element("linear", 0), 120, range(SEED, SEED + 1))
    write_recording(tmp_path / "short.mcap", recording)
    done = modalwatch("identify", tmp_path / "short.mcap", "--amplitude", "--json", tmp_path / "m.json")
    assert done.code == 0
    assert "not tested: modes 1, 2" in done.out
    assert json.loads((tmp_path / "m.json").read_text())["modes"][0]["amplitude"] is None


def test_other_data_are_refused(modalwatch: Commands, tmp_path: Path) -> None:
    (tmp_path / "hammer.uff").write_text("")
    assert_refused(modalwatch("identify", tmp_path / "hammer.uff", "--amplitude"), "--amplitude")
    arguments = (tmp_path / "a.mcap", tmp_path / "b.mcap", "--reference-sensor", "top", "--amplitude")
    assert_refused(modalwatch("identify", *arguments), "--amplitude")
