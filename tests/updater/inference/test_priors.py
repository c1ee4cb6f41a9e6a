"""A prior uniform in the logarithm, in the place of a Gaussian one."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from updater.inference import log_uniform

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
