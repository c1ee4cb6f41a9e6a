"""Modal masses at driving points, and the responses that modes make up: closed forms."""

import numpy as np
import pytest

from daq import FloatArray
from oma import ComplexArray, ResponseIdentification, identify_responses_all

FREQUENCY, DAMPING = np.array([8.0, 15.0, 24.0]), np.array([0.01, 0.008, 0.015])
SHAPE = np.array([[0.2, 0.5, 0.3], [0.4, -0.1, -0.3], [0.3, -0.4, 0.5]])  # mass-normalised, a mode a row [kg^-1/2]
MASS = 1 / np.sum(SHAPE**2, axis=1)
CHANNELS = ("1_x", "2_x", "3_-y")
LINE: FloatArray = np.linspace(0.1, 40.0, 400)


def accelerances(forces: tuple[int, ...], decay: float = 0.0) -> ComplexArray:
    s = (decay + 2j * np.pi * LINE)[:, None] / (2 * np.pi * FREQUENCY)
    resonance = s**2 / (1 + s**2 + 2 * DAMPING * s)
    return np.asarray(np.einsum("lk,ko,ki->loi", resonance, SHAPE, SHAPE[:, list(forces)]))


def identified(forces: tuple[str, ...], *columns: int, sign: float = 1.0, decay: float = 0.0) -> ResponseIdentification:
    window = 1 / decay if decay else None
    return identify_responses_all(LINE, sign * accelerances(columns, decay), CHANNELS, forces, window=window)


@pytest.mark.parametrize(
    ("forces", "columns", "sign"),
    [(("2_x",), (1,), 1.0), (("2_-x",), (1,), -1.0), (("3_-y", "9_z"), (2, 0), 1.0), (("3_y",), (2,), -1.0)],
)
def test_driving_points_give_modal_masses(forces: tuple[str, ...], columns: tuple[int, ...], sign: float) -> None:
    """Without noise the straight line for modes outside a fit remains: 1e-3."""
    found = identified(forces, *columns, sign=sign)
    np.testing.assert_allclose(found.modal_mass, MASS, rtol=1e-3)
    size = np.abs(found.mass_normalised_shape)
    np.testing.assert_allclose(size, np.abs(SHAPE), atol=1e-3)


def test_masses_are_those_with_a_window() -> None:
    np.testing.assert_allclose(identified(("1_x",), 0, decay=0.5).modal_mass, MASS, rtol=1e-3)


def test_force_at_no_channel_gives_no_mass() -> None:
    found = identified(("9_x",), 0)
    assert np.isnan(found.modal_mass).all()
    assert np.isnan(identified(("1_y",), 0).modal_mass).all()  # across the channel
    assert np.isnan(identify_responses_all(LINE, accelerances((0,)), CHANNELS).modal_mass).all()


def test_reversed_sensor_gives_negative_masses() -> None:
    np.testing.assert_allclose(identified(("1_x",), 0, sign=-1.0).modal_mass, -MASS, rtol=1e-3)


def test_modes_make_up_the_responses() -> None:
    found = identified(("1_x",), 0)
    assert found.agreement.min() > 1 - 1e-6
    np.testing.assert_allclose(found.synthesis, found.response, atol=1e-3 * np.abs(found.response).max())


def test_rest_of_a_record_is_stated() -> None:
    """Free vibration decays as exp(-zeta omega t)."""
    found = identified(("1_x",), 0, decay=0.5)
    rate = 2 * np.pi * FREQUENCY * DAMPING + 0.5
    np.testing.assert_allclose(found.left_at_end, np.exp(-10 * rate), rtol=1e-2)
