"""Numbers of scans from their time stamps."""

import numpy as np
import pytest

from daq.timing.resampling import StampCount

N = 20_000


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("error", [-0.01, 0.0, 0.01])
def test_jitter_and_an_error_of_the_rate_do_not_add_up(seed: int, error: float) -> None:
    """Stamps have 0.2 periods of jitter (rms 0.06) beside the lag of the phase, 0.01 / 0.05 = 0.2 periods."""
    jitter = np.random.default_rng(seed).uniform(-0.1, 0.1, N)
    time = 5.0 + (np.arange(N) + jitter) / (100.0 * (1 + error))
    number = StampCount(100.0).numbers(time)
    np.testing.assert_array_equal(number - number[0], np.arange(N))


def test_missing_scans_are_counted_and_pieces_do_not_matter() -> None:
    k = np.setdiff1d(np.arange(3000), np.r_[500:520, 1000:1001, 2000:2300])
    time = np.round(k / 128.0, 3)  # in ms: 0.06 periods
    count = StampCount(128.0)
    found = np.concatenate([count.numbers(part) for part in np.array_split(time, 37)])
    np.testing.assert_array_equal(found, k)


def test_clock_that_wraps_continues() -> None:
    wrap = 2**32 * 1e-6
    time = (np.arange(900) / 100.0 + wrap - 4.0) % wrap
    np.testing.assert_array_equal(StampCount(100.0, wrap=wrap).numbers(time), np.arange(900))


def test_false_stamp_gives_one_false_number() -> None:
    time = np.arange(200) / 100.0
    time[[50, 120]] += [5.0, -1.1]
    expected = np.arange(200)
    expected[[50, 120]] += [500, -110]
    np.testing.assert_array_equal(StampCount(100.0).numbers(time), expected)


def test_clock_that_restarts_gives_numbers_that_go_back() -> None:
    time = np.r_[np.arange(500), np.arange(100)] / 100.0
    number = StampCount(100.0).numbers(time)
    assert np.flatnonzero(np.diff(number) != 1).tolist() == [499]
    assert number[500] == 0
