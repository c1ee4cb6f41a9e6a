"""Invalid arguments of the types, and derived values."""

import re

import numpy as np
import pytest

from daq import Block, Channel, IntArray, Recording
from tests.support.daq.blocks import START, make_block

CHANNELS = (Channel(name="x", device="a", axis=0), Channel(name="y", device="a", axis=1))


def recording(shape: tuple[int, ...] = (500, 2), rate: float = 200.0) -> Recording:
    return Recording(channels=CHANNELS, data=np.zeros(shape), rate=rate, start=START)


@pytest.mark.parametrize("counts", [np.zeros((3, 3)), np.zeros(3, np.int32), np.zeros((3, 3), np.int64)])
def test_block_with_counts_other_than_int32_matrix_is_refused(counts: IntArray) -> None:
    with pytest.raises(ValueError, match=r"counts of beam: expected int32 \(n_scans, n_axes\), found "):
        Block(
            device="beam",
            rate=1e3,
            first_index=0,
            counts=counts,
            scale=1.0,
            arrival_index=0,
            arrival_time=0,
            temperature=0.0,
        )


def test_block_scan_count_and_end_index() -> None:
    block = make_block("beam", 1000, n=37)
    assert (block.n_scans, block.end_index) == (37, 1037)


@pytest.mark.parametrize("shape", [(500,), (500, 3)])
def test_recording_with_wrong_number_of_data_columns_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=re.escape(f"data: expected (n_samples, 2), found {shape}")):
        recording(shape)


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan")])
def test_recording_with_nonpositive_or_nan_rate_is_refused(rate: float) -> None:
    with pytest.raises(ValueError, match=f"rate: expected a positive number of Hz, found {rate}"):
        recording(rate=rate)


def test_recording_duration_and_end_time() -> None:
    assert recording().duration == 2.5
    assert recording().end == START + 2_500_000_000
