from itertools import pairwise

import numpy as np
import pytest

from daq import Channel, FloatArray, Recording
from oma import channel_faults
from oma.conditioning import decimated, detrended, pyramid


def recording(data: FloatArray) -> Recording:
    channels = tuple(Channel(name=f"c{i}", device="d", axis=0) for i in range(data.shape[1]))
    return Recording(channels=channels, data=data, rate=100.0, start=0)


def test_faults_are_named() -> None:
    data = np.random.default_rng(0).standard_normal((1000, 4))
    data[:, 0] = np.nan
    data[:, 1] = 9.81
    data[100:200, 2] = np.nan
    assert channel_faults(recording(data)) == {"c0": "0% of the samples are there", "c1": "constant"}


def test_the_channel_with_most_gaps_is_given_up_first() -> None:
    data = np.random.default_rng(0).standard_normal((1000, 3))
    data[:400, 0] = np.nan
    data[700:, 1] = np.nan
    assert channel_faults(recording(data)) == {"c0": "60% of the samples are there"}


def test_mean_and_slope_go_whatever_is_missing() -> None:
    data = (3.0 + 0.01 * np.arange(500.0))[:, None] * np.ones(2)
    data[100:300, 1] = np.nan
    assert np.nanmax(np.abs(detrended(data))) < 1e-12


@pytest.mark.parametrize(("frequency", "kept"), [(5.0, True), (8.0, True), (12.0, False), (20.0, False), (45.0, False)])
def test_decimation_by_five_keeps_the_band_and_folds_nothing_into_it(frequency: float, kept: bool) -> None:
    # 100 Hz to 20 Hz: the band kept ends at 0.40 x 20 = 8 Hz, and only what lies above 0.60 x 20 folds into it
    tone = np.sin(2 * np.pi * frequency * np.arange(4000) / 100.0)[:, None]
    rms = np.sqrt(2 * np.mean(decimated(tone, 5) ** 2))
    if kept:
        assert rms == pytest.approx(1.0, abs=0.005)
    else:
        assert rms < 3e-4  # 75 dB down, and the ends of the tone


def test_long_gaps_stay_and_short_ones_are_bridged() -> None:
    data = np.sin(2 * np.pi * 2.0 * np.arange(4000) / 100.0)[:, None] * np.ones(3)
    whole = decimated(data, 5)
    data[1000:1500, 1] = np.nan
    data[2000:2002, 2] = np.nan
    found = decimated(data, 5)
    assert 100 - 24 <= np.isnan(found[:, 1]).sum() <= 100 + 24
    assert not np.isnan(found[:, [0, 2]]).any()
    # a quarter of the filter's absolute weight (1.9 in all) may rest on straight lines, at most 1 off
    assert np.nanmax(np.abs(found - whole)) < 0.25 * 1.9


def test_the_bands_of_the_pyramid_cover_the_band_asked_for() -> None:
    bands = [level.band for level in pyramid(np.zeros((60_000, 2)), 1000.0, (1.7, 400.0), 5)]
    assert bands[0][1] == 400.0
    assert bands[-1][0] == 1.7
    assert all(higher[0] < lower[1] for higher, lower in pairwise(bands))
