"""Animated mode shapes: the page holds the motion of all points, the GIF one cycle."""

import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageChops, ImageSequence

from monitor.results.sensor_geometry import SensorGeometry
from monitor.views.animation import write_animation
from monitor.views.animation.drawing import SWAY
from oma import ModalEstimate
from tests.support.updater.frames import as_estimate, t_frame
from updater import build_model
from updater.validation import ModelModes, model_modes


@pytest.fixture(scope="module")
def measured() -> tuple[ModalEstimate, ModelModes]:
    model = build_model(t_frame(), shear_flexible=True, mass="consistent")
    modes = model.modes(3)
    shapes = (model.sensor_rows @ modes.shape).T
    estimate = as_estimate(modes.frequency, shapes, channels=model.structure.channels)
    return estimate, model_modes(estimate, model.structure)


def test_page_has_the_motion_of_each_mode_and_needs_no_network(
    measured: tuple[ModalEstimate, ModelModes], tmp_path: Path
) -> None:
    estimate, compared = measured
    write_animation(tmp_path / "modes.html", estimate, compared)
    page = (tmp_path / "modes.html").read_text(encoding="utf-8")
    assert not re.findall(r"https?://|src=|@import|url\(", page)
    assert page.count("<canvas role=") == estimate.n_modes
    assert f"{estimate.frequency[0]:.4f} ± 0.0010 Hz, 0.40 ± 0.10 %" in page
    data = json.loads(re.search(r"const data = (\{.*\});", page).group(1))  # type: ignore[union-attr]
    points = np.array(data["points"])
    assert (np.linalg.norm(points, axis=1) < 1).all()  # all of it is inside the picture from any side
    n_nodes = len(compared.model.nodes)
    size = np.linalg.norm(np.ptp(points[:n_nodes], axis=0))
    for mode in data["modes"]:
        largest = np.linalg.norm(np.array(mode["re"])[:n_nodes], axis=1).max()
        assert largest == pytest.approx(SWAY * size, rel=1e-3)
    torsion = np.array(data["modes"][2]["re"])  # the crossbeam turns about the column, whose axis stays at rest
    arms = [i for pair in data["ribs"] for i in pair]
    column = np.abs(points[:, 0] - points[0, 0]) < 1e-4
    on_axis = [i for i in range(n_nodes) if column[i]]
    assert np.linalg.norm(torsion[arms], axis=1).max() > 10 * np.linalg.norm(torsion[on_axis], axis=1).max()


def test_shapes_without_a_model_move_at_the_sensors(tmp_path: Path) -> None:
    sensors = {"a": ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), "b": ((4.0, 0.0, 3.0), (0.0, -2.0, 0.0))}
    estimate = as_estimate(np.array([3.0]), np.array([[0.6, 0.8]]), channels=("a", "b"))
    write_animation(tmp_path / "modes.html", estimate, SensorGeometry(sensors=sensors))
    page = (tmp_path / "modes.html").read_text(encoding="utf-8")
    data = json.loads(re.search(r"const data = (\{.*\});", page).group(1))  # type: ignore[union-attr]
    assert (data["spans"], data["ribs"], data["sensors"]) == ([[0, 1]], [], [0, 1])
    size = np.linalg.norm(np.subtract(*data["points"]))
    np.testing.assert_allclose(data["modes"][0]["re"], SWAY * size * np.array([[0, 0, 0.75], [0, -1, 0]]), atol=2e-5)
    assert "torsion" not in page
    shown = estimate.plot_shapes(SensorGeometry(sensors=sensors))
    assert len(shown.axes[0].collections) == 3  # the line, and an arrow per sensor


def test_gif_is_one_cycle(measured: tuple[ModalEstimate, ModelModes], tmp_path: Path) -> None:
    estimate = measured[0][np.array([0])]
    write_animation(tmp_path / "modes.gif", estimate, model_modes(estimate, t_frame()))
    with Image.open(tmp_path / "modes.gif") as picture:
        assert picture.info["loop"] == 0
        frames = [frame.convert("RGB") for frame in ImageSequence.Iterator(picture)]
    moved = [ImageChops.difference(a, b).getbbox() for a, b in pairwise(frames)]
    assert None not in moved
    for early, late in zip(frames[1:12], frames[:12:-1], strict=True):  # real shapes: cos(-t) = cos(t)
        assert np.asarray(ImageChops.difference(early, late)).max() < 64  # shades of the palette


def test_other_file_names_are_refused(measured: tuple[ModalEstimate, ModelModes], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected a name that ends with \.html or \.gif"):
        write_animation(tmp_path / "modes.avi", *measured)
    with pytest.raises(OSError, match="No such file"):
        write_animation(tmp_path / "none" / "modes.gif", *measured)
    assert list(tmp_path.iterdir()) == []
