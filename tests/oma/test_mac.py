import numpy as np
import pytest

from oma import comac, mac, mac_matrix, mpc, mpd, normalise
from tests.support.oma.structures import FRAME_SHAPES

TURN = np.exp(1.2j) * 3.7


def test_mac_is_independent_of_scale_and_phase() -> None:
    assert mac(FRAME_SHAPES[0], TURN * FRAME_SHAPES[0]) == pytest.approx(1.0, abs=1e-14)


def test_mac_of_orthogonal_shapes_is_zero() -> None:
    assert np.allclose(mac_matrix(np.eye(3), np.eye(3)), np.eye(3), atol=0)


def test_mac_of_different_channel_counts_is_refused() -> None:
    with pytest.raises(ValueError, match="found 3 and 4"):
        mac_matrix(np.eye(3), np.eye(4))


def test_normalised_shape_is_real_and_of_unit_norm() -> None:
    turned = normalise(TURN * FRAME_SHAPES)
    assert np.allclose(np.linalg.norm(turned, axis=1), 1.0, atol=1e-14)
    assert np.max(np.abs(turned.imag)) < 1e-14


def test_normalising_minimises_the_imaginary_part() -> None:
    rng = np.random.default_rng(3)
    shape = normalise(FRAME_SHAPES[3] + 0.3j * rng.standard_normal(12))
    turns = np.exp(1j * np.linspace(-np.pi, np.pi, 721))
    assert np.sum(shape.imag**2) <= np.min(np.sum((turns[:, None] * shape).imag ** 2, axis=1)) + 1e-12


def test_normalising_a_zero_shape_is_refused() -> None:
    with pytest.raises(ValueError, match="zero"):
        normalise(np.zeros(3))


@pytest.mark.parametrize("degrees", [0.0, 29.0, 60.0, 90.0])
def test_mpc_of_two_equal_devices_is_the_squared_cosine_of_their_phase(degrees: float) -> None:
    shape = np.array([1.0, np.exp(1j * np.radians(degrees))])
    assert mpc(shape) == pytest.approx(np.cos(np.radians(degrees)) ** 2, abs=1e-12)


def test_mpc_equals_the_eigenvalue_form() -> None:
    rng = np.random.default_rng(4)
    shape = rng.standard_normal(12) + 1j * rng.standard_normal(12)
    low, high = np.linalg.eigvalsh(np.array([shape.real, shape.imag]) @ np.array([shape.real, shape.imag]).T)
    assert mpc(shape) == pytest.approx(((high - low) / (high + low)) ** 2, rel=1e-10)


def test_mpd_of_two_components_is_half_their_phase_difference() -> None:
    # two equal components 40 degrees apart lie 20 degrees either side of the best line
    assert mpd(np.array([1.0, np.exp(1j * np.radians(40.0))])) == pytest.approx(np.radians(20.0), rel=1e-10)


def test_comac_of_equal_shapes_is_one_for_any_scale() -> None:
    assert comac(FRAME_SHAPES, (TURN * FRAME_SHAPES)) == pytest.approx(np.ones(12), abs=1e-12)


def test_comac_is_lowest_at_the_wrong_channel() -> None:
    damaged = FRAME_SHAPES.copy()
    damaged[:, 4] = damaged[::-1, 4]  # right in norm, wrong in each mode
    found = comac(FRAME_SHAPES, damaged)
    assert np.argmin(found) == 4
    assert np.delete(found, 4).min() > 0.95
    # by its definition: of moduli 3 and 4 against 4 and 3, (12 + 12)^2 / (25 * 25)
    two = comac(np.array([[3.0, 4.0], [4.0, 3.0]]), np.array([[4.0, 3.0], [3.0, 4.0]]))
    assert two == pytest.approx((24 / 25) ** 2)


def test_comac_of_motionless_channel_is_nan() -> None:
    still = np.array([[1.0, 0.0, 2.0]])
    assert np.isnan(comac(still, still)).tolist() == [False, True, False]
    with pytest.raises(ValueError, match="expected as many pairs"):
        comac(still, still[:, :2])
