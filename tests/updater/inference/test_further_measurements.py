"""A sensor or a known mass is added after the change, where the diagnosis advises it."""

from dataclasses import replace

import numpy as np
import pytest

from monitor.text.diagnosis import mass_test_text
from tests.support.thorough import few_of
from tests.support.updater.diagnosis_data import COLUMN, HALF, TOP, Change, MeasuredAgain, learnt
from updater import Body, Circumstances, DiagnosisResult, diagnose
from updater.diagnosis import Measurement, Separation
from updater.inference.comparison import one_to_one
from updater.modal_data import KnownMass

#: seeds, and causes that are compared: of the ordinary case some, of the others all
SEEDS = few_of([(1, ("added_mass", "distributed_mass")), *((seed, ()) for seed in range(1, 21))])


def body_on_the_crossbeam(seed: int) -> Body:
    random = np.random.default_rng((seed, 0))
    at = float(random.choice([-1, 1]) * random.uniform(0.1, 0.38))
    return Body(at=(at, 0.0, TOP), mass=float(random.uniform(0.1, 0.4)))


def advised(found: DiagnosisResult, kind: str) -> Measurement:
    assert found.diagnosis.verdict == "ambiguous"
    assert isinstance(found.next_measurement, Separation)
    return next(one for one in found.next_measurement.measurements if one.kind == kind)


def assert_is_body(found: DiagnosisResult, body: Body) -> None:
    """The mirror image was as probable; a short stretch with a mass is nearly the same."""
    (cause,) = found.diagnosis.causes
    assert "added_mass" in {cause.cause, *cause.cannot_be_told_from}
    assert cause.where
    assert cause.where.position
    assert np.sign(cause.where.position[0]) == np.sign(body.at[0])
    if cause.cause == "added_mass":
        mass = cause.parameters["mass"]
        assert cause.where.position_std
        assert mass.std
        assert abs(cause.where.position[0] - body.at[0]) < 4 * cause.where.position_std
        assert abs(mass.value - body.mass) < 4 * mass.std


@pytest.mark.parametrize(("seed", "only"), SEEDS)
def test_sensor_where_it_is_advised_decides_between_mirror_images(seed: int, only: tuple[str, ...]) -> None:
    body = body_on_the_crossbeam(seed)
    site = MeasuredAgain(seed, Change((body,)), COLUMN, only)
    sensor = advised(site.answer(), "sensor")
    assert sensor.position
    assert (sensor.pairs[0], sensor.position[2]) == ((0, 1), TOP)
    assert sensor.deviations > 3
    assert_is_body(site.with_sensor(sensor.position, sensor.axis), body)


@pytest.mark.parametrize("seed", few_of(range(1, 41)))
def test_errors_of_a_further_sensor_are_no_change(seed: int) -> None:
    random = np.random.default_rng((seed, 0))
    at, axis = (float(random.uniform(-HALF, HALF)), 0.0, TOP), "yz"[random.integers(2)]
    found = MeasuredAgain(seed, Change(), COLUMN).with_sensor(at, axis)
    assert found.diagnosis.verdict == "nothing_to_explain"


@pytest.mark.parametrize(("seed", "only"), SEEDS)
def test_known_mass_decides_between_mirror_images(seed: int, only: tuple[str, ...]) -> None:
    """At twice the distance of the crossbeam's middle from the body, so that the shifts differ."""
    body = body_on_the_crossbeam(seed)
    at = (float(np.clip(2 * abs(body.at[0]), 0.2, HALF)), 0.0, TOP)
    found = MeasuredAgain(seed, Change((body,)), COLUMN, only).with_mass(at, 0.15)
    assert_is_body(found, body)
    (test,) = found.diagnosis.mass_tests
    assert test.p_value > 1e-4


@pytest.mark.parametrize(("seed", "name"), few_of([(2, "density"), (1, "stiffness")]))
def test_known_mass_where_it_is_advised_decides_between_stiffness_and_density(seed: int, name: str) -> None:
    change = Change(stiffness=0.96) if name == "stiffness" else Change(density=1.04)
    site = MeasuredAgain(seed, change)
    found = site.answer()
    (cause,) = found.diagnosis.causes
    assert {"global_stiffness", "global_density"} <= {cause.cause, *cause.cannot_be_told_from}
    mass = advised(found, "known_mass")
    assert mass.position
    assert mass.deviations > 3
    again = site.with_mass(mass.position, mass.mass)
    (cause,) = again.diagnosis.causes
    other = {"stiffness": "global_density", "density": "global_stiffness"}[name]
    assert f"global_{name}" in {cause.cause, *cause.cannot_be_told_from}
    assert other not in {cause.cause, *cause.cannot_be_told_from}


