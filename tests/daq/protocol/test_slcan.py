"""SLCAN lines: round trips over every kind of frame, any cut into chunks, any damage."""

import itertools

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from daq.protocol.frames import EXTENDED, REMOTE, CanFrames, can_frames, concatenate
from daq.protocol.slcan import SlcanDecoder, encode

IDS = st.integers(0, 0x7FF) | st.integers(0, 0x1FFFFFFF).map(lambda number: number | EXTENDED)
FRAME = st.tuples(IDS, st.binary(max_size=8))


def pairs(frames: CanFrames) -> list[tuple[int, bytes]]:
    return list(frames)


@given(st.lists(FRAME, max_size=20), st.lists(st.integers(0, 600), max_size=6))
def test_slcan_round_trip_for_any_chunking(frames: list[tuple[int, bytes]], cuts: list[int]) -> None:
    text = encode(can_frames(frames))
    edges = [0, *sorted(min(cut, len(text)) for cut in cuts), len(text)]
    decoder = SlcanDecoder()
    parts = [decoder.feed(text[a:b]) for a, b in itertools.pairwise(edges)]
    assert pairs(concatenate(parts)) == frames
    assert decoder.bad_lines == 0


@pytest.mark.parametrize(
    ("line", "frame"),
    [
        (b"t1A32BEEF\r", (0x1A3, b"\xbe\xef")),
        (b"t1a32beef\r", (0x1A3, b"\xbe\xef")),
        (b"t0000\r", (0, b"")),
        (b"T1BADCAFE10A\r", (0x1BADCAFE | EXTENDED, b"\x0a")),
    ],
)
def test_lines_in_manual_notation_are_decoded_and_encoded(line: bytes, frame: tuple[int, bytes]) -> None:
    assert pairs(SlcanDecoder().feed(line)) == [frame]
    assert encode(can_frames([frame])).lower() == line.lower()


@pytest.mark.parametrize(("line", "number"), [(b"r1234\r", 0x123), (b"R000001234\r", 0x123 | EXTENDED)])
def test_remote_frame_has_length_and_no_data(line: bytes, number: int) -> None:
    found = SlcanDecoder().feed(line)
    assert (found.ids.tolist(), found.dlc.tolist()) == ([number | REMOTE], [4])
    assert not found.data.any()
    assert encode(found) == line


@pytest.mark.parametrize(
    "line",
    [
        b"t1232AAB",  # a digit is missing
        b"t1232AABBC",  # one too many
        b"t12G2AABB",
        b"t1232AAXB",
        b"t1239" + b"A" * 18,  # nine bytes
        b"tFFF0",  # more than 11 bits
        b"TFFFFFFFF0",  # more than 29
        b"T",
        b"hello",
        b"\x00\xff",
        b"d1232AABB",  # CAN FD
        b"x" * 5000,
    ],
)
def test_damaged_line_loses_only_itself(line: bytes) -> None:
    good = b"t1832AABB\r"
    decoder = SlcanDecoder()
    assert pairs(decoder.feed(good + line + b"\r" + good)) == [(0x183, b"\xaa\xbb")] * 2
    assert decoder.bad_lines == 1


def test_adapter_replies_are_neither_frames_nor_damage() -> None:
    decoder = SlcanDecoder()
    assert len(decoder.feed(b"\r\r\x07z\rZ\rV1013\rN0042\rF00\r")) == 0
    assert decoder.bad_lines == 0


@given(st.binary(max_size=300), st.integers(1, 40))
@example(b"\0N" + bytes(27), 1)  # too long, with an answer's letter where the end of it would begin
def test_garbage_is_decoded_without_error_for_any_chunking(garbage: bytes, size: int) -> None:
    whole, cut = SlcanDecoder(), SlcanDecoder()
    text = garbage + b"\rt7FF0\r"
    expected = pairs(whole.feed(text))
    found = [frame for k in range(0, len(text), size) for frame in cut.feed(text[k : k + size])]
    assert found == expected
    assert cut.bad_lines == whole.bad_lines
    assert expected[-1] == (0x7FF, b"")  # it hears again


@given(
    st.lists(st.tuples(st.integers(0, 20_000), st.sampled_from(b"\r\x07tT09AFZz\x00\xff")), max_size=10),
    st.lists(st.integers(0, 20_000), max_size=10),
)
def test_damage_loses_only_the_damaged_lines(hits: list[tuple[int, int]], lost: list[int]) -> None:
    frames = [(0x180 + k % 8, bytes([k % 256] * 8)) for k in range(200)]
    text = bytearray(encode(can_frames(frames)))
    touched = {at % len(text) for at, _ in hits} | {at % len(text) for at in lost}
    for at, byte in hits:
        text[at % len(text)] = byte
    for at in sorted({at % len(text) for at in lost}, reverse=True):
        del text[at]
    # 22 bytes a line; a lost end joins a line with the next
    spoiled = {at // 22 for at in touched} | {at // 22 + 1 for at in touched if at % 22 == 21}
    found = pairs(SlcanDecoder().feed(bytes(text)))
    expected = [frame for k, frame in enumerate(frames) if k not in spoiled]
    rest = iter(found)
    assert all(any(frame == other for other in rest) for frame in expected), "an intact line was lost"


def test_can_frames_with_inconsistent_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"expected dlc \(2,\) and data \(2, 8\), found \(1,\), \(2, 8\)"):
        CanFrames(np.zeros(2, np.uint32), np.zeros(1, np.uint8), np.zeros((2, 8), np.uint8))
