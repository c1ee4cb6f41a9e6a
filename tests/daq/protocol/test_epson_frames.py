"""Burst frames: bytes and back, whole, damaged and in pieces."""

import itertools
from dataclasses import dataclass

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from daq import IntArray
from daq.protocol import epson
from daq.protocol.epson import FRAME_SIZE, BurstDecoder, Frames

int32 = st.integers(-(2**31), 2**31 - 1)
scans = st.lists(st.tuples(int32, int32, int32), min_size=1, max_size=40)


def joined(parts: list[Frames]) -> tuple[list[list[int]], list[int], list[int]]:
    """Return all scans, counters and temperatures as lists."""
    counts = [scan for part in parts for scan in part.counts.tolist()]
    counter = [count for part in parts for count in part.counter.tolist()]
    return counts, counter, [raw for part in parts for raw in part.temperature.tolist()]


def random_frames(seed: int, n: int) -> bytes:
    """Return n frames of scans drawn over all of int32."""
    counts = np.random.default_rng(seed).integers(-(2**31), 2**31, (n, 3)).astype(np.int32)
    return epson.encode_frames(counts, 65_500, epson.temperature_raw(20.0))


@given(scans, st.integers(0, 2**40), int32)
def test_frame_encoding_round_trip(counts: list[tuple[int, int, int]], first: int, temperature: int) -> None:
    array: IntArray = np.array(counts, np.int32)
    decoder = BurstDecoder()
    found = decoder.feed(epson.encode_frames(array, first, temperature))
    np.testing.assert_array_equal(found.counts, array)
    assert found.counts.dtype == np.int32
    assert found.counter.tolist() == [(first + k) % 65536 for k in range(len(counts))]
    assert set(found.temperature.tolist()) == {temperature}
    assert decoder.bad_bytes == 0


def test_frame_layout_matches_data_sheet() -> None:
    frame = epson.encode_frames(np.array([[1, -2, 0x01020304]], np.int32), 0xABCD, 0x11223344)
    body = bytes.fromhex("f000 11223344 00000001 fffffffe 01020304 abcd")
    total = sum(int.from_bytes(body[i : i + 2], "big") for i in range(0, len(body), 2)) & 0xFFFF
    assert frame == b"\x80" + body + total.to_bytes(2, "big") + b"\x0d"


@given(st.integers(0, 2**32), st.lists(st.integers(0, 30 * FRAME_SIZE), max_size=40), st.binary(max_size=50))
def test_decoding_is_independent_of_chunking(seed: int, cuts: list[int], noise: bytes) -> None:
    stream = noise + random_frames(seed, 15) + noise + random_frames(seed + 1, 10)
    whole, pieces = BurstDecoder(), BurstDecoder()
    edges = [0, *sorted(cuts), len(stream)]
    parts = [pieces.feed(stream[a:b]) for a, b in itertools.pairwise(edges)]
    assert joined(parts) == joined([whole.feed(stream)])
    assert pieces.bad_bytes == whole.bad_bytes


@dataclass(frozen=True)
class Damage:
    """Damage of one frame; `kind` is flip, cut or insert."""

    kind: str
    at: int
    value: int

    def applied(self, frame: bytes) -> bytes:
        if self.kind == "flip":
            return frame[: self.at] + bytes([frame[self.at] ^ self.value]) + frame[self.at + 1 :]
        if self.kind == "cut":
            return frame[: self.at] + frame[self.at + 1 + self.value % 30 :]
        return frame[: self.at] + bytes([self.value]) * (1 + self.value % 7) + frame[self.at :]


damages = st.builds(Damage, st.sampled_from(["flip", "cut", "insert"]), st.integers(0, 23), st.integers(1, 255))


@settings(max_examples=300)
@given(st.integers(0, 2**32), st.dictionaries(st.integers(0, 19), damages, max_size=12), st.binary(max_size=23))
def test_damage_loses_only_damaged_frames_and_adds_none(seed: int, harm: dict[int, Damage], junk: bytes) -> None:
    whole = random_frames(seed, 20)
    frames = [whole[k : k + FRAME_SIZE] for k in range(0, len(whole), FRAME_SIZE)]
    stream = junk + b"".join(harm[k].applied(f) if k in harm else f for k, f in enumerate(frames))
    intact = [frame for frame in frames if frame in stream]  # a byte put between two frames harms neither
    assert len(intact) >= len(frames) - len(harm)
    assert joined([BurstDecoder().feed(stream)]) == joined([BurstDecoder().feed(b"".join(intact))])


@given(st.integers(0, 2**32), st.integers(0, FRAME_SIZE - 1), st.integers(1, 255))
def test_single_wrong_byte_is_detected_and_counted(seed: int, at: int, difference: int) -> None:
    whole = random_frames(seed, 3)
    decoder = BurstDecoder()
    found = decoder.feed(
        whole[:FRAME_SIZE] + Damage("flip", at, difference).applied(whole[24:48]) + whole[2 * FRAME_SIZE :]
    )
    assert found.counter.tolist() == [65_500, 65_502]
    assert decoder.bad_bytes == FRAME_SIZE


def test_stream_starting_within_a_frame_loses_only_that_frame() -> None:
    stream = random_frames(7, 10)
    for start in range(1, FRAME_SIZE):
        decoder = BurstDecoder()
        assert decoder.feed(stream[start:]).counter.tolist() == list(range(65_501, 65_510))
        assert decoder.bad_bytes == FRAME_SIZE - start


@pytest.mark.parametrize("celsius", [-30.0, 0.0, 21.0, 85.0])
def test_temperature_round_trip_is_accurate_to_half_a_count(celsius: float) -> None:
    found = float(epson.temperature_celsius(epson.temperature_raw(celsius)))
    assert found == pytest.approx(celsius, abs=0.0037918 / 2 + 1e-9)


def test_false_frame_across_two_frames_is_not_decoded() -> None:
    # A frame's last 14 bytes and the next one's first 10 spell a frame of their own.
    first, second = bytearray(random_frames(1, 1)), bytearray(random_frames(2, 1))
    first[10], second[9] = epson.HEADER, epson.DELIMITER
    first[21:23] = _sum(bytes(first[1:21]))
    inner = bytes(first[11:24]) + bytes(second[:7])
    second[7:9] = _sum(inner)
    second[21:23] = _sum(bytes(second[1:21]))
    stream = bytes(first + second)
    assert BurstDecoder().feed(stream[10:34]).counter.shape == (1,)  # it is one, seen by itself
    assert joined([BurstDecoder().feed(stream)]) == joined(
        [BurstDecoder().feed(bytes(first)), BurstDecoder().feed(bytes(second))]
    )


def _sum(body: bytes) -> bytes:
    """Return the checksum of 20 bytes."""
    total = sum(int.from_bytes(body[i : i + 2], "big") for i in range(0, len(body), 2))
    return (total & 0xFFFF).to_bytes(2, "big")
