"""WitMotion's packets: bytes and back, whole and damaged; its driver, and its identification."""

import itertools

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from daq import CanAddress, DeviceIdentity, DriverError, SystemClock, driver_names, make_driver
from daq.drivers import LineFormat, TextAddress, low_grade
from daq.emulator import EmulatedWitmotion, LineFaults
from daq.protocol import witmotion as wit
from daq.protocol.frames import can_frames, concatenate
from daq.protocol.witmotion import PACKET_SIZE, WitDecoder
from tests.support.daq.can_buses import pty, serving
from tests.support.daq.emulated_ports import Ramp

Values = list[tuple[int, ...]]


def words_of(seed: int, n: int) -> np.ndarray[tuple[int, ...], np.dtype[np.int16]]:
    """Return n packets' words, drawn over all of int16."""
    return np.random.default_rng(seed).integers(-(2**15), 2**15, (n, 4)).astype(np.int16)


def read(decoder: WitDecoder, *chunks: bytes) -> Values:
    """Return scans as (number, x, y, z, temperature)."""
    parts = [decoder.feed(chunk) for chunk in chunks]
    return [
        (int(number), *map(int, xyz), int(temperature))
        for part in parts
        for number, xyz, temperature in zip(part.number, part.counts, part.temperature, strict=True)
    ]


def sent(words: np.ndarray[tuple[int, ...], np.dtype[np.int16]]) -> Values:
    return [(k, *map(int, row)) for k, row in enumerate(words)]


def test_packet_layout_matches_data_sheet() -> None:
    packet = wit.encode_packets(wit.ACCELERATION, np.array([[1, -2, 0x0102, 2150]], np.int16))
    body = bytes.fromhex("55 51 0100 feff 0201 6608")
    assert packet == body + bytes([sum(body) & 0xFF])
    assert pytest.approx(16 * 9.80665) == wit.SCALE * 2**15
    assert wit.write_register(wit.RATE, 0x0B) == bytes.fromhex("ff aa 03 0b 00")


@settings(max_examples=40)
@given(st.integers(0, 2**32), st.lists(st.integers(0, 25 * PACKET_SIZE), max_size=40), st.binary(max_size=30))
def test_decoding_is_independent_of_chunking(seed: int, cuts: list[int], noise: bytes) -> None:
    packets = wit.encode_packets(wit.ACCELERATION, words_of(seed, 20))
    stream = packets[:55] + noise + packets[55:]
    whole, pieces = WitDecoder(), WitDecoder()
    chunks = [stream[a:b] for a, b in itertools.pairwise([0, *sorted(cuts), len(stream)])]
    assert read(pieces, *chunks) == read(whole, stream)
    assert pieces.bad_bytes == whole.bad_bytes


# Derandomised: a sum of eight bits takes one window of noise in 2^20 for a packet.
@settings(max_examples=60, derandomize=True)
@given(st.integers(0, 2**32), st.dictionaries(st.integers(1, 29), st.integers(0, PACKET_SIZE - 1), max_size=20))
def test_wrong_bytes_lose_their_packets_and_keep_scan_numbers(seed: int, harm: dict[int, int]) -> None:
    words = words_of(seed, 30)
    line = bytearray(wit.encode_packets(wit.ACCELERATION, words))
    for packet, at in harm.items():
        line[PACKET_SIZE * packet + at] ^= 0x24
    decoder = WitDecoder()
    assert read(decoder, bytes(line), bytes(PACKET_SIZE)) == [s for k, s in enumerate(sent(words)) if k not in harm]
    assert (
        decoder.bad_bytes == PACKET_SIZE * len(harm) + 1
    )  # of the eleven zeros at the end ten might be a packet's first


@given(st.binary(max_size=300))
@settings(max_examples=40)
def test_arbitrary_bytes_raise_no_error(noise: bytes) -> None:
    WitDecoder().feed(noise)


