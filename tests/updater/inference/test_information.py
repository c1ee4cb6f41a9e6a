"""Information expected of a measurement, against integrals and limits."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from updater.inference import entropy, expected_information


def of_two(share: float, distance: float) -> float:
    """Return the information about two hypotheses by an integral over the result [bit]."""

    def integrand(result: float) -> float:
        at = np.array([share * norm.pdf(result), (1 - share) * norm.pdf(result, distance)])
        return float(at.sum() * entropy(at / at.sum()))

    return float(entropy(np.array([share, 1 - share]))) - quad(integrand, -8, distance + 8, epsabs=1e-9)[0]


@pytest.mark.parametrize("distance", [0.3, 1.0, 2.0, 3.5, 6.0])
@pytest.mark.parametrize("share", [0.5, 0.9])
def test_information_about_two_hypotheses_is_the_integral(share: float, distance: float) -> None:
    found = expected_information(np.array([share, 1 - share]), distance * (1 - np.eye(2)))
    error = 0.5 / np.sqrt(4000)  # deviation of an entropy is at most half a bit, of 4000 results for each hypothesis
    assert found == pytest.approx(of_two(share, distance), abs=4 * error)


def test_far_hypotheses_are_resolved_and_equal_ones_are_not() -> None:
    probability = np.array([0.5, 0.3, 0.2])
    assert expected_information(probability, np.zeros((3, 3))) == pytest.approx(0, abs=1e-12)
    assert expected_information(probability, 20 * (1 - np.eye(3))) == pytest.approx(entropy(probability), abs=1e-9)


def test_one_of_three_is_separated_from_two_that_are_alike() -> None:
    """One of the two remains open: h(1/3) is resolved."""
    distance = 20.0 * np.array([[0, 1, 1], [1, 0, 0], [1, 0, 0]])
    found = expected_information(np.full(3, 1 / 3), distance)
    assert found == pytest.approx(entropy(np.array([1 / 3, 2 / 3])), abs=1e-9)


def test_hypothesis_of_no_probability_has_no_effect() -> None:
    distance = 2.0 * (1 - np.eye(3))
    found = expected_information(np.array([0.5, 0.5, 0.0]), distance)
    assert found == pytest.approx(of_two(0.5, 2.0), abs=0.04)
