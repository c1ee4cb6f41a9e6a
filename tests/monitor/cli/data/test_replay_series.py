"""A site without a model on the command line: series of modes replayed, tables imported, settings checked."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from daq import read_attachments
from monitor.analysis.modal_table.series import read_series
from monitor.cli.logs.modal_series import series_site
from monitor.service.site import load_site
from monitor.settings import has_settings
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.updater.reference_frame import measure, true_model
from updater import Body, t_structure_toml

CALM, CHANGED = 44, 8
FREQUENCY, DAMAGE = np.array([3.9, 5.0, 9.8, 10.3]), np.array([-0.02, -0.012, 0.0, -0.015])
SHAPE = np.array([[1, 0.8, 0.2], [0.3, 1, -0.7], [1, -0.9, 0.4], [0.5, 0.2, 1.0]])
SITE = """\
[alarm]
false_alarms_per_year = 0.5
[[device]]
name = "left"
driver = "epson-uart"
port = "/dev/null"
channels = {x = "left_x", y = "left_y"}
"""


PLACED = """\
[[device]]
name = "logger"
driver = "epson-uart"
port = "/dev/null"
channels = {x = "R0", y = "R1", z = "R2"}
""" + "".join(
    f'[[sensor]]\nchannel = "{name}"\nat = {at}\ndirection = {direction}\n'
    for name, at, direction in (
        ("R0", [0, 0, 1], [0, 0, 2]),
        ("R1", [5, 0, 1], [0, 0, -1]),
        ("R2", [5, 0, 1], [1, 0, 0]),
    )
)


def table(folder: Path, seed: int, *, shapes: bool) -> Path:
    """Write hourly modes of a structure that loses stiffness after `CALM` hours; a tenth of the cells is empty."""
    print(f"seed {seed}")
    random = np.random.default_rng(seed)
    rows = [
        "time,temperature,"
        + ",".join(f"f{k} [Hz]" for k in range(1, 5))
        + "".join(f",shape_{k}_R{c}" for k in range(1, 5) for c in range(3) if shapes)
    ]
    for hour in range(CALM + CHANGED):
        temperature = 10 + 5 * np.sin(2 * np.pi * hour / 24)
        frequency = FREQUENCY * (1 + DAMAGE * (hour >= CALM)) * (1 + 0.002 * random.standard_normal(4))
        frequency *= 1 - 1e-3 * (temperature - 10)  # up to half a per cent
        missing = random.random(4) < 0.1
        cells = ["" if gone else f"{f:.4f}" for f, gone in zip(frequency, missing, strict=True)]
        if shapes:
            shape = SHAPE + 0.01 * random.standard_normal(SHAPE.shape)
            cells += ["" if gone else f"{s:.4f}" for gone, row in zip(missing, shape, strict=True) for s in row]
        rows.append(f"1998-08-{1 + hour // 24:02d}T{hour % 24:02d}:00,{temperature:.2f}," + ",".join(cells))
    path = folder / "modes.csv"
    path.write_text("\n".join(rows), encoding="utf-8")
    return path


@pytest.mark.parametrize("shapes", [True, pytest.param(False, marks=pytest.mark.thorough)])
def test_series_of_modes_is_watched(shapes: bool, modalwatch: Commands, tmp_path: Path) -> None:
    path, log, found = table(tmp_path, 91, shapes=shapes), tmp_path / "watched.mcap", tmp_path / "found.json"
    (tmp_path / "site.toml").write_text(PLACED, encoding="utf-8")
    site = ("--site", tmp_path / "site.toml") if shapes else ()
    done = modalwatch("replay", path, *site, "-o", log, "--json", found, "--set", "alarm.hold_windows=3")
    assert done.code == 1, done.err  # it ends in an alarm
    results = json.loads(found.read_text())["results"]
    windows = [r for r in results if "phase" in r]
    assert len(windows) == CALM + CHANGED
    assert not [w for w in windows[:CALM] if w["phase"] == "alarm"]
    assert windows[CALM + 2]["phase"] == "alarm"
    change = windows[-1]["change"]
    assert change["n_windows"] == CHANGED - 1
    for mode, true in zip(change["modes"], 100 * DAMAGE, strict=True):
        assert abs(mode["shift_percent"] - true) < 4 * mode["shift_std_percent"]
        assert ("frequency" in mode["changed"]) == (true != 0)
        assert (mode["mac"] is None) == (not shapes)
    [reference] = [r for r in results if "calibrated" in r]
    assert reference["channels"] == (["R0", "R1", "R2"] if shapes else [])
    assert reference["lines"] == ({"line 1": [0, 1]} if shapes else {})
    for mode, shape in zip(reference["modes"], SHAPE, strict=True):
        moved = np.array([[0, 0, shape[0]], [shape[2], 0, -shape[1]]]) / np.abs(shape).max()  # of unit largest
        assert np.abs(np.abs(mode["displacement"] or moved) - np.abs(moved)).max() < 0.02  # a mean of 24: 0.01 / 24^0.5
    assert "structure" not in read_attachments(log)["site.toml"].partition("[[device]]")[0]
    done = modalwatch("report", log, "-o", tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Change of the modes" in page
    assert "3 of 4 frequencies moved" in page
    assert "MAC, model file" not in page
    assert "no end record" not in page
    assert ("Mode shapes of the baseline" in page) == shapes
    done = modalwatch("view", log, "--no-open", "--out", tmp_path / "view.rrd")
    assert done.code == 0, done.err


def test_series_that_is_too_short_states_how_many_rows_it_lacks(modalwatch: Commands, tmp_path: Path) -> None:
    """Rows that follow an unknown temperature are correlated: the baseline is extended beyond the rows that exist."""
    random, path = np.random.default_rng(95), tmp_path / "modes.csv"
    daily = 0.005 * np.sin(2 * np.pi * np.arange(30) / 24)[:, None]
    frequency = FREQUENCY * (1 + daily + 0.001 * random.standard_normal((30, 4)))
    rows = [f"{hour}," + ",".join(f"{f:.4f}" for f in row) for hour, row in enumerate(frequency)]
    path.write_text("time [h],f1,f2,f3,f4\n" + "\n".join(rows), encoding="utf-8")
    done = modalwatch("replay", path)
    assert done.code == 0, done.err
    found = re.search(r"no baseline is learned: 30 rows with modes, expected (\d+) or more", " ".join(done.out.split()))
    assert found
    assert int(found[1]) > 30


def test_series_that_does_not_fit_the_site_is_refused(modalwatch: Commands, tmp_path: Path) -> None:
    path, site = table(tmp_path, 92, shapes=True), tmp_path / "site.toml"
    (tmp_path / "t.toml").write_text(t_structure_toml(), encoding="utf-8")
    site.write_text(
        'structure = "t.toml"\n' + SITE.replace("left_x", "beam_left_y").replace("left_y", "beam_left_z", 1)
    )
    site.write_text('structure = "t.toml"\n' + SITE.replace('x = "left_x", y = "left_y"', 'y = "beam_left_y"'))
    assert_refused(modalwatch("replay", path, "--site", site), path, "shape: 'R0' is no sensor of the structure")
    assert_refused(modalwatch("replay", path, "--from", "1h"), "--from", "not of a series of modes")
    site.write_text(SITE, encoding="utf-8")
    used = series_site(read_series(path), site, ())
    assert used.settings.alarm.false_alarms_per_year == 0.5
    assert used.settings.analysis.window_seconds == 3600
    assert set(used.settings.device_of) == {"R0", "R1", "R2"}


def test_site_without_a_structure(modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / "bridge-7" / "site.toml"
    path.parent.mkdir()
    path.write_text(SITE, encoding="utf-8")
    site = load_site(path)
    assert (site.name, set(site.attachments)) == ("bridge-7", {"site.toml"})
    assert_refused(modalwatch("prove", path, "--mass", "0.1", "--position", "0,0"), "the monitor has no baseline")


def test_table_becomes_a_log_that_can_be_replayed_without_a_structure(modalwatch: Commands, tmp_path: Path) -> None:
    random = np.random.default_rng(93)
    rows = [",".join(f"{value:.5f}" for value in (k / 100, *random.normal(size=3))) for k in range(2000)]
    data, log, site = tmp_path / "data.csv", tmp_path / "log.mcap", tmp_path / "site.toml"
    data.write_text("\n".join(["t,a,b,c", *rows]), encoding="utf-8")
    done = modalwatch("import", data, "-o", log, "--new-site", site)
    assert done.code == 0, done.err
    assert load_site(site).settings.structure is None
    assert has_settings(read_attachments(log))  # what `replay` needs
    assert not has_settings({"site.toml": 'structure = "t.toml"\n' + SITE})


@pytest.mark.thorough
def test_series_with_shapes_at_the_sensors_of_a_model_is_diagnosed(modalwatch: Commands, tmp_path: Path) -> None:
    random = np.random.default_rng(94)
    states = [true_model(np.random.default_rng(94), body) for body in (None, Body(at=(0.0, 0.0, 0.9), mass=0.25))]
    lines: list[str] = []
    for hour in range(30):
        modes = measure(states[hour >= 26], random, np.ones(12), noise=3e-4, shape_noise=3e-3)
        if not lines:
            shape = [f"shape_{k}_{c}" for k in range(1, modes.n_modes + 1) for c in modes.channels]
            lines = [",".join(["time", *(f"f{k}" for k in range(1, modes.n_modes + 1)), "temperature", *shape])]
        cells = [*modes.frequency, 20.0, *modes.shape.real.ravel()]
        lines.append(f"2026-01-{1 + hour // 24:02d}T{hour % 24:02d}:00," + ",".join(f"{cell:.6f}" for cell in cells))
    path, site, found = tmp_path / "modes.csv", tmp_path / "site.toml", tmp_path / "found.json"
    path.write_text("\n".join(lines), encoding="utf-8")
    (tmp_path / "t.toml").write_text(t_structure_toml(), encoding="utf-8")
    site.write_text('structure = "t.toml"\n' + SITE.replace('x = "left_x", y = "left_y"', 'y = "beam_left_y"'))
    done = modalwatch("replay", path, "--site", site, "--json", found)
    assert done.code == 1, done.err
    diagnosis = [r["diagnosis"] for r in json.loads(found.read_text())["results"] if r.get("diagnosis")][-1]
    print(done.out[-1000:])
    [cause] = diagnosis["causes"]
    assert cause["cause"] == "added_mass"
    mass = cause["parameters"]["mass"]
    assert abs(mass["value"] - 0.25) < 4 * mass["std"]
