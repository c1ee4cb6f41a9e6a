"""Errors of a file's sensors that all modes have in common, against files with other sensors."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from daq import FloatArray
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Reference, build_model, learn_reference, matched, nominal_reference, stack_tracks
from updater.causes import CATALOGUE
from updater.inference import Comparison, beside, compare, errors_of_unmeasured, fit, mixing_of, no_effect
from updater.inference.shape_covariance import turned_back
from updater.modal_data import Circumstances, Mixing
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


def learnt() -> tuple[Reference, Comparison]:
    """Return a reference that was measured on another frame, and modes of this after the gain of a channel rose."""
    random, bare = np.random.default_rng(2), true_model(np.random.default_rng((2, 1)))
    reference = learn_reference(t_frame(), [measure(bare, random, np.ones(N)) for _ in range(8)], [TRACK] * 8)
    louder = np.r_[1.05, np.ones(N - 1)]
    event = stack_tracks([measure(bare, random, louder) for _ in range(3)], [TRACK] * 3)
    return reference, compare(reference, reference.mean_of(event))


def mixed(data: Comparison, seed: int) -> Mixing:
    """Return modes that three random springs mix."""
    random = np.random.default_rng(seed)
    root = random.standard_normal((len(data.frequency), 3)) / (2 * np.pi * data.frequency)[:, None]
    return mixing_of(data, replace(no_effect(1, data), compliance=(0.1 * root @ root.T)[None]), data.paired, 2e-3)


@pytest.mark.parametrize("seed", [2, 5])
def test_a_gain_has_one_sign_in_all_modes_that_unmeasured_ones_are_mixed_into(seed: int) -> None:
    """Against shapes read with the gain 1e-5 higher, whatever the signs of the eigenvectors."""
    reference, data = learnt()
    mixing, h = mixed(data, seed), 1e-5
    found = errors_of_unmeasured(reference, data.tracks, data.channels, mixing, data.base).sensors[:, :, 0]
    now = (data.at_channels @ mixing.shape[:, data.paired]).T
    others = mixing.shape[:, data.paired].copy()
    others[data.paired] = 0.0
    read = now.copy()
    read[:, 0] += h * (data.at_channels[0] @ others)
    read *= np.where((read * data.base).sum(1) < 0, -1, 1)[:, None] / np.linalg.norm(read, axis=1, keepdims=True)
    unit = now / np.linalg.norm(now, axis=1, keepdims=True)
    expected = turned_back(beside(read, unit), unit, data.base) * GAIN_STD / h
    assert ((now * data.base).sum(1) < 0).any()
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


def test_errors_in_unmeasured_modes_are_no_errors_of_the_sensors_of_a_measured_baseline() -> None:
    """A mixing without effect changes neither the comparison nor the deviation of a gain."""
    reference, data = learnt()
    none = mixed(data, 3)
    none = replace(
        none,
        shifts=np.full(len(none.shifts), np.nan),
        log_frequency=0 * none.log_frequency,
        shape=np.eye(len(none.shape)),
        turned=0 * none.turned,
    )
    event = stack_tracks(
        [measure(true_model(np.random.default_rng((2, 1))), np.random.default_rng(4), np.r_[1.05, np.ones(N - 1)])] * 3,
        [TRACK] * 3,
    )
    stated = []
    for mixing in (None, none):
        compared = compare(reference, reference.mean_of(event), circumstances=Circumstances(mixing=mixing))
        cause = CATALOGUE["sensor_gain"].propose(reference, compared)
        assert cause is not None
        stated.append(cause.parameters(fit(compared, cause))["gain"])
    assert stated[1].std == pytest.approx(stated[0].std, rel=1e-6)
    assert stated[1].value == pytest.approx(stated[0].value, rel=1e-6)


def test_unmeasured_modes_have_the_errors_of_the_sensors_of_a_file_too() -> None:
    reference, data = compared()
    errors = errors_of_unmeasured(reference, data.tracks, data.channels, mixed(data, 6), data.base)
    assert errors.sensors.shape[:2] == data.base.shape
    assert np.abs(errors.sensors).max() > 0
    with_them = compare(
        reference, matched(reference.baseline, reference.baseline), circumstances=Circumstances(mixing=mixed(data, 6))
    )
    assert with_them.common_errors.shape[2] == errors.sensors.shape[2]
