"""Expansion of measured shapes: modes that make a shape up are found again, derivatives by finite differences."""

from collections.abc import Callable

import numpy as np
import pytest

from daq import FloatArray
from updater.reference import expand_change, expand_shape, orthonormal, orthonormal_slope, well_posed_cluster
from updater.reference.expansion import expand

N, SENSORS, PAIRED = 6, 5, 2
OMEGA = np.array([10.0, 21.0, 23.0, 24.0, 40.0, 60.0])  # outwards from the third by squares: 23, 24, 21, 10, 40, 60


@pytest.fixture
def shapes() -> FloatArray:
    """Return shapes (N, SENSORS) of a model, of a condition below 10 in any four."""
    return np.asarray(np.random.default_rng(3).standard_normal((N, SENSORS)))


def slope_of(function: Callable[[FloatArray], FloatArray], at: FloatArray) -> FloatArray:
    """Return the derivative (n_out, n_in) by central differences."""
    h = 1e-6
    return np.stack([(function(at + h * e) - function(at - h * e)) / (2 * h) for e in np.eye(len(at))], axis=1)


def test_expansion_recovers_the_modes_of_a_combined_shape(shapes: FloatArray) -> None:
    t = np.zeros(N)
    t[[2, 3]] = 1.3, -0.4
    np.testing.assert_allclose(expand(t @ shapes, shapes, OMEGA, PAIRED, largest=4), t, atol=1e-12)
    t[[1, 0]] = 0.2, 0.1  # as many as there may be
    np.testing.assert_allclose(expand(t @ shapes, shapes, OMEGA, PAIRED, largest=4), t, atol=1e-12)


def test_number_of_modes_minimises_the_leave_one_out_error(shapes: FloatArray) -> None:
    """By the leave-one-out error written out, sensor by sensor."""
    shape = shapes[2] + 0.05 * np.random.default_rng(8).standard_normal(SENSORS)
    near, errors = [2, 3, 1, 0], []
    for n in range(1, 5):
        left = 0.0
        for s in range(SENSORS):
            others = [k for k in range(SENSORS) if k != s]
            fitted = np.linalg.lstsq(shapes[near[:n]][:, others].T, shape[others], rcond=None)[0]
            left += (shape[s] - fitted @ shapes[near[:n], s]) ** 2
        errors.append(left)
    found = expand(shape, shapes, OMEGA, PAIRED, largest=4)
    assert set(np.flatnonzero(found)) == set(near[: 1 + int(np.argmin(errors))])


def test_cluster_contains_nearest_modes_and_fewer_modes_than_sensors(shapes: FloatArray) -> None:
    assert well_posed_cluster(shapes, OMEGA, PAIRED, largest=3).tolist() == [2, 3, 1]
    assert well_posed_cluster(shapes, OMEGA, PAIRED, largest=1).tolist() == [2]
    assert well_posed_cluster(shapes[:, :3], OMEGA, PAIRED, largest=6).tolist() == [2, 3]


def test_modes_indistinguishable_at_the_sensors_form_no_cluster() -> None:
    """Shapes of a condition of just under and just over ten."""
    for angle, n in ((0.22, 2), (0.18, 1)):  # cot(angle / 2) = 9.05, 11.1
        shapes = np.zeros((N, SENSORS))
        shapes[2, 0] = 1.0
        shapes[3, :2] = np.cos(angle), np.sin(angle)
        assert len(well_posed_cluster(shapes, OMEGA, PAIRED, largest=2)) == n


def test_orthonormal_matrix_is_nearest_and_has_correct_derivative() -> None:
    random = np.random.default_rng(5)
    t, slope = np.eye(4) + 0.3 * random.standard_normal((4, 4)), random.standard_normal((4, 3))
    u = orthonormal(t)
    np.testing.assert_allclose(u.T @ u, np.eye(4), atol=1e-13)
    polar = u.T @ t
    np.testing.assert_allclose(polar, polar.T, atol=1e-13)
    assert np.linalg.eigvalsh(polar).min() > 0

    def moved(x: FloatArray) -> FloatArray:
        after = t.copy()
        after[:, 1] += slope @ x
        return orthonormal(after).ravel()

    np.testing.assert_allclose(orthonormal_slope(t, 1, slope), slope_of(moved, np.zeros(3)), atol=1e-8)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_expanded_shape_has_unit_norm_and_correct_derivative(shapes: FloatArray, sign: float) -> None:
    shape = sign * (shapes[2] + 0.2 * shapes[3] + 0.1 * shapes[1])
    found = expand_shape(shape, shapes, OMEGA, PAIRED, largest=3)
    assert np.linalg.norm(found.t) == pytest.approx(1.0)
    assert found.t[[2, 3, 1]] == pytest.approx(np.array([1.0, 0.2, 0.1]) / np.sqrt(1.05))

    def of(x: FloatArray) -> FloatArray:
        return found.expand(x)

    np.testing.assert_allclose(of(shape), found.t, atol=1e-12)
    np.testing.assert_allclose(of(-shape), found.t, atol=1e-12)
    np.testing.assert_allclose(found.by_event, slope_of(of, shape), atol=1e-7)
    assert not found.by_base.any()


@pytest.mark.parametrize(("sign", "base_sign"), [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
def test_change_of_a_shape_is_added_to_the_paired_mode(shapes: FloatArray, sign: float, base_sign: float) -> None:
    """Eq. 12: the unit vectors of event and baseline, subtracted; signs of measured shapes mean nothing."""
    cluster = np.array([2, 3, 1])
    base = base_sign * (shapes[2] + 0.2 * shapes[3] + 0.04 * shapes[5])
    event = sign * (shapes[2] - 0.1 * shapes[3] + 0.3 * shapes[1] + 0.04 * shapes[5])

    def unit(x: FloatArray) -> FloatArray:
        t = np.zeros(N)
        t[cluster] = np.linalg.lstsq(shapes[cluster].T, x, rcond=None)[0]
        return np.asarray(np.sign(t[PAIRED]) * t / np.linalg.norm(t))

    def expected(x: FloatArray, b: FloatArray) -> FloatArray:
        t = np.eye(N)[PAIRED] + unit(x) - unit(b)
        return np.asarray(t / np.linalg.norm(t))

    found = expand_change(event, base, shapes, cluster, PAIRED)
    np.testing.assert_allclose(found.t, expected(event, base), atol=1e-12)
    np.testing.assert_allclose(found.expand(np.stack([event, -event])), [found.t, found.t], atol=1e-12)
    np.testing.assert_allclose(found.by_event, slope_of(lambda x: expected(x, base), event), atol=1e-7)
    np.testing.assert_allclose(found.by_base, slope_of(lambda b: expected(event, b), base), atol=1e-7)
    same = expand_change(base, base, shapes, cluster, PAIRED)
    np.testing.assert_allclose(same.t, np.eye(N)[PAIRED], atol=1e-12)
