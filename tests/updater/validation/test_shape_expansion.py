"""Measured shapes at all nodes: those of the model itself come back, also where no sensor is."""

import numpy as np

from tests.support.updater.frames import as_estimate, t_frame
from updater import build_model
from updater.validation import expand_measured, model_modes


def test_shapes_of_the_model_at_its_sensors_are_expanded_to_its_nodes() -> None:
    model = build_model(t_frame(), shear_flexible=True, mass="consistent")
    modes = model.modes(6)
    turned = np.exp(1j * np.linspace(-0.4, 0.4, 6))  # the phases of measured shapes are arbitrary
    shapes = (model.sensor_rows @ modes.shape * turned).T
    estimate = as_estimate(1.01 * modes.frequency, shapes, channels=model.structure.channels)
    found = expand_measured(estimate, model_modes(estimate, model.structure))
    every = np.vstack([modes.shape, np.zeros((1, 6))])[model.dofs]  # (n_nodes, 6, n_modes)
    for k, turn in enumerate(turned):
        true, largest = every[:, :, k], np.linalg.norm(every[:, :3, k], axis=1).max()
        scale = np.vdot(true[:, :3], found.translation[k]) / np.vdot(true[:, :3], true[:, :3])
        assert abs(abs(scale) * largest - 1) < 1e-9
        assert abs(np.angle(scale**2 / turn**2)) < 1e-9  # up to the sign
        np.testing.assert_allclose(found.translation[k], scale * true[:, :3], atol=1e-6)
        np.testing.assert_allclose(found.rotation[k], scale * true[:, 3:], atol=1e-5)


def test_a_measured_mode_finds_its_partner_however_many_modes_of_the_model_are_below_it() -> None:
    """Slender members, such as guys, have modes of their own among those that are measured."""
    model = build_model(t_frame(), shear_flexible=True, mass="consistent")
    modes = model.modes(40)
    above = np.array([37])
    shapes = (model.sensor_rows @ modes.shape[:, above]).T
    estimate = as_estimate(modes.frequency[above], shapes, channels=model.structure.channels)
    partner = model_modes(estimate, model.structure).partner(0)
    assert partner is not None
    np.testing.assert_allclose([partner.frequency, partner.mac], [modes.frequency[37], 1.0], rtol=1e-6)
