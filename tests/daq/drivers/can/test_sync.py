"""Nodes that sample on one SYNC: the same instants, whatever their own clocks do and whoever is lost meanwhile."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq import (
    Assembler,
    Block,
    CanAddress,
    Channel,
    DeviceReader,
    DriverError,
    Event,
    Flag,
    FloatArray,
    IntArray,
    Item,
    McapWriter,
    Recording,
    ScaledClock,
    load_recordings,
    make_driver,
    read_log,
)
from daq.drivers import EPSON_SCALE
from daq.drivers.can.bus import Chunk
from daq.drivers.can.sync_count import SyncCount, SyncedCounter
from daq.emulator import EmulatedEpsonCan, EmulatedSlcan
from daq.emulator.can.sync import synced_frames
from daq.log import CHANNELS, ChannelMap
from daq.protocol.epson_can import SYNC, encode_scans
from daq.protocol.frames import can_frames
from tests.support.daq.blocks import START, make_block
from tests.support.daq.can_buses import served, wait_for
from tests.support.daq.readers import running

RATE = 1000.0
Counts = list[int] | FloatArray


class Motion:
    """A motion that is the same everywhere, of several tones: counts determine the time."""

    def start(self, time: int, rate: float) -> None:
        """Note when it begins."""
        self._start, self._rate = time, rate

    def read(self, index: int, n: int) -> IntArray:
        """Return counts (n, 3)."""
        t = (self._start - START) * 1e-9 + np.arange(index, index + n) / self._rate
        tones = sum(np.sin(2 * np.pi * f * t) for f in (3.1, 71.7, 233.3))
        return np.repeat(np.rint(1e6 * tones)[:, None], 3, axis=1).astype(np.int32)


def assert_same(counts: Counts, others: Counts) -> None:
    """Assert the same instants: the motion changes by up to 1.9 counts a nanosecond, in which times are kept."""
    np.testing.assert_allclose(counts, others, rtol=0, atol=5)


@contextmanager
def reading(adapter: EmulatedSlcan, clock: ScaledClock, items: list[Item]) -> Iterator[None]:
    """Read the adapter's nodes, the first of which produces SYNC; devices are d1, d2, .. by their node."""
    readers = []
    for k, node in enumerate(sorted(node.node for node in adapter.nodes if isinstance(node, EmulatedEpsonCan))):
        place = CanAddress(interface="slcan", channel=adapter.port, node=node, sync="consumer" if k else "producer")
        driver = make_driver("epson-can", place, RATE)
        readers.append(DeviceReader(f"d{node}", driver, RATE, clock, items.append))
    with running(readers):
        yield


def by_index(items: list[Item], device: str) -> dict[int, int]:
    """Return index -> count of the x axis."""
    blocks = [item for item in items if isinstance(item, Block) and item.device == device]
    return {
        int(i): int(c) for b in blocks for i, c in zip(range(b.first_index, b.end_index), b.counts[:, 0], strict=True)
    }


def events(items: list[Item], what: str) -> list[Event]:
    return [item for item in items if isinstance(item, Event) and item.topic == f"/event/{what}"]


@pytest.mark.live
def test_sync_nodes_sample_simultaneously_before_and_after_reset() -> None:
    clock = ScaledClock(speed=8.0, origin_wall=time.time_ns(), origin=START)
    nodes = [
        EmulatedEpsonCan(Motion(), clock, node=k, serial_number=k, clock_error=error)
        for k, error in ((1, 60e-6), (2, -60e-6))
    ]
    items: list[Item] = []
    with served(EmulatedSlcan(nodes)) as adapter, reading(adapter, clock, items):
        wait_for(lambda: len(items) > 24)
        nodes[1].power_cycle()
        wait_for(lambda: bool(events(items, "device_recovered")))
        n = len(items)
        wait_for(lambda: len(items) > n + 24)
    one, other = by_index(items, "d1"), by_index(items, "d2")
    common = sorted(one.keys() & other.keys())
    assert len(common) > 3000
    assert_same([one[k] for k in common], [other[k] for k in common])
    since = items.index(events(items, "device_recovered")[0])
    gap = next(event.payload for event in events(items[since:], "gap") if event.payload["device"] == "d2")
    assert gap["exact"]  # SYNC went on: what the node missed is known to the scan
    assert min(k for k in other if k >= gap["first_index"]) == gap["first_index"] + gap["missing"]
    assert {item.flags & Flag.RESTARTED for item in items if isinstance(item, Block) and item.device == "d1"} == {0}
    check_assembled(items)


def check_assembled(items: list[Item]) -> None:
    """Check that recordings hold both devices on one grid without any delay between them."""
    channels = tuple(Channel(name=name, device=name, axis=0) for name in ("d1", "d2"))
    assembler = Assembler(channels, {"d1": RATE, "d2": RATE}, window_seconds=1.0, step_seconds=1.0)
    recordings: list[Recording] = []
    for item in items:
        recordings += assembler.push(item) if isinstance(item, Block) else assembler.push_event(item)
    whole = [recording for recording in recordings if not recording.gaps]
    assert whole
    for recording in whole:
        assert_same(recording.data[:, 0] / EPSON_SCALE, recording.data[:, 1] / EPSON_SCALE)


