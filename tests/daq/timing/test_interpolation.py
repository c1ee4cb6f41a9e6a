"""Samples computed in blocks are those computed one by one; missing scans affect the same samples."""

import numpy as np
import pytest

from daq.timing import interpolation
from daq.timing.interpolation import half_taps, interpolate


@pytest.mark.parametrize(("ratio", "drift"), [(1.0, 10e-6), (1.0, -150e-6), (0.5, 30e-6), (1000 / 1200, 20e-6)])
def test_blocks_agree_with_single_samples(ratio: float, drift: float) -> None:
    n, random = 20_000, np.random.default_rng(3)
    first, step = half_taps(ratio) + 8.3, (1 + drift) / ratio
    position = first + step * np.arange(n, dtype=np.float64)
    scans = random.standard_normal((int(position[-1]) + half_taps(ratio) + 3, 2))
    scans[9000:9004, 1] = np.nan
    columns = np.ascontiguousarray(scans.T)
    found, single = interpolate(scans, first, step, n, ratio), interpolation._one_by_one(columns, position, ratio).T
    np.testing.assert_array_equal(np.isnan(found), np.isnan(single))
    assert np.isnan(found[:, 1]).any()
    assert not np.isnan(found[:, 0]).any()
    # table linear between its phases: error of at most (pi / phases)^2 / 8 of white noise of unit power, 5 deviations
    np.testing.assert_allclose(found, single, rtol=0, atol=5 * (np.pi / interpolation._PHASES) ** 2 / 8)


def test_blocks_agree_with_exact_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a table of 64 times as many phases the two ways differ by the error of the polynomials alone."""
    random = np.random.default_rng(4)
    first, step, scans = 30.6, 1 - 60e-6, random.standard_normal((4100, 1))
    found = interpolate(scans, first, step, 4000)
    position = first + step * np.arange(4000, dtype=np.float64)
    monkeypatch.setattr(interpolation, "_PHASES", 64 * interpolation._PHASES)
    interpolation._table.cache_clear()
    single = interpolation._one_by_one(np.ascontiguousarray(scans.T), position, 1.0).T
    interpolation._table.cache_clear()
    limit = (np.pi * interpolation._REACH) ** interpolation._TERMS / 1920  # 1 / (2^4 5!), Chebyshev's nodes
    np.testing.assert_allclose(found, single, rtol=0, atol=5 * limit)
