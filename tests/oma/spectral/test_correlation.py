from itertools import pairwise

import numpy as np
import pytest

from oma import IdentificationError
from oma.spectral import CorrelationAccumulator
from tests.support.oma.correlations import correlation_sums


def brute(data: np.ndarray, n_lags: int, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
    sums = np.zeros((n_lags, data.shape[1], data.shape[1]))
    counts = np.zeros(n_lags)
    complete = np.isfinite(data).all(axis=1)
    for lag in range(n_lags):
        for t in range(max(start, lag), stop):
            if complete[t] and complete[t - lag]:
                sums[lag] += np.outer(data[t], data[t - lag])
                counts[lag] += 1
    return sums, counts


@pytest.mark.parametrize(("n_samples", "n_lags", "ends"), [
    (200, 7, (50, 100, 150)), (203, 5, (1, 2, 90)), (90, 20, (18, 19, 60)), (400, 3, (200,)), (30, 40, (0, 10, 10, 28)),
])  # fmt: skip
@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize("references", [None, (2,), (0, 2)])
def test_correlation_sums_equal_definition_for_any_chunking(
    n_samples: int, n_lags: int, ends: tuple[int, ...], gaps: bool, references: tuple[int, ...] | None
) -> None:
    data = np.random.default_rng(n_samples).standard_normal((n_samples, 3))
    if gaps:
        data[20:23, 1] = np.nan
        data[24:26, 1:] = np.nan
    accumulator = CorrelationAccumulator(3, n_lags, references)
    for block in np.split(data, ends):
        accumulator.add(block)
    for b, (start, stop) in enumerate(pairwise((0, *ends, n_samples))):
        sums, counts = brute(data, n_lags, start, stop)
        chosen = slice(None) if references is None else list(references)
        assert np.allclose(accumulator.blocks[b][0], sums[..., chosen], atol=1e-11 * n_samples)
        assert np.array_equal(accumulator.blocks[b][1], counts)


def test_rolling_correlation_equals_that_of_remaining_blocks() -> None:
    data = np.random.default_rng(3).standard_normal((600, 2))
    rolling = CorrelationAccumulator(2, 8)
    for block in np.split(data, 6):
        rolling.add(block)
    rolling.drop(2)
    sums, counts = brute(data, 8, 200, 600)
    assert np.allclose(rolling.sums.mean, sums / counts[:, None, None], atol=1e-11)


def test_block_influences_sum_to_zero() -> None:
    data = np.random.default_rng(1).standard_normal((500, 2))
    data[100:130, 0] = np.nan
    assert np.max(np.abs(np.sum(correlation_sums(data, 9, 5).influences(), axis=0))) < 1e-14


def test_influence_is_first_order_change_on_omitting_a_block() -> None:
    data = np.random.default_rng(2).standard_normal((4000, 2))
    found = correlation_sums(data, 4, 20)
    without = np.sum(found.sums[1:], axis=0) / found.counts[1:].sum(axis=0)[:, None, None]
    # exact: change = -influence * n / (n - n_block), so for 20 equal blocks the factor is 20/19 (ends aside: 1e-3)
    assert np.allclose(without - found.mean, -found.influences()[0] * 20 / 19, rtol=2e-3, atol=1e-12)


def test_channels_without_common_samples_are_refused() -> None:
    data = np.random.default_rng(5).standard_normal((100, 2))
    data[:55, 0] = np.nan
    data[45:, 1] = np.nan
    with pytest.raises(IdentificationError, match="no two complete samples"):
        correlation_sums(data, 4, 4)
