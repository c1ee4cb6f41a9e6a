"""A sensor is added after the change, where the diagnosis asks for it."""

import numpy as np
import pytest

from tests.support.updater.diagnosis_data import TRACK, Change
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    Body,
    DiagnosisResult,
    Model,
    Structure,
    build_model,
    diagnose,
    learn_reference,
    matched,
    stack_tracks,
)
from updater.diagnosis import Separation
from updater.structure import Sensor

COLUMN = tuple(c for c in t_frame().channels if c.startswith("col"))
GAIN, TILT, PLACE = 0.01, 0.02, 0.003  # standard deviations of the new sensor: gain [-], direction [rad], place [m]
TOP, HALF = 1.48, 0.399  # m: height of the crossbeam, and a bit less than half of its length


def with_column(structure: Structure, *more: Sensor) -> Structure:
    """Return a frame with other sensors and those of its column, which cannot distinguish mirror images."""
    kept = tuple(s for s in structure.sensor if s.channel in COLUMN)
    return structure.model_copy(update={"sensor": kept + more})


class Site:
    """A frame of finer elements, measured before and after a change."""

    def __init__(self, seed: int, change: Change) -> None:
        print(f"seed {seed}")
        self.random, self._change = np.random.default_rng((seed, 1)), change
        self._bare = true_model(np.random.default_rng((seed, 2)))
        self._gain = 1 + 0.005 * self.random.standard_normal(len(COLUMN))
        model = self._built()
        self._before = [measure(model, self.random, self._gain) for _ in range(8)]

    def _built(self, *more: Sensor) -> Model:
        return build_model(with_column(self._bare.structure, *more), shear_flexible=True, mass="consistent")

    def answer(self, *more: Sensor) -> DiagnosisResult:
        """Diagnose the change, with sensors that the reference lacks."""
        reference = learn_reference(with_column(t_frame(), *more), self._before, [TRACK] * 8)
        model = self._change.of(self._built(*(self._with_errors(one) for one in more)))
        gain = np.append(self._gain, 1 + GAIN * self.random.standard_normal(len(more)))
        windows = [measure(model, self.random, gain) for _ in range(5)]
        return diagnose(reference, matched(reference.baseline, reference.mean_of(stack_tracks(windows, [TRACK] * 5))))

    def _with_errors(self, sensor: Sensor) -> Sensor:
        direction = np.array(sensor.direction)
        direction = direction + TILT * self.random.standard_normal(3) * (1 - np.abs(direction))
        x = np.clip(sensor.at[0] + PLACE * self.random.standard_normal(), -HALF, HALF)
        return Sensor(channel=sensor.channel, at=(x, 0.0, TOP), direction=tuple(direction / np.linalg.norm(direction)))


@pytest.mark.parametrize("seed", [1, 2, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(3, 21))])
def test_sensor_where_it_is_advised_decides_between_mirror_images(seed: int) -> None:
    random = np.random.default_rng((seed, 0))
    at, mass = float(random.choice([-1, 1]) * random.uniform(0.1, 0.38)), float(random.uniform(0.1, 0.4))
    site = Site(seed, Change((Body(at=(at, 0.0, TOP), mass=mass),)))
    first = site.answer()
    assert first.diagnosis.verdict == "ambiguous"
    assert isinstance(first.next_measurement, Separation)
    advised = next(one for one in first.next_measurement.measurements if one.kind == "sensor")
    assert advised.position
    assert (advised.pairs[0], advised.position[2]) == ((0, 1), TOP)
    assert advised.deviations > 3
    axis = np.eye(3)["xyz".index(advised.axis)]
    second = site.answer(Sensor(channel="further", at=advised.position, direction=tuple(axis)))
    (cause,) = second.diagnosis.causes
    assert "added_mass" in {cause.cause, *cause.cannot_be_told_from}  # a short stretch is nearly the same
    assert cause.where
    assert cause.where.position
    assert np.sign(cause.where.position[0]) == np.sign(at)
    if cause.cause == "added_mass":
        found = cause.parameters["mass"]
        assert cause.where.position_std
        assert found.std
        assert abs(cause.where.position[0] - at) < 4 * cause.where.position_std
        assert abs(found.value - mass) < 4 * found.std


@pytest.mark.parametrize("seed", [1, 2, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(3, 41))])
def test_errors_of_a_further_sensor_are_no_change(seed: int) -> None:
    random = np.random.default_rng((seed, 0))
    axis = tuple(np.eye(3)[1 + int(random.integers(2))])
    further = Sensor(channel="further", at=(float(random.uniform(-HALF, HALF)), 0.0, TOP), direction=axis)
    assert Site(seed, Change()).answer(further).diagnosis.verdict == "nothing_to_explain"
