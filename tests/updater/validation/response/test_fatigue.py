"""Rainflow counts and S-N curves, against the example of the standard and closed forms."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.special import gamma

from updater.validation import StressCycles, count_cycles, damage_rate

CATEGORY = 71e6


def cycles(size: float, n: float) -> StressCycles:
    return StressCycles(ranges=np.array([size]), counts=np.array([n]), seconds=1.0)


def test_example_of_the_standard() -> None:
    """ASTM E1049-85, figure 6; straight lines between its points change no count."""
    points = np.array([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0])
    signal = np.interp(np.linspace(0, 8, 81), np.arange(9), points)
    found = count_cycles(signal, 10.0)
    total = {size: float(found.counts[np.isclose(found.ranges, size)].sum()) for size in (3, 4, 6, 8, 9)}
    assert total == {3: 0.5, 4: 1.5, 6: 0.5, 8: 1.0, 9: 0.5}
    assert found.largest == 9
    assert found.rate == pytest.approx(4 / 8.1)


def test_stretches_between_gaps_are_counted_by_themselves() -> None:
    wave = np.sin(2 * np.pi * np.arange(1000) / 50)
    gap = np.concatenate([wave, np.full(30, np.nan), 3 + wave])
    found, single = count_cycles(gap, 50.0), count_cycles(wave, 50.0)
    assert found.largest == pytest.approx(2.0, rel=1e-2)
    assert found.counts.sum() == 2 * single.counts.sum() == (single + single).counts.sum()
    assert found.seconds == 40.0


@pytest.mark.parametrize(
    ("share", "n"), [(1.0, 2e6), (2.0, 2.5e5), (0.737, 5e6), (0.6, 5e6 * (0.737 / 0.6) ** 5), (0.405, 1e8)]
)
def test_cycles_to_failure_of_the_code(share: float, n: float) -> None:
    """EN 1993-1-9 s. 7.1: slopes 3 and 5, knee at 0.737 and cut-off at 0.405 of the category."""
    assert damage_rate(cycles(share * CATEGORY, n), CATEGORY) == pytest.approx(1.0, rel=6e-3)
    assert damage_rate(cycles(share * CATEGORY / 2, n), CATEGORY, 2.0) == pytest.approx(1.0, rel=6e-3)


def test_ranges_below_the_cutoff_do_no_damage() -> None:
    assert damage_rate(cycles(0.4 * CATEGORY, 1e12), CATEGORY) == 0


def test_narrow_band_vibration_has_ranges_by_rayleigh() -> None:
    """E[range^m] = (2 sqrt(2) sigma)^m Gamma(1 + m / 2); five standard deviations of the mean of 12,000 cycles."""
    random, rate, centre = np.random.default_rng(41), 400.0, 20.0
    print("seed 41")
    noise = random.standard_normal(int(600 * rate))
    stress = sosfiltfilt(butter(2, (0.97 * centre, 1.03 * centre), "bandpass", fs=rate, output="sos"), noise)
    stress *= 10e6 / stress.std()
    found = count_cycles(stress, rate)
    assert found.rate == pytest.approx(centre, rel=0.02)
    expected = 2 * np.sqrt(2) * 10e6 * gamma(1 + 5 / 2) ** (1 / 5)
    # some 25 periods have the same size, and range^5 has a deviation of 3.1 times its mean
    assert found.equivalent_range() == pytest.approx(expected, rel=5 * 3.1 / 5 / np.sqrt(12_000 / 25))


def test_cycles_of_no_signal_are_none() -> None:
    found = count_cycles(np.full(100, np.nan), 100.0)
    assert (found.largest, found.equivalent_range(), len(found.ranges)) == (0.0, 0.0, 0)
