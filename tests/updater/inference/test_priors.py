"""Priors of a magnitude of unknown order, in the place of a Gaussian one."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from updater.inference import common_magnitude, log_uniform

GAUSSIAN, MIN, MAX = 1.5, 1e-3, 7.5


def prior(x: float) -> float:
    return 1 / (2 * np.log(MAX / MIN) * abs(x)) if MIN <= abs(x) <= MAX else 0.0


@pytest.mark.parametrize(("value", "std"), [(0.3, 0.1), (-0.02, 0.05), (0.0, 0.004), (0.3, 0.003)])
def test_posterior_matches_numerical_quadrature(value: float, std: float) -> None:
    """Where the prior is taken as constant the error is (std / value)^2 < 0.25 %; else that of 200 points."""

    def weighed(x: float, power: int) -> float:
        return float(x**power * norm.pdf(x, value, std) * prior(x) / norm.pdf(x, 0, GAUSSIAN))

    def integral(power: int) -> float:
        near = [p for p in (value - 8 * std, value, value + 8 * std) if MIN < abs(p) < MAX]
        edges = sorted([-MAX, -0.1, -0.01, -MIN, MIN, 0.01, 0.1, MAX, *near])
        return sum(quad(weighed, a, b, args=(power,))[0] for a, b in itertools.pairwise(edges))

    whole, mean = integral(0), integral(1)
    found = log_uniform(np.array([value]), np.array([std]), gaussian=GAUSSIAN, least=MIN, most=MAX)
    assert found.log_ratio[0] == pytest.approx(np.log(whole), abs=0.01)
    assert found.mean[0] == pytest.approx(mean / whole, abs=0.01 * std)
    assert found.variance[0] == pytest.approx(integral(2) / whole - (mean / whole) ** 2, rel=0.02)


def test_log_uniform_prior_is_proper() -> None:
    """Data without information leave the Gaussian prior; its evidence is then the other prior's whole probability."""
    found = log_uniform(np.zeros(1), np.array([GAUSSIAN]), gaussian=GAUSSIAN, least=MIN, most=MAX)
    assert found.log_ratio[0] == pytest.approx(0, abs=1e-9)


def test_common_magnitude_matches_numerical_quadrature() -> None:
    """Of two correlated parameters, over a grid of 0.2 deviations; the Gaussian's own order has no correction."""
    information, pull, gaussian = np.array([[9e4, 3e4], [3e4, 6e4]]), np.array([1500.0, 1800.0]), 0.1
    axis = np.linspace(-0.15, 0.15, 601)
    point = np.stack(np.meshgrid(axis, axis), axis=-1)
    likelihood = point @ pull - 0.5 * np.einsum("abi,ij,abj->ab", point, information, point)
    likelihood = np.exp(likelihood - likelihood.max())

    def evidence(std: float) -> float:
        prior = np.exp(-0.5 * (point**2).sum(-1) / std**2) / (2 * np.pi * std**2)
        return float((likelihood * prior).sum())

    covariance = np.asarray(np.linalg.inv(information + np.eye(2) / gaussian**2), np.float64)
    value = covariance @ pull
    orders = np.exp(np.linspace(np.log(1e-2), np.log(0.05), 60))  # wider than the grid's step, narrower than the grid
    expected = np.log(np.mean([evidence(std) for std in orders]) / evidence(gaussian))
    found = common_magnitude(value[None], covariance[None], gaussian=gaussian, least=1e-2, most=0.05)
    assert found[0] == pytest.approx(expected, abs=0.01)
    same = common_magnitude(value[None], covariance[None], gaussian=gaussian, least=gaussian, most=gaussian)
    assert same[0] == pytest.approx(0, abs=1e-9)


def test_parameters_without_effect_do_not_change_the_common_magnitude() -> None:
    value, covariance = np.array([[0.02, 0.0]]), np.diag([1e-5, 0.01])[None]  # the second has its prior
    alone = common_magnitude(value[:, :1], covariance[:, :1, :1], gaussian=0.1, least=1e-3, most=1.0)
    both = common_magnitude(value, covariance, gaussian=0.1, least=1e-3, most=1.0)
    np.testing.assert_allclose(both, alone, atol=1e-9)


def test_log_uniform_prior_has_no_unit() -> None:
    """Magnitudes in other units, each with its own Gaussian prior, have the same evidence."""
    value, std, unit = np.array([0.3, -0.02]), np.array([0.1, 0.05]), np.array([3.0, 1e-4])
    found = log_uniform(value, std, gaussian=GAUSSIAN, least=MIN, most=MAX).log_ratio
    scaled = [
        log_uniform(value[[k]] / u, std[[k]] / u, gaussian=np.array([GAUSSIAN / u]), least=MIN / u, most=MAX / u)
        for k, u in enumerate(unit)
    ]
    np.testing.assert_allclose([one.log_ratio[0] for one in scaled], found, rtol=1e-9)
