import numpy as np
import pytest

from oma import IdentificationError
from oma.correlation import correlation_sums


def brute(data: np.ndarray, n_lags: int, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
    sums = np.zeros((n_lags, data.shape[1], data.shape[1]))
    counts = np.zeros((n_lags, 1, 1))
    complete = np.isfinite(data).all(axis=1)
    for lag in range(n_lags):
        for t in range(start, min(stop, len(data) - lag)):
            if complete[t] and complete[t + lag]:
                sums[lag] += np.outer(data[t + lag], data[t])
                counts[lag] += 1
    return sums, counts


@pytest.mark.parametrize(("n_samples", "n_lags", "n_blocks"), [(200, 7, 4), (203, 5, 6), (90, 20, 5), (400, 3, 2)])
@pytest.mark.parametrize("gaps", [False, True])
def test_sums_equal_the_definition(n_samples: int, n_lags: int, n_blocks: int, gaps: bool) -> None:
    data = np.random.default_rng(n_samples).standard_normal((n_samples, 3))
    if gaps:
        data[20:31, 1] = np.nan
        data[50:60, 1:] = np.nan
    found = correlation_sums(data, n_lags, n_blocks)
    block = -(-n_samples // n_blocks)
    for b in range(n_blocks):
        sums, counts = brute(data, n_lags, b * block, min((b + 1) * block, n_samples))
        assert np.allclose(found.sums[b], sums, atol=1e-11 * n_samples)
        assert np.array_equal(found.counts[b], counts)


def test_influences_of_the_blocks_add_up_to_nothing() -> None:
    data = np.random.default_rng(1).standard_normal((500, 2))
    data[100:130, 0] = np.nan
    assert np.max(np.abs(correlation_sums(data, 9, 5).influence.sum(axis=0))) < 1e-14


def test_influence_is_the_first_order_change_of_leaving_a_block_out() -> None:
    data = np.random.default_rng(2).standard_normal((4000, 2))
    found = correlation_sums(data, 4, 20)
    without = (found.sums[1:].sum(axis=0)) / found.counts[1:].sum(axis=0)
    # exact: change = -influence * n / (n - n_block), so for 20 equal blocks the factor is 20/19 (ends aside: 1e-3)
    assert np.allclose(without - found.mean, -found.influence[0] * 20 / 19, rtol=2e-3, atol=1e-12)


def test_channels_never_there_together_are_refused() -> None:
    data = np.random.default_rng(5).standard_normal((100, 2))
    data[:55, 0] = np.nan
    data[45:, 1] = np.nan
    with pytest.raises(IdentificationError, match="no two complete samples"):
        correlation_sums(data, 4, 4)
