from pathlib import Path

import numpy as np
import pytest
import pyuff

from oma import ModalEstimate, Place, normalise, places_by_name, write_universal
from tests.support.oma.structures import FRAME_DAMPING, FRAME_FREQUENCY, frame


def estimate(channels: tuple[str, ...], n_modes: int = 8) -> ModalEstimate:
    rng = np.random.default_rng(3)
    shape = rng.standard_normal((n_modes, len(channels))) + 0.1j * rng.standard_normal((n_modes, len(channels)))
    if channels == frame().channels:
        shape = frame().shapes * (1 + 0.02j * rng.standard_normal(frame().shapes.shape))
    return ModalEstimate(
        channels=channels,
        frequency=FRAME_FREQUENCY[:n_modes],
        frequency_std=1e-3 * FRAME_FREQUENCY[:n_modes],
        damping=FRAME_DAMPING[:n_modes],
        damping_std=0.1 * FRAME_DAMPING[:n_modes],
        shape=normalise(shape),
        shape_std=np.full(shape.shape, 0.01),
        support=np.ones(n_modes),
        law_ratio=np.ones(n_modes),
        start=0,
        end=1,
    )


def test_nodes_and_directions_are_parsed_from_channel_names() -> None:
    found = places_by_name(["12_x", "12_-y", "top_z", "near", "toP_X", "7_+Z"])
    assert {name: place.node for name, place in found.items()} == {
        "12_x": 12, "12_-y": 12, "top_z": 13, "near": 14, "toP_X": 15, "7_+Z": 7,
    }  # fmt: skip
    assert found["12_-y"].direction == (0, -1, 0)
    assert found["near"].direction == (1, 0, 0)
    assert found["7_+Z"].direction == (0, 0, 1)


def test_modes_written_to_universal_file_are_read_back(tmp_path: Path) -> None:
    modes = estimate(frame().channels)
    path = tmp_path / "modes.unv"
    path.write_text("something old")
    write_universal(path, modes)
    header, *found = pyuff.UFF(str(path)).read_sets()
    assert (header["type"], header["description"]) == (151, "modes")
    assert [s["type"] for s in found] == [55] * 8
    places = places_by_name(modes.channels)
    for k, mode in enumerate(found):
        assert mode["mode_n"] == k + 1
        assert abs(mode["eig"]) / (2 * np.pi) == pytest.approx(modes.frequency[k], rel=1e-5)  # six digits are written
        assert -mode["eig"].real / abs(mode["eig"]) == pytest.approx(modes.damping[k], rel=2e-5)
        for channel, value in zip(modes.channels, modes.shape[k], strict=True):
            at = mode["node_nums"].tolist().index(places[channel].node)
            motion = np.array([mode[axis][at] for axis in ("r1", "r2", "r3")])
            assert motion @ places[channel].direction == pytest.approx(value, abs=1e-5)


def test_oblique_channels_are_combined_to_motion_of_their_node(tmp_path: Path) -> None:
    """Three beams that meet at a node, as those of a laser do: their motion is that of the node."""
    beams = np.array([[0.8, 0.6, 0.0], [0.0, 0.8, 0.6], [0.6, 0.0, 0.8]])
    modes = estimate(("a", "b", "c"), 2)
    places = {
        c: Place(node=5, direction=(float(x), float(y), float(z))) for c, (x, y, z) in zip("abc", beams, strict=True)
    }
    path = tmp_path / "modes.unv"
    write_universal(path, modes, places, nodes={1: (0.0, 0.0, 0.0), 5: (0.1, -2.0, 3.0)}, lines=[(1, 5)])
    _, geometry, line, *found = pyuff.UFF(str(path)).read_sets()
    assert (geometry["node_nums"], geometry["z"]) == ([1, 5], [0, 3])
    assert line["nodes"].tolist() == [1, 5]
    motion = np.array([found[1][axis][0] for axis in ("r1", "r2", "r3")])
    np.testing.assert_allclose(beams @ motion, modes.shape[1], atol=1e-5)


def test_unwritable_path_raises_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write_universal(tmp_path / "none" / "modes.unv", estimate(("a", "b"), 1))
