"""Goodness of fit of a hypothesis."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from tests.support.thorough import few_of
from tests.support.updater.diagnosis_data import Change, learnt
from updater import Body
from updater.causes import Nothing, SensorGain
from updater.diagnosis.model_extension import fixed
from updater.diagnosis.weighing import EvidenceComparison
from updater.inference import compare, fit, freedom_of_frequencies, size_deviations


@pytest.mark.parametrize("seed", few_of([182, 181, 183]))
def test_many_fitting_shapes_do_not_mask_misfitting_frequencies(seed: int) -> None:
    """Each frequency off by two and a half deviations is nothing to a chi-square of two hundred numbers."""
    reference, _, event = learnt(seed)
    data = compare(reference, event(Change()))
    as_it_is = fit(data, Nothing(comparison=data))
    whole = chi2.sf(as_it_is.chi_square[0], as_it_is.freedom)
    assert as_it_is.p_value == pytest.approx(whole)
    n = len(data.log_ratio)
    off = data.plain.matrix @ data.log_ratio
    data.log_ratio[:] = np.linalg.solve(data.plain.matrix, np.where(off < 0, -2.5, 2.5))
    found = fit(data, Nothing(comparison=data))
    assert chi2.sf(found.chi_square[0], found.freedom) > 1e-3
    assert found.p_value == pytest.approx(100 * chi2.sf(2.5**2 * n, n))
    assert found.p_value < 1e-3


def test_frequency_degrees_of_freedom_match_the_residuals_of_refits() -> None:
    """Shapes determine most of a body's place and mass, so that less than its four parameters is lost."""
    reference, _, event = learnt(184)
    data = compare(reference, event(Change(bodies=(Body(at=(0.2, 0.0, 1.48), mass=0.3),))))
    (chosen,) = EvidenceComparison(reference, data).singles(("added_mass",))[0].chosen
    alone = fixed(data, (chosen,))
    freedom = freedom_of_frequencies(data, fit(data, alone))
    ratio, left = data.log_ratio.copy(), []
    whitener = data.drifting if alone.drifting else data.plain
    for k, one in enumerate(np.linalg.inv(whitener.matrix).T):
        off = []
        for sign in (-1, 1):
            data.log_ratio[:] = ratio + sign * one
            off.append(fit(data, alone).frequency_residual[0, k])
        left.append((off[1] - off[0]) / 2)
    print(freedom, np.round(left, 3))
    assert len(ratio) - 4 < freedom < len(ratio)
    assert freedom == pytest.approx(sum(left), abs=0.1)


def test_parameters_without_effect_take_no_degrees_of_freedom() -> None:
    """Shapes determine a gain to 0.5 %: with a prior of 0.3 it is determined, with one of 1e-6 it is not."""
    reference, _, event = learnt(185)
    data = compare(reference, event(Change()))
    gains = EvidenceComparison(reference, data).causes["sensor_gain"]
    assert isinstance(gains, SensorGain)
    for prior, determined in ((0.3, 1.0), (1e-6, 0.0)):
        found = fit(data, replace(gains, prior_std=np.array([prior])))
        assert found.freedom == pytest.approx(data.freedom - determined, abs=0.02)


def test_size_deviation_is_that_of_a_fit_near_no_change() -> None:
    """To first order; with a prior of 0.3, 1 / (1 / s^2 + 1 / 0.3^2) is the variance of a fitted gain of about 1."""
    reference, _, event = learnt(186)
    data = compare(reference, event(Change()))
    gains = EvidenceComparison(reference, data).causes["sensor_gain"]
    fitted = np.sqrt(fit(data, gains).covariance[:, 0, 0])
    least = size_deviations(data, gains, np.zeros(1), 1)
    np.testing.assert_allclose((least**-2 + 0.3**-2) ** -0.5, fitted, rtol=0.05)
