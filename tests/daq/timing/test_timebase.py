"""Counters unwrapped, and clocks found from arrivals that can only be late."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from daq.timing import ClockFit
from daq.timing.clock_fit import unwrap
from tests.support.daq.blocks import START

RATE = 1000.0
JITTER = 4e-3  # s, mean of what arrivals are late by


def arrivals(seed: int, ppm: float, seconds: float, least: float = 0.0) -> list[tuple[int, int]]:
    """Return (index, arrival [ns UTC]) of blocks of 0.25 s: exponentially late, scan 0 taken at START."""
    random = np.random.default_rng(seed)
    index = np.arange(249, int(seconds * RATE), 250)
    taken = index / (RATE * (1 + ppm * 1e-6))
    late = least + random.exponential(JITTER, len(index))
    return list(zip(index.tolist(), (START + np.rint((taken + late) * 1e9).astype(int)).tolist(), strict=True))


def fitted(pairs: list[tuple[int, int]]) -> ClockFit:
    clock = ClockFit(RATE)
    for index, time in pairs:
        clock.add(index, time)
    return clock


@given(st.integers(0, 2**40), st.integers(-32_768, 32_767), st.lists(st.integers(1, 300), min_size=1, max_size=60))
def test_counters_are_unwrapped_to_true_indices(first: int, error: int, steps: list[int]) -> None:
    index = first + np.cumsum(steps)
    index = index[np.abs(index - index[0]) < 32_768 - abs(error)]
    if not len(index):
        return
    found = unwrap(index % 65_536, int(index[0]) + error)
    np.testing.assert_array_equal(found, index)


@pytest.mark.parametrize("missing", [0, 1, 65_535, 65_536, 65_537, 1_000_000, 10_000_019])
def test_gaps_of_any_number_of_wraps_are_exact(missing: int) -> None:
    index = 123_456 + missing + np.arange(10)
    assert unwrap(index % 65_536, 123_456 + missing + 20_000).tolist() == index.tolist()


def test_wrong_counter_value_does_not_affect_other_indices() -> None:
    counter = np.arange(70_000, 70_010) % 65_536
    counter[4] = 9
    found = unwrap(counter, 70_009)
    assert np.delete(found, 4).tolist() == [70_000, 70_001, 70_002, 70_003, *range(70_005, 70_010)]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("ppm", [-100.0, -3.0, 0.0, 40.0, 100.0])
def test_drift_and_offset_errors_are_below_arrival_jitter(seed: int, ppm: float) -> None:
    # The least of the 4 arrivals a second is JITTER / 4 late on average; of the 60 s on either side of the middle the
    # line touches one each, JITTER / 240 late on average: 17 us, under 10 times that but once in e^10.
    clock = fitted(arrivals(seed, ppm, 150.0))
    touch = 10 * JITTER / 240
    for index in (30_000, 90_000, 149_000):
        error = clock.time_at(index) - START - index / (RATE * (1 + ppm * 1e-6)) * 1e9
        assert abs(error) < 3 * touch * 1e9  # the line is carried on to at most 2 times its base
    _, rate = clock.index_at(START + 100_000_000_000)
    drift = (rate / RATE - 1) * 1e6
    assert drift == pytest.approx(ppm, abs=2 * touch / 30.0 * 1e6 / 2)  # two touches, some 60 s apart, at least 30 s


def test_constant_delay_shifts_the_clock_by_that_delay() -> None:
    near, far = fitted(arrivals(3, 20.0, 100.0)), fitted(arrivals(3, 20.0, 100.0, least=5e-3))
    for index in (0, 50_000, 99_000):
        assert far.time_at(index) - near.time_at(index) == pytest.approx(5_000_000, abs=3)


def test_bursts_of_late_arrivals_do_not_shift_the_clock() -> None:
    pairs = arrivals(4, 10.0, 100.0)
    late = [(index, time + 700_000_000 * (k % 7 == 3)) for k, (index, time) in enumerate(pairs)]
    assert fitted(late).time_at(99_000) == pytest.approx(fitted(pairs).time_at(99_000), abs=10 * JITTER / 240 * 3e9)


def test_short_record_clock_has_nominal_rate_and_is_not_early() -> None:
    clock = fitted(arrivals(5, 0.0, 10.0))
    assert clock.index_at(START)[1] == RATE
    assert 0 <= clock.time_at(0) - START < 10 * JITTER / 40 * 1e9  # the least of 40 arrivals


def test_index_and_time_are_inverse() -> None:
    clock = fitted(arrivals(6, 80.0, 120.0))
    for index in (0, 1, 77_777, 10**7):
        assert clock.index_at(clock.time_at(index))[0] == pytest.approx(index, abs=RATE * 1e-9 + 1e-6)


@given(st.integers(0, 2**32), st.integers(4, 500), st.lists(st.integers(0, 499), max_size=5))
def test_clock_fit_is_unaffected_by_queries(seed: int, n: int, asked: list[int]) -> None:
    pairs = arrivals(seed, 50.0, 125.0)[:n]
    quiet, curious = fitted(pairs), ClockFit(RATE)
    for k, pair in enumerate(pairs):
        curious.add(*pair)
        if k in asked:
            curious.line()  # to look changes nothing
    assert quiet.line() == curious.line()


def test_clock_without_arrivals_is_refused() -> None:
    with pytest.raises(ValueError, match="expected at least one"):
        ClockFit(RATE).line()


def test_clock_follows_a_change_of_drift() -> None:
    slow = arrivals(8, 0.0, 200.0)
    last_index, last_time = 200_000, START + 200_000_000_000
    fast = [(last_index + i, last_time + t - START) for i, t in arrivals(9, 60.0, 200.0)]
    clock = fitted(slow + fast)
    assert (clock.index_at(last_time)[1] / RATE - 1) * 1e6 == pytest.approx(60.0, abs=5.6)


def test_clock_is_fitted_for_one_scan_per_ten_seconds() -> None:
    clock = ClockFit(0.1)
    for index in range(30):
        clock.add(index, START + index * 10_000_000_000)
    assert clock.time_at(29) == pytest.approx(START + 290_000_000_000, abs=1000)
