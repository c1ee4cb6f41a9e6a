"""Law, side and evidence of a place whose actions differ in their effect."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import integrate, stats

from updater.quantities import BREATHES, Breathing, Law
from updater.validation.breathing_crack import _Posterior
from updater.validation.nonlinear_part import ActionTest, ShareFit, _expected_excess


class KnownTest(ActionTest):
    """Test with a known likelihood: what it explains, share and deviation are the same at all thresholds."""

    def __init__(
        self, size: float, explained: float, *, share: float = 0.9, width: float = 0.1, spread: float = 1.0
    ) -> None:
        self.symmetric, self.prior, self.spread, self.explained = True, 0.0, spread, explained
        self.action: Any = SimpleNamespace(relief=1.0)
        self._size, self._unknown = size, 0.1
        self._fitted = ShareFit(explained, width, share, spread * width**2, 0.7, 0.7)

    def fitted(self, *_: float) -> ShareFit:
        """Return the known likelihood."""
        return self._fitted


def posterior(*tests: KnownTest, noise: float = 1.0) -> _Posterior:
    """Return the posterior of tests that are significant, without errors of the model of the mean."""
    return _Posterior.of(tests, (0.0, 0.0), BREATHES / 10, 0.0, noise)


@pytest.mark.parametrize(("size", "law"), [(-1.0, "within"), (1.0, "beyond")])
def test_law_is_that_of_the_action_with_an_effect(size: float, law: Law) -> None:
    """The first action has none: the sign of its noise is opposite."""
    found = posterior(KnownTest(-0.01 * size, 0.1, share=0.05), KnownTest(size, 9.0))
    assert found.breathing.law == law
    assert found.best.test.law(found.bias) == law
    assert np.sign(found.best.size) == size


@pytest.mark.parametrize("noise", [1.0, 0.5])
def test_evidence_of_a_law_is_the_integral_over_the_share(noise: float) -> None:
    """Ratio of the evidence of two laws, with the noise in common; the share is far from its bounds."""
    sharp, flat = KnownTest(1.0, 5.0, share=0.5, width=0.02), KnownTest(1.0, 5.0, share=0.5, width=0.06, spread=2.0)
    found = posterior(sharp, noise=noise).log_evidence - posterior(flat, noise=noise).log_evidence

    def likelihood(test: KnownTest, share: float) -> float:
        fitted = test.fitted()
        return float(np.exp((fitted.explained - 0.5 * ((share - fitted.share) / fitted.width) ** 2) / noise))

    parts = [integrate.quad(lambda s, t=test: likelihood(t, s), 0, 1, points=[0.5])[0] for test in (sharp, flat)]
    assert found == pytest.approx(np.log(parts[0] / parts[1]), abs=1e-2)


def test_place_that_explains_more_determines_the_share_though_its_noise_is_larger() -> None:
    """The noise is alike at all places: their scatter, of sixteen blocks, does not weight them."""
    true, other = KnownTest(1.0, 30.0, share=0.8, width=0.02, spread=1.2), KnownTest(1.0, 26.0, share=0.4, width=0.02)
    share = posterior(true, other, noise=1.2).breathing.share
    weight = 1 / (1 + np.exp(-4 / 1.2))
    expected = weight * 0.8 + (1 - weight) * 0.4
    assert share.value == pytest.approx(expected, abs=0.01)


def test_bound_of_the_share() -> None:
    """The fit of a normal distribution has 95 % below it."""
    share = {"value": 0.1, "std": 0.05, "unit": "-"}
    found = Breathing.model_validate({"share": share, "open_time": None, "p_value": 0.5})
    assert found.upper_share == pytest.approx(0.1 + 1.645 * 0.05)


@pytest.mark.parametrize("std", [0.01, 1.0, 40.0])
def test_tables_of_the_expected_excess_equal_its_integral(std: float) -> None:
    above = np.concatenate([np.linspace(-30, 30, 4001), [0.0]])
    excess, often = _expected_excess(above, std)
    positive = stats.norm.cdf(above / std)
    np.testing.assert_allclose(excess, above * positive + std * stats.norm.pdf(above / std), atol=1e-7 * std)
    assert often == pytest.approx(positive.mean(), abs=1e-7)


def test_excess_without_an_unknown_part() -> None:
    excess, often = _expected_excess(np.array([-1.0, 0.0, 2.0]), 0.0)
    assert excess.tolist() == [0.0, 0.0, 2.0]
    assert often == pytest.approx(1 / 3)