def test_packets_of_other_types_are_neither_scans_nor_damage() -> None:
    words = words_of(5, 12)
    scans = np.frombuffer(wit.encode_packets(wit.ACCELERATION, words), np.uint8).reshape(-1, PACKET_SIZE)
    angles = np.frombuffer(wit.encode_packets(0x53, words), np.uint8).reshape(-1, PACKET_SIZE)
    line = np.stack([scans, angles], axis=1).copy()
    line[4] ^= 0x24  # a scan of two packets
    decoder = WitDecoder()
    assert read(decoder, line[:3].tobytes(), line[3:].tobytes()) == [s for s in sent(words) if s[0] != 4]
    assert decoder.bad_bytes == 2 * PACKET_SIZE


@pytest.mark.live
def test_rate_above_line_capacity_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daq.drivers.serial.witmotion.BAUDS", (115_200, 9600))
    device = EmulatedWitmotion(Ramp(), SystemClock(), temperature=-7.5, faults=LineFaults(baud=9600))
    with serving(device.serve):
        with pytest.raises(DriverError, match="rate: expected at most 87 Hz at 9600 bit/s, found 100"):
            make_driver("witmotion", device.port, 100.0).open()
        driver = make_driver("witmotion", device.port, 50.0)
        assert driver.open() == DeviceIdentity(product="WT901", details={"baud": 9600})
        reads = [driver.read() for _ in range(3)]
        driver.close()
    device.close()
    assert {scans.temperature for scans in reads if len(scans.counts)} == {-7.5}


@given(st.integers(0, 2**32), st.integers(1, 127))
def test_can_frames_hold_the_same_values_as_packets(seed: int, node: int) -> None:
    words = words_of(seed, 8)
    frames = wit.encode_frames(node, wit.ACCELERATION, words)
    assert frames.ids.tolist() == [node] * 8
    packets = np.frombuffer(wit.encode_packets(wit.ACCELERATION, words), np.uint8).reshape(-1, PACKET_SIZE)
    np.testing.assert_array_equal(frames.data, packets[:, :8])
    others = concatenate([wit.encode_frames(node, 0x53, words), frames, can_frames([(node, b"\x55\x51")])])
    counts, wrong = wit.decode_frames(others)
    np.testing.assert_array_equal(counts, words[:, :3])
    assert wrong == 1


@given(st.lists(st.tuples(st.integers(0, 2**29), st.binary(max_size=8)), max_size=20))
def test_arbitrary_can_frames_raise_no_error(frames: list[tuple[int, bytes]]) -> None:
    counts, wrong = wit.decode_frames(can_frames(frames))
    assert len(counts) + wrong <= len(frames)


@pytest.mark.live
def test_missing_can_node_and_sync_option_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daq.drivers.can.witmotion_can._ANSWER_SECONDS", 0.1)
    with pty() as (_, port):
        driver = make_driver("witmotion", CanAddress(interface="slcan", channel=port, node=0x50), 100.0)
        with pytest.raises(DriverError, match=f"slcan:{port} node 80: no WT901 answers: no accelerations within 0.1 s"):
            driver.open()
    synced = CanAddress(interface="slcan", channel="x", node=0x50, sync="consumer")
    with pytest.raises(ValueError, match="sync of slcan:x node 80: a WT901 samples by its own clock"):
        make_driver("witmotion", synced, 100.0)


def test_unsupported_rate_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected one of \[10, 20, 50, 100, 200\] Hz, found 1000"):
        make_driver("witmotion", "/dev/none", 1000.0)


def test_witmotion_is_the_only_low_grade_driver_but_for_lines_without_a_number() -> None:
    assert [name for name in driver_names() if low_grade(name)] == ["witmotion"]
    for columns, is_low in ((("x",), True), (("counter", "x"), False), (("time_ms", "x"), False)):
        place = TextAddress(port="/dev/none", form=LineFormat(columns=columns, unit="g"))
        assert bool(low_grade("serial-text", place)) == is_low
    assert low_grade("witmotion").startswith("scans have no number")
