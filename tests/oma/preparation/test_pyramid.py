"""Falling rates, and the filters that make them."""

from itertools import pairwise

import numpy as np
import pytest

from oma.preparation import Decimator, HighPass, levels


@pytest.mark.parametrize(("frequency", "kept"), [(5.0, True), (8.0, True), (12.0, False), (20.0, False), (45.0, False)])
def test_decimation_by_five_keeps_band_without_aliasing(frequency: float, kept: bool) -> None:
    # 100 Hz to 20 Hz: the band kept ends at 0.40 x 20 = 8 Hz, and only what lies above 0.60 x 20 folds into it
    tone = np.sin(2 * np.pi * frequency * np.arange(4000) / 100.0)[:, None]
    rms = np.sqrt(2 * np.mean(Decimator(5).add(tone) ** 2))
    if kept:
        assert rms == pytest.approx(1.0, abs=0.005)
    else:
        assert rms < 3e-4  # 75 dB down, and the ends of the tone


def test_long_gaps_are_kept_and_short_gaps_are_bridged() -> None:
    data = np.sin(2 * np.pi * 2.0 * np.arange(4000) / 100.0)[:, None] * np.ones(3)
    whole = Decimator(5).add(data)
    data[1000:1500, 1] = np.nan
    data[2000:2002, 2] = np.nan
    found = Decimator(5).add(data)
    assert 100 - 24 <= np.isnan(found[:, 1]).sum() <= 100 + 24
    assert not np.isnan(found[:, [0, 2]]).any()
    # a quarter of the filter's absolute weight (1.9 in all) may rest on straight lines, at most 1 off
    assert np.nanmax(np.abs(found - whole)) < 0.25 * 1.9


def test_pyramid_bands_cover_the_requested_band() -> None:
    bands = [level.band for level in levels(1000.0, (1.7, 400.0), 5) if level]
    assert bands[0][1] == 400.0
    assert bands[-1][0] == 1.7
    assert all(higher[0] < lower[1] for higher, lower in pairwise(bands))


def test_rates_above_the_band_are_not_analysed() -> None:
    assert [level and level.rate for level in levels(1000.0, (1.0, 10.0), 5)] == [None, None, 40.0, 8.0]


@pytest.mark.parametrize("seed", range(3))
def test_filter_output_is_independent_of_chunking(seed: int) -> None:
    random = np.random.default_rng(seed)
    data = random.normal([0.0, 100.0], 1.0, (3000, 2))
    data[700:703, 0] = np.nan
    cuts = np.sort(random.choice(np.arange(800, 3000), 7, replace=False))
    decimator, whole = Decimator(5), Decimator(5).add(data)
    parts = np.concatenate([decimator.add(part) for part in np.split(data, cuts)])
    assert np.allclose(parts, whole, atol=1e-10, equal_nan=True)
    drift = HighPass(0.01)
    first = drift.add(data[:800])
    assert np.array_equal(np.isnan(first), np.isnan(data[:800]))
    rest = np.concatenate([drift.add(part) for part in np.split(data[800:], cuts - 800)])
    again = HighPass(0.01)
    again.add(data[:800])
    assert np.allclose(rest, again.add(data[800:]), atol=1e-9)


def test_high_pass_removes_mean_and_drift_and_keeps_tone() -> None:
    time = np.arange(60_000.0)
    tone = np.sin(2 * np.pi * 0.01 * time)
    found = HighPass(0.001).add((5.0 + 1e-4 * time + tone)[:, None])[:, 0]
    # a first-order filter leaves of a slope: slope / (2 pi corner); of a tone at ten corners 1 - 1 / 200
    assert np.mean(found[20_000:]) == pytest.approx(1e-4 / (2 * np.pi * 0.001), rel=0.02)
    assert np.std(found[20_000:]) * np.sqrt(2) == pytest.approx(1.0, abs=0.006)
