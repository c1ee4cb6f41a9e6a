"""Sensors are compared with the predictions of the structure with its causes, not with its former state."""

from dataclasses import replace

import numpy as np

from tests.support.updater.diagnosis_data import CHANNELS, Change, learnt
from updater import Body, sensor_health
from updater.structure import Correction
from updater.validation import with_acting

BODY = Body(at=(0.25, 0, 1.48), mass=1.0)
FAULTY = CHANNELS.index("beam_left_z")


def test_acting_mass_neither_causes_nor_masks_sensor_faults() -> None:
    """A seventh of the frame's mass turns shapes by more than sensors are named for; a gain of 0.85 stays one."""
    reference, _, event = learnt(31)
    now = event(Change(bodies=(BODY,), gain=(("beam_left_z", 0.85),)))
    extended = reference.structure.with_bodies([BODY])
    extended = extended.model_copy(update={"sensors": {"beam_left_z": Correction(gain=0.85)}})
    true = np.where(np.arange(12) == FAULTY, 0.85, 1.0)
    before = np.abs(sensor_health(reference, now).gain - true)
    found = sensor_health(with_acting(reference, extended), now)
    after = np.abs(found.gain - true)
    print(before, after, found.gain_std)
    assert before.max() > 0.03
    assert after.max() < 0.02
    assert (after < 4 * found.gain_std).all()


def test_sensor_corrections_do_not_change_the_reference_shapes() -> None:
    reference, _, _ = learnt(32)
    own = reference.structure
    extended = own.model_copy(update={"sensors": {"beam_left_z": Correction(gain=0.5)}})
    found = with_acting(reference, extended).baseline
    np.testing.assert_allclose(found.shape, reference.baseline.shape, atol=1e-9)
    assert replace(found, shape=reference.baseline.shape).log_frequency.tolist() == (
        reference.baseline.log_frequency.tolist()
    )


def test_health_of_exchanged_channels_refers_to_the_actual_sensors() -> None:
    """They had no data of the sensors of their names, and were called dead."""
    reference, _, event = learnt(33)
    pair = ("col_037_x", "beam_left_z")
    now = event(Change(order=(pair,), gain=(("beam_right_z", 0.9),)))
    exchanged = {pair[0]: Correction(channel=pair[1]), pair[1]: Correction(channel=pair[0])}
    extended = reference.structure.model_copy(update={"sensors": exchanged})
    columns = [CHANNELS.index(channel) for channel in pair]
    assert (np.abs(sensor_health(reference, now).gain[columns] - 1) > 0.5).all()
    found = sensor_health(with_acting(reference, extended), now).gain
    np.testing.assert_allclose(found, np.where(np.arange(12) == CHANNELS.index("beam_right_z"), 0.9, 1.0), atol=0.02)
