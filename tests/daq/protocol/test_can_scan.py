"""Scans out of a DBC sensor's frames, whatever is lost or repeated: never a false one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq import DbcSensor
from daq.drivers import read_layout
from daq.protocol.can_scan import ScanDecoder, ScanLayout, encode_scans, what_is_missing
from daq.protocol.frames import CanFrames, can_frames, concatenate

#: an axis a message; `every` has a counter of 4 bits in each, `first` and `last` one of 8 bits in one of them
TEXT = """VERSION ""
BU_: N
BO_ 16 A: 8 N
 SG_ ax : 0|16@1- (0.5,0) [0|0] "mg" N
 SG_ n : 16|4@1+ (1,0) [0|15] "" N
BO_ 17 B: 8 N
 SG_ ay : 7|16@0- (0.5,0) [0|0] "mg" N
 SG_ n : 19|4@0+ (1,0) [0|15] "" N
 SG_ middle : 24|8@1+ (1,0) [0|0] "" N
BO_ 18 C: 8 N
 SG_ az : 0|16@1- (0.5,0) [0|0] "mg" N
 SG_ n : 16|4@1+ (1,0) [0|15] "" N
 SG_ last : 24|8@1+ (1,0) [0|0] "" N
BO_ 15 D: 1 N
 SG_ first : 0|8@1+ (1,0) [0|0] "" N
BO_ 19 E: 2 N
 SG_ T : 0|16@1- (0.01,0) [0|0] "degC" N
