"""Packed counts: exact, near the smallest possible size, and no damaged byte makes them fail in an undocumented way."""

import math
from collections.abc import Callable

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis.extra import numpy as hnp

from daq import IntArray
from daq.log.format.rice import Packed, pack, unpack

INT32 = np.iinfo(np.int32)


def size(packed: Packed) -> int:
    """Return bits."""
    return 8 * len(packed.bits)


@given(
    hnp.arrays(np.int32, st.tuples(st.integers(1, 60), st.integers(1, 3)), elements=st.integers(INT32.min, INT32.max)),
    st.integers(0, 31),
)
@example(np.array([[INT32.min], [INT32.max], [INT32.min], [INT32.max]], np.int32), 0)
def test_packed_counts_round_trip_for_any_magnitude(counts: IntArray, shift: int) -> None:
    small = counts >> shift
    np.testing.assert_array_equal(unpack(pack(small), len(small)), small)


@pytest.mark.parametrize("deviation", [5.0, 72.0, 1700.0, 170_000.0])
def test_packed_size_of_white_noise_is_near_its_entropy(deviation: float) -> None:
    """On normal noise a Rice code takes 0.04 to 0.16 bits more than entropy, by the place between powers of 2."""
    counts = np.rint(np.random.default_rng(1).normal(1e6, deviation, (200, 60))).astype(np.int32)
    entropy = np.log2(deviation * np.sqrt(2 * np.pi * math.e))
    assert size(pack(counts)) / counts.size < entropy + 0.16 + 0.03  # 12 000 samples: 0.01 rms


def test_packed_size_of_smooth_signal_is_set_by_its_noise() -> None:
    t = np.arange(200) / 1000
    noise = np.random.default_rng(2).normal(0, 8, (200, 30))
    smooth = 2e5 * np.sin(2 * np.pi * 4 * t)[:, None] + noise
    entropy = np.log2(
        8 * np.sqrt(20) * np.sqrt(2 * np.pi * math.e)
    )  # third differences of white noise: 20 times its power
    assert size(pack(np.rint(smooth).astype(np.int32))) / smooth.size < entropy + 0.12 + 0.05


def test_single_shock_needs_at_most_33_bits_per_count() -> None:
    counts = np.zeros((200, 1), np.int32)
    counts[77] = INT32.max
    assert size(pack(counts)) <= 33 * 200


starts_ = st.lists(st.integers(INT32.min, INT32.max), max_size=6).map(tuple)
axes_ = st.lists(st.integers(0, 5), max_size=3).map(tuple)
packed_ = st.builds(Packed, axes_, starts_, st.lists(st.integers(0, 40), max_size=3).map(tuple), st.binary(max_size=60))


def stated(unpacked: Callable[[], IntArray], shape: tuple[int, int]) -> str:
    """Return the error of unpacking, or the shape."""
    try:
        found = unpacked()
    except ValueError as error:
        return str(error)
    return "" if found.shape == shape else f"shape {found.shape}"


@given(packed_, st.integers(0, 80))
def test_invalid_packing_is_refused_with_documented_error(packed: Packed, n: int) -> None:
    reported = stated(lambda: unpack(packed, n), (n, len(packed.order)))
    assert not reported or reported.startswith("packed counts: expected")