def test_known_mass_without_a_common_mode_decides_nothing() -> None:
    """No datum: the probability of larger differences is one, and a mode with the mass is not required."""
    reference, _, event = learnt(1)
    now = event(Change((Body(at=(0.2, 0.0, TOP), mass=0.2),)))
    unseen = replace(now, log_frequency=np.full(len(now.n), np.nan))
    known = KnownMass(mass=0.15, position=(0.3, 0.0, TOP), modes=unseen)
    found = diagnose(reference, now, circumstances=Circumstances(known_masses=(known,)), only=("added_mass",))
    (test,) = found.diagnosis.mass_tests
    assert (test.modes, test.p_value) == ((), 1.0)
    alone = diagnose(reference, now, only=("added_mass",))
    assert found.diagnosis.causes == alone.diagnosis.causes


@pytest.mark.parametrize(("seed", "only"), few_of([(1, ("added_mass",)), *((seed, ()) for seed in range(1, 6))]))
def test_record_with_a_known_mass_of_another_state_is_left_out(seed: int, only: tuple[str, ...]) -> None:
    """The record with the mass is of the frame before a body was added: no cause explains it and the one after."""
    body = body_on_the_crossbeam(seed)
    site = MeasuredAgain(seed, Change((body,)), only=only)
    found = site.with_mass((HALF, 0.0, TOP), 0.15, Change())
    (test,) = found.diagnosis.mass_tests
    assert test.left_out
    assert test.p_value < 1e-6
    assert mass_test_text(test).endswith("; no cause explains both records, this one is left out")
    assert found.diagnosis.causes == site.answer().diagnosis.causes


@pytest.mark.parametrize("only", [("added_mass",), pytest.param((), marks=pytest.mark.thorough)])
def test_heavy_known_mass_is_predicted(only: tuple[str, ...]) -> None:
    """5 kg, more than half of the frame's mass: shifts by up to half, modes pass others."""
    body = body_on_the_crossbeam(1)
    found = MeasuredAgain(1, Change((body,)), only=only).with_mass((0.35, 0.0, TOP), 5.0)
    assert_is_body(found, body)
    (test,) = found.diagnosis.mass_tests
    assert test.p_value > 1e-3
    assert min(mode.measured_percent for mode in test.modes) < -40


def test_no_two_modes_have_one_successor() -> None:
    """Two modes mixed half and half by a large mass, within rounding of the same largest share."""
    share = np.array([[[0.52, 0.48, 0.0], [0.51, 0.3, 0.19], [0.0, 0.2, 0.8]], np.eye(3)[[1, 0, 2]]])
    assert one_to_one(share).tolist() == [[1, 0, 2], [1, 0, 2]]


def test_held_out_record_of_a_file_may_have_a_further_sensor() -> None:
    """The modes of a file are those at the sensors of the logs: the held-out record is compared at these."""
    site = MeasuredAgain(1, Change((Body(at=(0.3, 0.0, TOP), mass=0.3),)), COLUMN, ("model_parameters", "added_mass"))
    diagnosis = site.of_file_with_held_out_sensor((0.2, 0.0, TOP)).diagnosis
    assert diagnosis.failed == ()
    assert diagnosis.gain is not None
    assert diagnosis.gain.heldout


def test_one_channel_of_the_baseline_is_too_few_with_a_further_sensor() -> None:
    """The shapes of the model are scaled by those of the baseline: at one channel, these have no information."""
    reference, _, _ = learnt(1)
    reference = replace(reference, baseline=reference.baseline.at(COLUMN))
    further = next(c for c in reference.structure.channels if c not in COLUMN)
    assert reference.comparable((further, *COLUMN[:2])) == (*COLUMN[:2], further)
    assert reference.comparable((further, COLUMN[0])) == COLUMN[:1]


@pytest.mark.thorough
def test_p_values_of_known_masses_are_not_too_small() -> None:
    """On an unchanged frame, anywhere on the crossbeam: at most one in ten is below 0.1, within its own scatter."""
    p_values = []
    for seed in range(40):
        random = np.random.default_rng((seed, 0))
        found = MeasuredAgain(seed, Change()).with_mass((float(random.uniform(-HALF, HALF)), 0.0, TOP), 0.15)
        assert found.diagnosis.verdict == "nothing_to_explain"
        p_values += [test.p_value for test in found.diagnosis.mass_tests]
    assert np.count_nonzero(np.array(p_values) < 0.1) <= 4 + 3 * 3.6**0.5
