"""Frames of home-built nodes: bytes and back, whole, damaged and in pieces."""

import itertools

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from daq.protocol import cobs, node
from daq.protocol.node import CommandDecoder, Hello, NodeDecoder
from tests.support.daq.node_frames import read_byte_by_byte, some_scans, values
from tests.support.thorough import few_of

SIZE = node.SCAN_SIZE
HELLO = Hello(product="adxl355", serial="N0000001", axes=(1, 2), scale=2.0**-15, rate=1000.0)
seeds = st.integers(0, 2**32)


def test_crc_has_the_published_check_value() -> None:
    """The check value of CRC-16/CCITT-FALSE in every catalogue of CRCs."""
    assert cobs.crc16(np.frombuffer(b"123456789", np.uint8)[None]).tolist() == [0x29B1]


@pytest.mark.parametrize(
    ("plain", "stuffed"),
    [
        ("00", "01 01"),
        ("0000", "01 01 01"),
        ("11220033", "03 11 22 02 33"),
        ("11223344", "05 11 22 33 44"),
        ("11000000", "02 11 01 01 01"),
    ],
)
def test_cobs_stuffing_matches_published_examples(plain: str, stuffed: str) -> None:
    found = cobs.stuffed(np.frombuffer(bytes.fromhex(plain), np.uint8)[None])
    assert found.tobytes() == bytes.fromhex(stuffed)
    back, good = cobs.unstuffed(found)
    assert (back.tobytes(), good.tolist()) == (bytes.fromhex(plain), [True])


@given(st.lists(st.binary(min_size=253, max_size=253), min_size=1, max_size=4), st.integers(1, 253))
def test_cobs_round_trip_for_any_length(contents: list[bytes], size: int) -> None:
    frames = np.array([list(content[:size]) for content in contents], np.uint8)
    stuffed = cobs.stuffed(frames)
    assert stuffed.all()
    back, good = cobs.unstuffed(stuffed)
    assert good.all()
    np.testing.assert_array_equal(back, frames)


def test_content_longer_than_253_bytes_is_refused() -> None:
    with pytest.raises(ValueError, match="expected at most 253 bytes, found 254"):
        cobs.stuffed(np.zeros((1, 254), np.uint8))


@given(seeds, st.integers(1, 60), st.booleans())
def test_scan_encoding_round_trip(seed: int, n: int, small: bool) -> None:
    scans, decoder = some_scans(seed, n, small=small), NodeDecoder()
    stream = node.encode_scans(scans)
    assert len(stream) == SIZE * n
    assert values(decoder.feed(stream)) == values(scans) == read_byte_by_byte(stream)
    assert decoder.bad_bytes == 0


def test_hello_and_command_encoding_round_trip() -> None:
    decoder = NodeDecoder()
    decoder.feed(node.encode_scans(some_scans(1, 3)) + node.encode_hello(HELLO) + node.encode_scans(some_scans(2, 3)))
    assert decoder.hello == HELLO
    assert decoder.bad_bytes == 0
    reported = b"".join(node.encode_command(what) for what in (node.WHO, node.STOP)) + node.encode_command(
        node.START, 62.5
    )
    commands = CommandDecoder()
    found = [command for byte in b"\0" + reported for command in commands.feed(bytes([byte]))]
    assert found == [(node.WHO, 0.0), (node.STOP, 0.0), (node.START, 62.5)]


@settings(max_examples=50)
@given(seeds, st.lists(st.integers(0, 30 * SIZE), max_size=40), st.binary(max_size=200))
def test_decoding_is_independent_of_chunking(seed: int, cuts: list[int], noise: bytes) -> None:
    stream = noise + b"\0" + node.encode_scans(some_scans(seed, 15)) + noise + node.encode_scans(some_scans(seed, 10))
    whole, pieces = NodeDecoder(), NodeDecoder()
    parts = [pieces.feed(stream[a:b]) for a, b in itertools.pairwise([0, *sorted(cuts), len(stream)])]
    assert values(*parts) == values(whole.feed(stream))
    assert pieces.bad_bytes == whole.bad_bytes


@given(st.binary(max_size=600))
def test_decoding_of_arbitrary_bytes_equals_bytewise_decoding(noise: bytes) -> None:
    decoder = NodeDecoder()
    found = values(decoder.feed(noise + b"\0"))
    assert found == read_byte_by_byte(noise + b"\0")
    CommandDecoder().feed(noise)


damages = st.tuples(st.sampled_from(["flip", "cut", "insert"]), st.integers(0, SIZE - 1), st.integers(1, 255))


def damaged(frame: bytes, kind: str, at: int, value: int) -> bytes:
    if kind == "flip":
        return frame[:at] + bytes([frame[at] ^ value]) + frame[at + 1 :]
    if kind == "cut":
        return frame[:at] + frame[at + 1 + value % 30 :]
    return frame[:at] + bytes([value]) * (1 + value % 7) + frame[at:]


# Derandomised: of what the CRC cannot tell from a frame, one in 65536, nothing may turn up now and then.
@settings(max_examples=120, derandomize=True)
@given(seeds, st.dictionaries(st.integers(0, 19), damages, max_size=12), st.binary(max_size=SIZE), st.booleans())
def test_damage_loses_only_damaged_frames_and_adds_none(
    seed: int, harm: dict[int, tuple[str, int, int]], junk: bytes, small: bool
) -> None:
    whole = node.encode_scans(some_scans(seed, 20, small=small))
    frames = [whole[k : k + SIZE] for k in range(0, len(whole), SIZE)]
    sent = [damaged(frame, *harm[k]) if k in harm else frame for k, frame in enumerate(frames)]
    stream = junk + b"\0" + b"".join(sent) + b"\0"
    # a frame is intact if it stands between two ends of frames
    intact = [frame for frame in frames if b"\0" + frame in stream]
    unharmed = [k for k in range(20) if k not in harm and (k == 0 or sent[k - 1].endswith(b"\0"))]
    assert {frames[k] for k in unharmed} <= set(intact)
    decoder = NodeDecoder()
    assert values(decoder.feed(stream)) == values(NodeDecoder().feed(b"".join(intact)))
    alone = sum(a == b == 0 for a, b in itertools.pairwise(b"\0" + stream))
    assert decoder.bad_bytes == len(stream) - SIZE * len(intact) - alone


@pytest.mark.parametrize("seed", few_of(range(3)))
def test_no_frame_with_wrong_bits_is_accepted(seed: int) -> None:
    """Up to three wrong bits in each of 20 000 frames: the CRC alone would let one in 65536 of them pass."""
    random = np.random.default_rng(900 + seed)
    scans = some_scans(seed, 20_000, small=True)
    line = np.frombuffer(node.encode_scans(scans), np.uint8).reshape(-1, SIZE).copy()
    for _ in range(3):
        at = random.integers(0, SIZE - 1, len(line))
        line[np.arange(len(line)), at] ^= (1 << random.integers(0, 8, len(line))).astype(np.uint8)
    stream = line.tobytes()
    found, sent = values(NodeDecoder().feed(stream)), set(values(scans))
    assert found == read_byte_by_byte(stream)
    assert set(found) <= sent
