"""Edges of wire formats: overlaps, repeats, offsets, types out of range, old packings."""

from dataclasses import replace

import numpy as np
import pytest

from daq import IntArray
from daq.log.format.rice import Packed, pack, unpack
from daq.protocol import node
from daq.protocol import witmotion as wit
from daq.protocol.can_scan import ScanDecoder, ScanLayout, ScanMessage, encode_scans
from daq.protocol.can_signals import CanSignal
from daq.protocol.frames import CanFrames
from daq.protocol.overlap import without_overlap


@pytest.mark.parametrize(
    ("starts", "kept"),
    [
        ([], []),
        ([3, 14, 25], [3, 14, 25]),
        ([3, 14, 24, 25, 36], [3, 14, 25, 36]),
        ([0, 10, 11], [0, 11]),
        ([0, 5, 16, 20, 27], [0, 16, 27]),
    ],
)
def test_first_of_overlapping_frames_is_kept(starts: list[int], kept: list[int]) -> None:
    assert without_overlap(np.array(starts, np.intp), 11).tolist() == kept


def layout(*, counted: int) -> ScanLayout:
    """Return a scan of three messages with an axis each, the counter in one of them."""
    axis = CanSignal(name="a", start=0, length=16, signed=True, factor=0.5, offset=-40.0)
    return ScanLayout(
        messages=tuple(ScanMessage(name=name, identifier=16 + k, size=8) for k, name in enumerate("ABC")),
        axes=tuple((k, axis) for k in range(3)),
        counters=((counted, CanSignal(name="n", start=16, length=8)),),
        modulus=256,
        scale=0.25,
        unit=1.0,
        temperature=(ScanMessage(name="T", identifier=99, size=2), CanSignal(name="t", start=0, length=16)),
    )


def fed(decoder: ScanDecoder, frames: CanFrames) -> IntArray:
    return decoder.feed(frames, np.arange(len(frames))).counts


COUNTS = np.stack([np.arange(12), 100 - np.arange(12), 7 * np.arange(12)], axis=1).astype(np.int32) * 2


def test_values_with_offset_round_trip_and_saturate_at_signal_range() -> None:
    frames = encode_scans(layout(counted=0), COUNTS, 0)
    raw = frames.data[:3, :2].copy().view("<i2")[:, 0]
    assert raw.tolist() == [80, 180, 80]  # 0, 50, 0 m/s2: (x + 40) / 0.5
    np.testing.assert_array_equal(
        fed(ScanDecoder(layout(counted=2)), encode_scans(layout(counted=2), COUNTS, 0)), COUNTS[1:]
    )
    far = encode_scans(layout(counted=0), np.full((1, 3), 1_000_000, np.int32), 0)
    assert far.data[:3, :2].copy().view("<i2")[:, 0].tolist() == [32767] * 3


def test_sensor_identifiers_include_the_temperature_message() -> None:
    assert layout(counted=0).all_identifiers == {16, 17, 18, 99}
    assert replace(layout(counted=0), temperature=None).all_identifiers == {16, 17, 18}


def test_repeated_frames_are_dropped_and_first_frame_is_kept() -> None:
    frames = encode_scans(layout(counted=2), COUNTS, 0)
    twice = frames[np.sort(np.r_[np.arange(36), [3, 4, 35]])]
    np.testing.assert_array_equal(fed(ScanDecoder(layout(counted=2)), twice), COUNTS[1:])
    one = replace(layout(counted=0), messages=layout(counted=0).messages[:1], axes=layout(counted=0).axes[:1])
    alone = encode_scans(one, COUNTS[:, :1], 0)
    np.testing.assert_array_equal(fed(ScanDecoder(one), alone[np.array([0, 1, 1, 2])]), COUNTS[:3, :1])


def test_messages_in_wrong_order_form_no_scan() -> None:
    frames = encode_scans(layout(counted=2), COUNTS, 0)
    swapped = frames[np.r_[np.arange(12), [13, 12, 14], np.arange(15, 36)]]
    np.testing.assert_array_equal(fed(ScanDecoder(layout(counted=2)), swapped), np.delete(COUNTS, [0, 4], axis=0))


def test_signal_is_little_endian_unsigned_and_unscaled_by_default() -> None:
    signal = CanSignal(name="s", start=0, length=16)
    data = np.array([[0x02, 0xFF, 0, 0, 0, 0, 0, 0]], np.uint8)
    assert signal.physical(data).tolist() == [0xFF02]
    assert signal.limits == (0.0, 65_535.0)


def test_signal_limits_are_in_physical_units() -> None:
    assert CanSignal(name="s", start=0, length=8, signed=True, factor=2.0, offset=-16.0).limits == (-272.0, 238.0)
    assert CanSignal(name="s", start=0, length=8, factor=-1.0, offset=10.0).limits == (-245.0, 10.0)
    assert CanSignal(name="s", start=0, length=32, is_float=True).limits == (-np.inf, np.inf)


def test_unknown_axis_bits_of_node_hello_are_ignored() -> None:
    decoder = node.NodeDecoder()
    decoder.feed(node.encode_hello(node.Hello(product="p", serial="s", axes=(0, 2, 3), scale=1.0, rate=100.0)))
    assert decoder.hello is not None
    assert decoder.hello.axes == (0, 2)


def test_node_frames_separated_by_extra_zeros_are_read() -> None:
    scans = node.NodeScans(
        np.arange(15, dtype=np.int32).reshape(5, 3),
        np.arange(5, dtype=np.uint32),
        np.arange(5, dtype=np.uint32),
        np.zeros(5, np.int16),
    )
    line = node.encode_scans(scans)
    apart = b"\0".join(line[k : k + node.SCAN_SIZE] for k in range(0, len(line), node.SCAN_SIZE))
    decoder = node.NodeDecoder()
    np.testing.assert_array_equal(decoder.feed(apart).counts, scans.counts)
    assert decoder.bad_bytes == 0
    none = node.joined(node.NO_SCANS, scans)
    assert (none.counts.shape, none.counter.tolist(), none.time.shape, none.temperature.shape) == (
        *((5, 3), list(range(5)), (5,), (5,)),
    )


def test_witmotion_packet_of_unknown_type_counts_as_damage() -> None:
    scans = wit.encode_packets(wit.ACCELERATION, np.ones((2, 4), np.int16))
    decoder = wit.WitDecoder()
    found = decoder.feed(scans[:11] + wit.encode_packets(0x60, np.ones((1, 4), np.int16)) + scans[11:])
    assert (found.number.tolist(), decoder.bad_bytes) == ([0, 2], 11)
    assert decoder.feed(wit.encode_packets(0x5F, np.ones((1, 4), np.int16))).number.tolist() == []
    assert decoder.bad_bytes == 11


def test_lower_difference_order_is_chosen_for_equal_residual_size() -> None:
    assert pack(np.full((10, 1), 5, np.int32)).order == (0,)


@pytest.mark.parametrize(
    "packed",
    [
        Packed((0, 0), (0, 0), (33, 1), bytes(60)),
        Packed((4, 0), (0, 0, 0, 0, 0), (1, 1), bytes(60)),
        Packed((0, 0), (0, 0, 0), (1, 1), bytes(60)),
    ],
)
def test_packing_with_one_invalid_axis_is_refused(packed: Packed) -> None:
    with pytest.raises(ValueError, match=r"packed counts: expected \d start values"):
        unpack(packed, 3)
