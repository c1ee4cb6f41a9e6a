import numpy as np
import pytest

from daq import Channel, FloatArray, Recording
from oma import channel_faults
from oma.preparation import detrended, detrended_pieces


def recording(data: FloatArray) -> Recording:
    channels = tuple(Channel(name=f"c{i}", device="d", axis=0) for i in range(data.shape[1]))
    return Recording(channels=channels, data=data, rate=100.0, start=0)


def test_channel_faults_are_classified() -> None:
    data = np.random.default_rng(0).standard_normal((1000, 4))
    data[:, 0] = np.nan
    data[:, 1] = 9.81
    data[100:200, 2] = np.nan
    found = channel_faults(recording(data))
    assert {name: str(fault) for name, fault in found.items()} == {
        "c0": "0% of the samples are there",
        "c1": "constant",
        "c2": "gaps: 10.0% of the samples were missing, 0.0% are filled",
    }
    assert [fault.kind for fault in found.values()] == ["no_signal", "no_signal", "gaps"]


def test_channel_with_most_gaps_is_excluded_first() -> None:
    data = np.random.default_rng(0).standard_normal((1000, 3))
    data[:400, 0] = np.nan
    data[700:, 1] = np.nan
    faults = channel_faults(recording(data))
    assert str(faults["c0"]) == "60% of the samples are there"
    assert str(faults["c1"]).startswith("gaps: 30.0%")
    assert [fault.kind for fault in faults.values()] == ["gaps", "gaps"]


def test_mean_and_slope_are_removed_despite_gaps() -> None:
    data = (3.0 + 0.01 * np.arange(500.0))[:, None] * np.ones(2)
    data[100:300, 1] = np.nan
    assert np.nanmax(np.abs(detrended(data))) < 1e-12


@pytest.mark.parametrize("share_missing", [0.0, 0.1])
def test_pieces_are_detrended_by_the_line_of_the_whole(share_missing: float) -> None:
    random = np.random.default_rng(1)
    data = np.cumsum(random.standard_normal((1000, 3)), axis=0)
    data[random.random(data.shape) < share_missing] = np.nan
    pieces = np.concatenate(list(detrended_pieces(data, 300)))
    np.testing.assert_array_equal(pieces, detrended(data))
