"""Positions of sensors: motion in space from channels, and lines between positions."""

import numpy as np
import pytest

from monitor.results.sensor_geometry import SensorGeometry

SKEW = {
    "a_1": ((0.0, 0.0, 1.0), (2.0, 0.0, 0.0)),
    "a_2": ((0.0, 0.0, 1.0), (1.0, 1.0, 0.0)),
    "a_3": ((0.0, 0.0, 1.0), (0.0, 1.0, -1.0)),
    "b_x": ((3.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    "b_x_again": ((3.0, 0.0, 1.0), (-1.0, 0.0, 0.0)),
}


def test_motion_is_recovered_from_oblique_and_repeated_channels() -> None:
    geometry, random = SensorGeometry(sensors=SKEW), np.random.default_rng(5)
    print("seed 5")
    motion = random.standard_normal((2, 2, 3)) + 1j * random.standard_normal((2, 2, 3))
    unit = {name: np.array(way) / np.linalg.norm(way) for name, (_, way) in SKEW.items()}
    shape = np.stack([motion[:, int(name[0] == "b")] @ unit[name] for name in SKEW], axis=1)
    found = geometry.displacement([*SKEW, "elsewhere"], np.c_[shape, [7, 7]])
    np.testing.assert_allclose(found[:, 0], motion[:, 0], atol=1e-14)
    np.testing.assert_allclose(found[:, 1], motion[:, 1] * [1, 0, 0], atol=1e-14)  # y and z are not measured
    without = geometry.displacement(["b_x"], shape[:, 3:4])
    assert not without[:, 0].any()


def test_lines_are_those_given_or_join_nearest_neighbours() -> None:
    at = {"foot": (0.0, 0.0, 0.0), "left": (-2.0, 0.0, 3.0), "top": (0.0, 0.0, 3.0), "right": (1.0, 0.0, 3.0)}
    sensors = {name: (place, (1.0, 0.0, 0.0)) for name, place in at.items()}
    joined = {frozenset(chain) for chain in SensorGeometry(sensors=sensors).chains}
    assert joined == {frozenset(pair) for pair in ((0, 2), (1, 2), (2, 3))}
    given = SensorGeometry(sensors=sensors, lines=(("left", "top", "foot"), ("top", "right")))
    assert given.chains == [[1, 2, 0], [2, 3]]


@pytest.mark.parametrize("n", [2, 12])
def test_lines_of_sensors_in_a_row_follow_it(n: int) -> None:
    order = np.random.default_rng(6).permutation(n).tolist()
    sensors = {str(k): ((float(place), 0.0, 0.0), (0.0, 0.0, 1.0)) for k, place in enumerate(order)}
    assert all(abs(order[a] - order[b]) == 1 for a, b in SensorGeometry(sensors=sensors).chains)
    assert len(SensorGeometry(sensors=sensors).chains) == n - 1
