"""Device ticks to UTC: the lower envelope against known clocks."""

import numpy as np
import pytest

from daq.timing import ClockFit
from daq.timing.clock_fit import unwrap

START = 1_767_225_600_000_000_000  # ns UTC
RATE = 1000.0
MIN_DELAY = 1_500_000  # ns


def fitted(seconds: float, ppm: float, jitter_ns: float, seed: int) -> tuple[ClockFit, np.random.Generator]:
    """Return a fit to pairs every 0.25 s of a device so fast, arriving late by an exponential jitter."""
    random = np.random.default_rng(seed)
    fit = ClockFit(RATE)
    for index in range(249, round(seconds * RATE), 250):
        fit.add(index, arrival(index, ppm) + round(random.exponential(jitter_ns)))
    return fit, random


def arrival(index: int, ppm: float) -> int:
    return START + MIN_DELAY + round(index / RATE / (1 + ppm * 1e-6) * 1e9)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("ppm", [-95.0, 0.0, 35.0])
def test_clock_drift_and_time_are_estimated(ppm: float, seed: int) -> None:
    jitter = 2e6
    fit, _ = fitted(150.0, ppm, jitter, seed)
    # The earliest of the arrivals of a second is late by jitter/4 on the mean, the two that carry the line by less;
    # they lie at least half the span apart on the mean, 60 s: under 10 ppm of 0.5 ms in 50 s.
    _, rate = fit.index_at(START)
    assert rate / RATE - 1 == pytest.approx(ppm * 1e-6, abs=10e-6)
    for index in (40_000, 100_000, 149_999):
        error = fit.time_at(index) - arrival(index, ppm)
        assert -0.4e6 < error < 0.6e6


def test_scan_time_is_never_after_its_arrival() -> None:
    random = np.random.default_rng(0)
    fit, pairs = ClockFit(RATE), []
    for index in range(249, 120_000, 250):
        pairs.append((index, arrival(index, 20.0) + round(random.exponential(1e6))))
        fit.add(*pairs[-1])
    late = np.array([time - fit.time_at(index) for index, time in pairs])
    assert late.min() >= -2  # rounding
    assert np.count_nonzero(late < 1000) >= 2  # and the line touches some


def test_drift_is_zero_before_30_seconds_and_bounded_later() -> None:
    assert fitted(20.0, 5_000.0, 0.0, 0)[0].index_at(START)[1] == pytest.approx(RATE, rel=1e-12)
    assert fitted(100.0, 5_000.0, 0.0, 0)[0].index_at(START)[1] == pytest.approx(RATE * (1 + 200e-6), rel=1e-7)


def test_period_of_late_arrivals_does_not_shift_the_clock() -> None:
    fit = ClockFit(RATE)
    for index in range(249, 120_000, 250):
        late = 40_000_000 if 50_000 < index < 90_000 else 100_000
        fit.add(index, arrival(index, 0.0) + late)
    assert fit.time_at(70_000) - arrival(70_000, 0.0) == pytest.approx(100_000, abs=10)


def test_index_and_time_are_inverse() -> None:
    fit, _ = fitted(60.0, 30.0, 1e6, 5)
    for index in (0, 12_345, 59_999):
        assert fit.index_at(fit.time_at(index))[0] == pytest.approx(index, abs=2e-6)


def test_clock_fit_is_unaffected_by_queries() -> None:
    asked, silent = ClockFit(RATE), ClockFit(RATE)
    random = np.random.default_rng(3)
    for index in range(249, 100_000, 250):
        time = arrival(index, -20.0) + round(random.exponential(1e6))
        asked.add(index, time)
        asked.index_at(time)
        silent.add(index, time)
    assert asked.line() == silent.line()


def test_clock_without_arrivals_is_refused() -> None:
    with pytest.raises(ValueError, match="expected at least one"):
        ClockFit(RATE).line()


@pytest.mark.parametrize("error", [-32_000, 0, 32_000])
@pytest.mark.parametrize("index", [0, 40_000, 65_535, 65_536, 10**9])
def test_counter_is_unwrapped_to_nearest_index(index: int, error: int) -> None:
    counter = np.arange(index, index + 5) % 65536
    np.testing.assert_array_equal(unwrap(counter, index + 2 + error), np.arange(index, index + 5))


@pytest.mark.parametrize("ppm", [-50.0, 50.0])
def test_time_jitter_behind_usb_adapter_is_below_0_1_ms(ppm: float) -> None:
    """Packets of 16 ms: a packet's last scan is up to a period old, and least as often as the two clocks beat."""
    latency, speed = 0.016, 1 + ppm * 1e-6
    random, fit, off = np.random.default_rng(4), ClockFit(RATE), []
    for packet in np.arange(13, 25_000, 13) * latency:  # read 0.2 s apart
        index = int(packet * speed * RATE)
        fit.add(index, START + round((packet + random.exponential(1e-4)) * 1e9))
        if packet > 150:
            earlier = index - 2000
            off.append((fit.time_at(earlier) - START) * 1e-9 - earlier / RATE / speed)
    assert np.std(off) < 1e-4
