"""How well a hypothesis fits."""

import numpy as np
import pytest
from diagnosis_helpers import Change, learnt
from scipy.stats import chi2

from updater.causes.nothing import Nothing
from updater.comparing import compare
from updater.fit import fit


@pytest.mark.parametrize("seed", [181, 182, 183])
def test_many_shapes_do_not_drown_frequencies_that_do_not_fit(seed: int) -> None:
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
