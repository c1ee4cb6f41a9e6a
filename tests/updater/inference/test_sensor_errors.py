"""Errors of a file's sensors that all modes have in common, against files with other sensors."""

from collections.abc import Sequence

import numpy as np
import pytest

from daq import FloatArray
from tests.support.updater.reference_frame import measure, t_frame
from updater import Reference, build_model, matched, nominal_reference, stack_tracks
from updater.inference import Comparison, compare
from updater.quantities import ASKEW_STD, GAIN_STD, PLACE_STD, Vector, vector
from updater.structure import Sensor, sensor_axes, size

TRACK = np.arange(8)
SEED = 977
N = 12  # channels


def compared() -> tuple[Reference, Comparison]:
    """Return the file of the T-frame as a reference, and modes that are its own."""
    structure, random = t_frame(), np.random.default_rng(SEED)
    model = build_model(structure, shear_flexible=True, mass="consistent")
    windows = stack_tracks([measure(model, random, np.ones(N)) for _ in range(3)], [TRACK] * 3)
    reference = nominal_reference(structure, windows)
    return reference, compare(reference, matched(reference.baseline, reference.mean_of(windows)))


def replaced(sensor: Sensor, chosen: bool, **update: Vector) -> Sensor:
    """Return a sensor with another place or direction, if it is a chosen one."""
    return sensor.model_copy(update=update) if chosen else sensor


def read_by(reference: Reference, data: Comparison, sensors: Sequence[Sensor]) -> FloatArray:
    """Return the modes (n, n_channels) as other sensors read them, as the change of unit shapes beyond their own."""
    structure = reference.structure.model_copy(update={"sensor": tuple(sensors)})
    model = build_model(structure, shear_flexible=True, mass="consistent")
    found = (model.sensor_rows @ reference.shape)[:, data.paired].T
    return np.asarray(found / (found * data.model_base).sum(1, keepdims=True) - data.model_base)


@pytest.mark.parametrize("index", [0, 5])
def test_errors_are_those_of_a_file_with_other_sensors(index: int) -> None:
    """By a hundredth of a deviation: second order is 0.1 % at most; 3 % of a slope are by shear."""
    reference, data = compared()
    sensors, step = reference.structure.sensor, 0.01
    own = sensors[index]
    gains, turns, offsets = np.split(data.sensor_errors, [N, 3 * N], axis=2)
    scaled = data.model_base.copy()
    scaled[:, index] *= 1 + step * GAIN_STD
    louder = scaled / (scaled * data.model_base).sum(1, keepdims=True) - data.model_base
    assert np.abs(louder / step - gains[:, :, index]).max() < 1e-3 * np.abs(gains[:, :, index]).max()
    along, first, _ = sensor_axes(own.direction)
    direction = vector(along + step * ASKEW_STD * first)
    turned = read_by(reference, data, [replaced(s, s is own, direction=direction) for s in sensors])
    assert np.abs(turned / step - turns[:, :, index]).max() < step * ASKEW_STD**2 / 2  # a unit direction's own part
    member = next(m for m in reference.structure.member if m.passes(own.at))
    axis = int(np.argmax(np.abs(np.subtract(member.end, member.start))))
    at = vector(np.add(own.at, step * PLACE_STD * size(reference.structure) * np.eye(3)[axis]))
    moved = read_by(reference, data, [replaced(s, s.at == own.at, at=at) for s in sensors])
    column = offsets[:, :, 3 * list(dict.fromkeys(s.at for s in sensors)).index(own.at) + axis]
    assert np.abs(moved / step - column).max() < 0.04 * np.abs(column).max()


def test_residuals_of_common_errors_are_white() -> None:
    """(I - S S^T) (I + V V^T) (I - S S^T) is the identity, to rounding."""
    _, data = compared()
    errors = (data.shape_whitener @ data.sensor_errors).reshape(data.shape.size, -1)
    left = np.eye(data.shape.size) - data.common_to_modes @ data.common_to_modes.T
    np.testing.assert_allclose(left @ (np.eye(len(left)) + errors @ errors.T) @ left, np.eye(len(left)), atol=1e-9)
    assert errors.shape[1] == 3 * N + 3 * len({s.at for s in t_frame().sensor})
