"""`identify --out`: the folder contains the results for other programs and pictures for engineers."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyuff
from PIL import Image

from daq import Channel, write_recording
from oma import Identification, ModalEstimate, identify_all, mac_matrix, normalise, places_by_name, plot_tracks
from oma.plots import complexity_figure, figure_of_modes, mac_with_model_figure
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.monitor.seasons import FREQUENCY, Month, month
from tests.support.oma.structures import chain, simulate
from tests.support.updater.frames import as_estimate
from updater import parse_structure, t_structure_toml

CHAIN = chain(4, first=2.0, damping=0.01)
PICTURES = {"stabilization.png", "singular_values.png", "mac.png", "shapes.png", "complexity.png"}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("folder") / "chain.mcap"
    channels = tuple(Channel(name=f"{i + 1}_x", device="d", axis=i) for i in range(4))
    write_recording(path, replace(simulate(CHAIN, 720.0, 40.0, seed=22), channels=channels))
    return path


def test_folder_contains_mode_files_and_pictures(modalwatch: Commands, log: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "modes"
    done = modalwatch("identify", log, "--window", 60, "--out", out, "--json", tmp_path / "same.json")
    assert (done.code, done.err) == (0, "")
    assert {path.name for path in out.iterdir()} == PICTURES | {"modes.json", "modes.unv", "tracks.png"}
    content = json.loads((out / "modes.json").read_text())
    assert content == json.loads((tmp_path / "same.json").read_text())
    for path in out.glob("*.png"):
        with Image.open(path) as picture:
            assert min(picture.size) > 300
        assert path.name in done.out.replace("\n", " ")
    header, *universal = pyuff.UFF(str(out / "modes.unv")).read_sets()
    assert header["type"] == 151
    assert len(universal) == len(content["modes"]) == 4
    for found, mode in zip(universal, content["modes"], strict=True):
        assert abs(found["eig"]) / (2 * np.pi) == pytest.approx(mode["frequency"]["value"], rel=1e-5)
        assert found["node_nums"].tolist() == [1, 2, 3, 4]
        np.testing.assert_allclose(found["r1"], [complex(*mode["shape"][f"{i}_x"]) for i in (1, 2, 3, 4)], atol=1e-5)


@pytest.mark.thorough
def test_log_with_a_structure_gives_sensor_positions_and_geometry(modalwatch: Commands, tmp_path: Path) -> None:
    path = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"
    (tmp_path / "tracks.png").write_text("of an earlier run with more windows")
    done = modalwatch("identify", path, "--window", 60, "--out", tmp_path, "--force")
    assert done.code == 0, done.err
    assert {picture.name for picture in tmp_path.glob("*.png")} == PICTURES
    header, geometry, *others = pyuff.UFF(str(tmp_path / "modes.unv")).read_sets()
    assert header["type"] == 151
    at = dict(zip(geometry["node_nums"], zip(geometry["x"], geometry["y"], geometry["z"], strict=True), strict=True))
    structure = parse_structure(t_structure_toml(), "t")
    assert {sensor.at for sensor in structure.sensor} <= set(at.values())
    lines = [s["nodes"] for s in others if s["type"] == 82]
    assert [(at[line[0]], at[line[-1]]) for line in lines] == [(m.start, m.end) for m in structure.member]
    column = [at[node][2] for node in lines[0]]
    assert column == sorted(column)
    assert len(column) > 3  # the sensors on it are nodes too
    content = json.loads((tmp_path / "modes.json").read_text())
    assert set(content["comac"]) == {sensor.channel for sensor in structure.sensor}
    assert all(value is None or 0.5 < value <= 1 for value in content["comac"].values())


def test_unwritable_output_folder_is_reported(modalwatch: Commands, log: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert_refused(
        modalwatch("identify", log, "--out", tmp_path / "file"), "--out: ", tmp_path / "file", "cannot be wri"
    )


def found_modes() -> tuple[ModalEstimate, Identification]:
    found = identify_all(simulate(CHAIN, 200.0, 40.0, seed=23))
    return found.estimate, found


def test_diagrams_show_the_identified_modes() -> None:
    estimate, found = found_modes()
    upper, lower, _ = found.plot_stabilization(simulate(CHAIN, 200.0, 40.0, seed=23)).axes
    shown = np.concatenate([np.asarray(line.get_xdata(), float) for line in upper.lines if line.get_marker() == "."])
    assert sorted(shown) == sorted(found.poles.frequency)
    (marked,) = (c for c in lower.containers if str(c.get_label()).startswith("mode"))
    points = np.asarray(marked[0].get_xydata())
    np.testing.assert_allclose(points, np.column_stack([estimate.frequency, 100 * estimate.damping]))
    matrix = mac_with_model_figure(estimate, (CHAIN.frequency[:2], CHAIN.shapes[:2])).axes
    own, other = (np.asarray(axes.images[0].get_array(), float) for axes in matrix[:2])
    np.testing.assert_allclose(own, mac_matrix(estimate.shape, estimate.shape))
    np.testing.assert_allclose(other, mac_matrix(estimate.shape, CHAIN.shapes[:2]))


def test_complexity_arrows_have_the_phases_of_the_shape() -> None:
    estimate, _ = found_modes()
    shape = normalise(estimate.shape + 0.3j * np.random.default_rng(1).standard_normal(estimate.shape.shape))
    for k, axes in enumerate(complexity_figure(replace(estimate, shape=shape)).axes):
        tips = np.array([[float(np.asarray(v)[-1]) for v in line.get_data()] for line in axes.lines[1::2]])
        expected = shape[k] / np.abs(shape[k]).max()
        np.testing.assert_allclose(tips[:, 1] * np.exp(1j * tips[:, 0]), expected, atol=1e-12)


def test_each_mode_has_one_colour_over_time() -> None:
    estimates = [estimate for estimate, _ in month(Month(days=2), 5)]
    (axes,) = plot_tracks(estimates).axes
    strange, *modes = axes.lines
    medians = [float(np.median(np.asarray(line.get_ydata(), float))) for line in modes]
    np.testing.assert_allclose(medians, FREQUENCY, rtol=0.06)  # they drift by 5 %
    n_shown = sum(len(np.asarray(line.get_xdata())) for line in axes.lines)
    assert n_shown == sum(e.n_modes for e in estimates)
    assert len(np.asarray(strange.get_xdata())) < 0.05 * n_shown
    assert axes.get_xlabel() == "time [d]"


def drawn_arrows(estimate: ModalEstimate, channels: Sequence[str]) -> int:
    structure = parse_structure(t_structure_toml(), "t")
    named = replace(estimate, channels=tuple(channels))
    return sum(len(axes.collections) - 1 for axes in named.plot_shapes(structure).axes)


def test_shapes_are_drawn_at_the_sensors() -> None:
    estimate, _ = found_modes()
    names = ("col_037_x", "col_037_y", "beam_left_y", "beam_right_z")
    assert drawn_arrows(estimate, names) == 4 * 3  # one arrow a place and mode
    assert len({place.node for place in places_by_name(names).values()}) == 3


def test_shapes_of_all_modes_are_below_the_diagram() -> None:
    shapes = np.random.default_rng(9).standard_normal((9, 4))
    figure, diagram = figure_of_modes(as_estimate(np.arange(1.0, 10.0), shapes, channels=("a", "b", "c", "d")))
    below = [axes for axes in figure.axes if axes is not diagram]
    assert [axes.get_title().split(":")[0] for axes in below] == [str(k) for k in range(1, 10)]
