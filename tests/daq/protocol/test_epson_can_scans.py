"""Scans in two frames: round trips, and halves of two scans that never meet whatever is lost."""

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from daq import IntArray
from daq.protocol.epson_can import MODULUS, ScanDecoder, encode_scans
from daq.protocol.frames import can_frames, concatenate

N = 300


def scans(first: int, n: int = N) -> IntArray:
    """Return scans with their number in every axis, wide enough to wrap differences."""
    k = (first + np.arange(n)) % MODULUS
    return np.asarray((k[:, None] * [1, -7, 30_011]).astype(np.int32))


def decoded(first: int, kept: list[int], sizes: list[int]) -> tuple[IntArray, IntArray, ScanDecoder]:
    """Decode the kept ones of 2 N frames, cut into chunks of the sizes."""
    frames = encode_scans(5, scans(first), first)[np.array(kept, np.intp)]
    edges = np.unique(np.clip(np.r_[0, np.cumsum(sizes), len(frames)], 0, len(frames)).astype(np.intp))
    decoder = ScanDecoder(5)
    found = [decoder.feed(frames[int(a) : int(b)]) for a, b in itertools.pairwise(edges)]
    return np.concatenate([c for c, _ in found]), np.concatenate([k for _, k in found]), decoder


@given(st.integers(0, MODULUS - 1), st.lists(st.integers(1, 50), max_size=20))
def test_all_scans_but_the_first_are_decoded_for_any_chunking(first: int, sizes: list[int]) -> None:
    counts, counter, decoder = decoded(first, list(range(2 * N)), sizes)
    np.testing.assert_array_equal(counter, (first + np.arange(1, N)) % MODULUS)
    np.testing.assert_array_equal(counts, scans(first)[1:])
    assert decoder.bad_frames == 0


@given(st.integers(0, MODULUS - 1), st.sets(st.integers(2, 2 * N - 1)), st.lists(st.integers(1, 50), max_size=20))
def test_halves_of_different_scans_are_never_combined(first: int, lost: set[int], sizes: list[int]) -> None:
    kept = [k for k in range(2 * N) if k not in lost]
    counts, counter, _ = decoded(first, kept, sizes)
    np.testing.assert_array_equal(counts, scans(0, MODULUS)[counter])
    order = (counter - first) % MODULUS
    assert np.all(np.diff(order) > 0)


@given(st.sets(st.integers(3, N - 3)), st.randoms(use_true_random=False))
def test_one_lost_frame_loses_only_its_scan(which: set[int], random: "np.random.Generator") -> None:
    alone = {k for k in which if k - 1 not in which and k + 1 not in which}
    lost = {2 * k + random.choice([0, 1]) for k in alone}  # one half of each
    _, counter, decoder = decoded(0, [k for k in range(2 * N) if k not in lost], [])
    assert counter.tolist() == [k for k in range(1, N) if k not in alone]
    assert decoder.bad_frames == len(alone)  # their other halves


def test_scan_lost_completely_also_loses_the_next_scan() -> None:
    # 10 lost whole against the second half of 10 and the first of 11: what is heard looks alike
    _, whole, _ = decoded(0, [k for k in range(2 * N) if k not in (20, 21)], [])
    _, halves, _ = decoded(0, [k for k in range(2 * N) if k not in (21, 22)], [])
    assert whole.tolist() == halves.tolist() == [k for k in range(1, N) if k not in (10, 11)]


@given(st.sets(st.integers(0, 2 * N - 1)), st.lists(st.integers(1, 50), max_size=20))
def test_repeated_frames_are_counted_once(twice: set[int], sizes: list[int]) -> None:
    kept = [k for k in range(2 * N) for _ in range(1 + (k in twice))]
    counts, counter, decoder = decoded(0, kept, sizes)
    np.testing.assert_array_equal(counter, np.arange(1, N))
    np.testing.assert_array_equal(counts, scans(0)[1:])
    assert decoder.bad_frames == 0


def test_foreign_frames_and_wrong_lengths_are_ignored() -> None:
    own, other = encode_scans(5, scans(0), 0), encode_scans(6, scans(9), 9)
    noise = can_frames([(0x185, b"\1\2"), (0x285, bytes(8)), (0x705, b"\5"), (0x8000_0185, bytes(8))])
    decoder = ScanDecoder(5)
    counts, _ = decoder.feed(concatenate([noise, own[:7], noise, other, own[7:], noise]))
    np.testing.assert_array_equal(counts, scans(0)[1:])


def test_decoder_recovers_after_many_unmatched_first_halves() -> None:
    frames = encode_scans(5, scans(0), 0)
    decoder = ScanDecoder(5)
    for _ in range(40):
        assert len(decoder.feed(frames[::2])[0]) == 0
    decoder.feed(frames)  # nothing tells how many were lost: the first scans of this are doubtful until a TPDO2
    counts, counter = decoder.feed(encode_scans(5, scans(N), N))
    np.testing.assert_array_equal(counter, N + np.arange(N))
    np.testing.assert_array_equal(counts, scans(N))