"""
COUNTERS = {"every": "n", "middle": "middle", "last": "last", "first": "first"}
#: scans that one lost whole may cost: itself, and those beside it on the sides where messages without a counter are
COST = {"every": 1, "middle": 3, "last": 2, "first": 2}


@pytest.fixture(scope="module")
def layouts(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ScanLayout]:
    file = tmp_path_factory.mktemp("dbc") / "three.dbc"
    file.write_text(TEXT)
    signals = ("ax", "ay", "az")
    return {
        name: read_layout(DbcSensor(file=file, signals=signals, counter=counter, temperature="T"))
        for name, counter in COUNTERS.items()
    }


def ramp(n: int) -> np.ndarray[tuple[int, int], np.dtype[np.int32]]:
    """Return scans (n, 3) that each contain their number, different for all neighbours."""
    k = np.arange(n, dtype=np.int32)
    return np.stack([k, -k, 3 * k % 20_000], axis=1)


def fed(decoder: ScanDecoder, frames: CanFrames, cuts: list[int]) -> list[tuple[int, list[int], int]]:
    """Return (counter, counts, arrival) of each scan, fed in pieces; a frame arrives at its place in the stream."""
    found = []
    for start, stop in zip([0, *cuts], [*cuts, len(frames)], strict=True):
        scans = decoder.feed(frames[start:stop], np.arange(start, stop))
        found += list(zip(scans.counter.tolist(), scans.counts.tolist(), scans.arrived.tolist(), strict=True))
    return found


@pytest.mark.parametrize("name", COUNTERS)
def test_complete_stream_is_decoded_across_chunks_and_wraps(layouts: dict[str, ScanLayout], name: str) -> None:
    layout = layouts[name]
    n, m = 600, len(layout.messages)
    frames = encode_scans(layout, ramp(n), 7)
    decoder = ScanDecoder(layout)
    found = fed(decoder, frames, list(range(1, len(frames), 5)))
    first, last = {"every": (0, n), "middle": (1, n - 1), "last": (1, n), "first": (0, n - 1)}[name]
    assert found == [((k + 7) % layout.modulus, ramp(n)[k].tolist(), m * k + m - 1) for k in range(first, last)]
    assert decoder.bad_frames == 0
    assert layout.modulus == (16 if name == "every" else 256)


@given(
    name=st.sampled_from(list(COUNTERS)),
    fate=st.lists(st.sampled_from([1, 1, 1, 1, 0, 2]), min_size=4, max_size=40),
    burst=st.integers(0, 12),
    cuts=st.lists(st.integers(0, 40), max_size=5),
)
def test_frames_of_different_scans_are_never_combined(
    layouts: dict[str, ScanLayout], name: str, fate: list[int], burst: int, cuts: list[int]
) -> None:
    """Frames are lost and repeated at random, and a burst is lost; all decoded scans were sent, in order, with their
    number.
    """
    layout = layouts[name]
    m = len(layout.messages)
    n = (len(fate) + burst) // m + 6
    times = np.ones(n * m, int)
    times[m : m + len(fate)] = fate
    times[m + len(fate) // 2 : m + len(fate) // 2 + burst] = 0
    frames = encode_scans(layout, ramp(n), 0)[np.repeat(np.arange(n * m), times)]
    found = fed(ScanDecoder(layout), frames, sorted(min(cut, len(frames)) for cut in cuts))
    sent = [k for k in range(n) for number, counts, _ in found if counts == ramp(n)[k].tolist()]
    assert len(sent) == len(found)
    assert [number for number, _, _ in found] == [k % layout.modulus for k in sent]
    assert sent == sorted(set(sent))
    whole = [k for k in range(n) if times[k * m : k * m + m].all()]
    hurt = n - len(whole)
    assert len(whole) - len(found) <= (COST[name] - 1) * hurt + 2  # the first and the last of a stream


@pytest.mark.parametrize("name", COUNTERS)
def test_one_lost_frame_loses_one_scan(layouts: dict[str, ScanLayout], name: str) -> None:
    layout = layouts[name]
    m, frames = len(layout.messages), encode_scans(layout, ramp(40), 0)
    whole = len(fed(ScanDecoder(layout), frames, []))
    for lost in range(m):
        decoder = ScanDecoder(layout)
        missing = whole - len(fed(decoder, frames[np.arange(len(frames)) != 20 * m + lost], []))
        assert missing == 1
        assert decoder.bad_frames == m - 1


def test_foreign_short_and_remote_frames_are_ignored(layouts: dict[str, ScanLayout]) -> None:
    layout = layouts["every"]
    frames = encode_scans(layout, ramp(10), 0)
    strange = can_frames(
        [(0x123, b"12345678"), (16, b"1234567"), (16 | 0x4000_0000, b""), (16 | 0x8000_0000, b"12345678")]
    )
    decoder = ScanDecoder(layout)
    mixed = concatenate([frames[:13], strange, frames[13:]])
    assert len(fed(decoder, mixed, [])) == 10
    assert decoder.bad_frames == 1


def test_nan_infinite_and_out_of_range_values_are_dropped(tmp_path: Path) -> None:
    file = tmp_path / "float.dbc"
    file.write_text(
        'VERSION ""\nBU_: N\nBO_ 1 A: 5 N\n SG_ a : 0|32@1- (1,0) [0|0] "g" N\n SG_ n : 32|8@1+ (1,0) [0|0] "" N\n'
        "SIG_VALTYPE_ 1 a : 1;\n"
    )
    layout = read_layout(DbcSensor(file=file, signals=("a",), counter="n"))
    values = np.array([0.5, np.nan, -1.25, np.inf, 300.0, 1e30], np.float32)  # g; 219 is the most that fits
    data = np.zeros((6, 8), np.uint8)
    data[:, :4] = values.astype("<f4").view(np.uint8).reshape(6, 4)
    data[:, 4] = np.arange(6)
    decoder = ScanDecoder(layout)
    scans = decoder.feed(CanFrames(np.ones(6, np.uint32), np.full(6, 5, np.uint8), data), np.zeros(6, np.intp))
    assert scans.counter.tolist() == [0, 2]
    np.testing.assert_allclose(
        scans.counts[:, 0] * layout.scale, [0.5 * 9.80665, -1.25 * 9.80665], atol=layout.scale / 2
    )
    assert decoder.bad_frames == 4


def test_counter_value_outside_its_range_is_dropped(tmp_path: Path) -> None:
    file = tmp_path / "alive.dbc"
    file.write_text(
        'VERSION ""\nBU_: N\nBO_ 1 A: 2 N\n SG_ a : 0|8@1- (1,0) [0|0] "g" N\n SG_ n : 8|4@1+ (1,0) [0|14] "" N\n'
    )
    layout = read_layout(DbcSensor(file=file, signals=("a",), counter="n"))
    frames = can_frames([(1, bytes([7, number])) for number in (13, 14, 15, 0, 1)])
    scans = ScanDecoder(layout).feed(frames, np.zeros(5, np.intp))
    assert (layout.modulus, scans.counter.tolist()) == (15, [13, 14, 1])  # the one after it counts on from none


@given(
    name=st.sampled_from(list(COUNTERS)),
    pieces=st.lists(
        st.lists(st.tuples(st.integers(15, 20), st.binary(max_size=8)), max_size=30), min_size=1, max_size=4
    ),
)
def test_arbitrary_frames_give_valid_scans_and_counts(
    layouts: dict[str, ScanLayout], name: str, pieces: list[list[tuple[int, bytes]]]
) -> None:
    """Whatever comes, scans are of one shape, their counters are some, and no frame is counted twice."""
    decoder, layout, n = ScanDecoder(layouts[name]), layouts[name], 0
    for piece in pieces:
        scans = decoder.feed(can_frames(piece), np.zeros(len(piece), np.intp))
        assert scans.counts.shape == (len(scans.counter), 3)
        assert ((scans.counter >= 0) & (scans.counter < layout.modulus)).all()
        n += len(scans.counter)
    assert len(layout.messages) * n + decoder.bad_frames <= sum(map(len, pieces)) + len(layout.messages)


def test_temperature_is_nan_until_its_frame_arrives(layouts: dict[str, ScanLayout]) -> None:
    decoder = ScanDecoder(layouts["first"])
    assert np.isnan(decoder.temperature)
    decoder.feed(can_frames([(19, (-1234).to_bytes(2, "little", signed=True))]), np.zeros(1, np.intp))
    assert decoder.temperature == pytest.approx(-12.34)


def test_missing_or_short_message_is_named(layouts: dict[str, ScanLayout]) -> None:
    layout = layouts["every"]
    frames = encode_scans(layout, ramp(5), 0)
    assert what_is_missing(layout, frames[frames.ids != 17]) == "no frame of B (0x11) came"
    short = replace(frames, dlc=np.where(frames.ids == 18, 3, frames.dlc).astype(np.uint8))
    assert what_is_missing(layout, short) == "C (0x12): expected 8 bytes, found 3"
    assert what_is_missing(layout, frames).endswith("the counter does not change, or they are not sent as A, B, C")


@pytest.mark.parametrize("name", COUNTERS)
def test_constant_counter_gives_at_most_one_scan(layouts: dict[str, ScanLayout], name: str) -> None:
    same = [encode_scans(layouts[name], ramp(9)[k : k + 1], 3) for k in range(9)]
    assert len(fed(ScanDecoder(layouts[name]), concatenate(same), [])) <= 1  # the first may be new


def test_incomplete_scans_are_buffered_up_to_a_limit(layouts: dict[str, ScanLayout]) -> None:
    layout = layouts["last"]
    decoder = ScanDecoder(layout)
    only = encode_scans(layout, ramp(6000), 0)
    fed(decoder, only[only.ids == 16], list(range(100, 6000, 100)))
    assert decoder.bad_frames == 6000 - 4096
    assert len(fed(decoder, encode_scans(layout, ramp(10), 0), [])) == 9