@pytest.mark.live
def test_failure_of_sync_producer_is_reported_for_its_consumers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daq.drivers.can.epson_can._SYNC_SECONDS", 0.3)
    monkeypatch.setattr("daq.drivers.can.heartbeat.PATIENCE", 0.5)  # two beats, not four
    monkeypatch.setattr("daq.drivers.can.hub._REPLY_SECONDS", 0.2)
    clock = ScaledClock(speed=1.0, origin_wall=time.time_ns(), origin=START)
    nodes = [EmulatedEpsonCan(Motion(), clock, node=k, serial_number=k) for k in (1, 2)]
    items: list[Item] = []
    with served(EmulatedSlcan(nodes)) as adapter, reading(adapter, clock, items):
        wait_for(lambda: len(items) > 4)
        nodes[0].hang()
        wait_for(lambda: len(events(items, "device_failed")) == 2)
        nodes[0].power_cycle()
        wait_for(lambda: len(events(items, "device_recovered")) == 2)
        n = len(items)
        wait_for(lambda: len(items) > n + 4)
        second = CanAddress(interface="slcan", channel=adapter.port, node=5, sync="producer")
        with pytest.raises(DriverError, match=r"node 5: SYNC: expected one producer per bus, found .* node 1$"):
            make_driver("epson-can", second, RATE).open()
        with pytest.raises(DriverError, match=r"node 5: SYNC: expected one rate on a bus, found 500 Hz and 1000"):
            make_driver("epson-can", second, 500.0).open()
    why = {event.payload["device"]: event.payload["why"] for event in events(items, "device_failed")}
    assert why["d2"].endswith("node 2: the device is alive, but no SYNC is received: its producer has failed")
    one, other = by_index(items[n:], "d1"), by_index(items[n:], "d2")
    common = sorted(one.keys() & other.keys())
    assert common
    assert_same([one[k] for k in common], [other[k] for k in common])


@pytest.mark.parametrize(("clock", "apart"), [("SYNC of a bus 1", False), ("", True)])
def test_shared_clock_of_devices_is_stored_in_the_log(tmp_path: Path, clock: str, apart: bool) -> None:
    channels = tuple(Channel(name=name, device=name, axis=0) for name in ("d1", "d2"))
    attached = {CHANNELS: ChannelMap(channels=channels, on_grid=False).to_json()}
    writer = McapWriter(tmp_path / "log.mcap", attached)
    for first in range(7000, 12000, 200):
        counts = np.rint(1e6 * np.sin(0.3 * np.arange(first, first + 200)))[:, None].astype(np.int32)
        for late, name in enumerate(("d1", "d2")):  # the second one's frames arrive 0.4 ms after the first one's
            block = make_block(name, first, n=200, late=late * 400_000)
            writer.write(replace(block, counts=counts, clock=clock))
    writer.close()
    assert {item.clock for item in read_log(tmp_path / "log.mcap") if isinstance(item, Block)} == {clock}
    (recording,) = load_recordings(tmp_path / "log.mcap")
    inside = recording.data[100:-100]
    assert (np.abs(inside[:, 0] - inside[:, 1]).max() / np.abs(inside).max() > 0.01) == apart


def chunk(n: int, arrived: float, between: int = 0) -> Chunk:
    """Return n SYNC frames, each with some other frames after it, that have arrived by a time [s]."""
    return Chunk(can_frames([(SYNC, b""), *[(0x181, bytes(8))] * between] * n), round(arrived * 1e9))


def test_sync_numbering_continues_across_chunks_and_by_clock_after_pause() -> None:
    count = SyncCount("bus")
    assert count.count(chunk(2, 0.002, between=2), RATE).tolist() == [1, 1, 1, 2, 2, 2]
    assert count.count(Chunk(can_frames([(0x281, bytes(6))]), 3_000_000), RATE).tolist() == [2]
    assert count.count(chunk(998, 1.0), RATE)[-1] == 1000
    first = count.clock
    assert count.count(chunk(2000, 3.0), RATE)[-1] == 3000  # a host that was held up: two seconds at once
    assert count.clock == first
    assert count.count(chunk(1, 7.0), RATE).tolist() == [7000]  # 4 s without any
    assert count.clock != first
    second = count.clock
    count.restart()
    assert count.count(chunk(5, 7.1), RATE).tolist() == [7096, 7097, 7098, 7099, 7100]
    assert count.clock != second


@given(
    st.integers(0, 65535),
    st.integers(0, 2**40),
    st.lists(st.integers(1, 70_000), min_size=1, max_size=60),
    st.integers(0, 3),
)
def test_scans_are_numbered_by_sync_across_wraps_and_gaps(first: int, start: int, steps: list[int], late: int) -> None:
    passed = np.cumsum([0, *steps])
    counter = ((first + passed) % 65536).astype(np.int32)
    synced = SyncedCounter()
    np.testing.assert_array_equal(synced.numbers(counter[:1], start + passed[:1]), start + passed[:1])
    heard = start + passed[1:] - late * (np.arange(len(steps)) % 3 == 1)  # SYNC frames that did not reach the host
    np.testing.assert_array_equal(synced.numbers(counter[1:], heard), start + passed[1:])


def test_permanently_lost_sync_frames_raise_an_error() -> None:
    synced, k = SyncedCounter(), np.arange(10)
    synced.numbers(k.astype(np.int32), 100 + k)
    for _ in range(4):
        np.testing.assert_array_equal(synced.numbers(k.astype(np.int32), 97 + k), 100 + k)
    with pytest.raises(ValueError, match="its scans and SYNC are 3 apart: SYNC frames were lost"):
        synced.numbers(k.astype(np.int32), 97 + k)


def test_arbitration_sends_lowest_identifier_first() -> None:
    counts = np.arange(12, dtype=np.int32).reshape(4, 3)
    frames = synced_frames(4, [encode_scans(2, counts, 0), encode_scans(1, counts[:3], 0)])  # a node full after three
    each = [0x080, 0x181, 0x182, 0x281, 0x282]
    assert frames.ids.tolist() == [*each * 3, 0x080, 0x182, 0x282]
