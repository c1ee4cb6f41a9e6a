"""Common behaviour of all drivers: blocks, gaps, restarts; with a scripted device and a clock that it moves."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from daq import Block, DeviceIdentity, DeviceLost, DeviceReader, DriverError, Event, Flag, Item, Scans
from tests.support.daq.blocks import START, HandClock

pytestmark = pytest.mark.live

RATE = 1000.0


Step = tuple[float, range | None]  #: (s of data that pass, counters that arrive; None: the device goes)


@dataclass
class ScriptedDriver:
    """A device that follows a list, and then stops the reader."""

    clock: HandClock
    script: list[Step]
    modulus: int = 1 << 16
    scale: float = 0.5
    bad: dict[int, int] = field(default_factory=dict)
    opened: int = 0
    refusals: int = 0
    strangers: int = 0  #: other devices that answer at the port before this one is back
    stumbles: bool = False  #: it raises what no driver should where the device goes, and when it is opened again
    reader: DeviceReader | None = None
    step: int = 0

    def open(self) -> DeviceIdentity:
        self.opened += 1
        if self.stumbles and self.opened == 2:
            raise KeyError("a register that nobody knows")
        if 1 < self.opened <= 1 + self.refusals:
            raise DriverError("port", "nobody there")
        if 1 < self.opened <= 1 + self.strangers:
            return DeviceIdentity(product="P", serial="S2")
        return DeviceIdentity(product="P", serial="S1")

    def read(self) -> Scans:
        if self.step == len(self.script):
            assert self.reader is not None
            self.reader.stop()
            return self._scans(range(0))
        seconds, counters = self.script[self.step]
        self.step += 1
        self.clock.time += round(seconds * 1e9)
        if counters is None and self.stumbles:
            raise ValueError("a field that is no number")
        if counters is None:
            raise DeviceLost("port", "gone")
        return self._scans(counters)

    def _scans(self, counters: range) -> Scans:
        counter = np.array(counters, np.int32)
        counts = np.stack([counter, -counter, counter * 7], axis=1) if len(counter) else np.empty((0, 3), np.int32)
        return Scans(counts, counter % self.modulus, 20.0, self.bad.get(self.step, 0))

    def close(self) -> None:
        return


def played(
    script: list[Step], refusals: int = 0, bad: dict[int, int] | None = None, strangers: int = 0, speed: float = 1000.0
) -> list[Item]:
    """Return the items that a reader passes on."""
    clock, items = HandClock(speed=speed), list[Item]()
    driver = ScriptedDriver(clock, script, refusals=refusals, bad=bad or {}, strangers=strangers)
    reader = driver.reader = DeviceReader("beam", driver, RATE, clock, items.append, block_seconds=0.25)
    reader.connect()
    reader.run()
    return items


def blocks_of(items: list[Item]) -> list[Block]:
    return [item for item in items if isinstance(item, Block)]


def events_of(items: list[Item], what: str) -> list[dict[str, Any]]:
    return [item.payload for item in items if isinstance(item, Event) and item.topic == f"/event/{what}"]


def steady(first: int, n: int, size: int = 50) -> list[Step]:
    """Return reads of `size` scans each, as fast as they are taken."""
    return [(size / RATE, range(k, k + size)) for k in range(first, first + n, size)]


def test_steady_stream_gives_full_blocks_across_counter_wraps() -> None:
    blocks = blocks_of(played(steady(0, 140_000)))
    assert [b.first_index for b in blocks] == list(range(0, 140_000, 250))
    assert {b.n_scans for b in blocks} == {250}
    assert {b.flags for b in blocks} == {Flag.NONE}
    counts = np.concatenate([b.counts for b in blocks])
    np.testing.assert_array_equal(counts[:, 0], np.arange(140_000))
    assert {b.arrival_time - b.arrival_index * 1_000_000 for b in blocks} == {START + 1_000_000}


def test_device_identity_is_the_first_event() -> None:
    first = played(steady(0, 50))[0]
    assert isinstance(first, Event)
    assert (first.topic, first.payload) == ("/event/device_open", {"device": "beam", "product": "P", "serial": "S1"})


@pytest.mark.parametrize("missing", [1, 37, 5_000, 65_535, 65_537, 200_003])
def test_gap_length_is_exact(missing: int) -> None:
    script = steady(0, 1000)
    script.append(((missing + 50) / RATE, range(1000 + missing, 1050 + missing)))
    script += steady(1050 + missing, 950)
    items = played(script)
    blocks = blocks_of(items)
    assert [b.first_index for b in blocks if b.flags & Flag.AFTER_GAP] == [1000 + missing]
    for block in blocks:
        np.testing.assert_array_equal(block.counts[:, 0], np.arange(block.first_index, block.end_index))
    assert [(g["first_index"], g["missing"], g["exact"]) for g in events_of(items, "gap")] == [(1000, missing, True)]


def test_gap_inside_a_read_splits_the_block() -> None:
    script: list[Step] = [*steady(0, 500), (0.1, range(500, 600, 3))]
    blocks = blocks_of(played(script))
    index = np.concatenate([np.arange(b.first_index, b.end_index) for b in blocks])
    assert index.tolist() == [*range(500), *range(500, 600, 3)]
    on_time = START + 1_000_000
    assert all(
        b.arrival_time - b.arrival_index * 1_000_000 >= on_time for b in blocks
    )  # none arrives before it is taken


def test_scans_buffered_by_the_kernel_survive_host_stall() -> None:
    # 40 s pass unread; what arrives first was kept by the kernel and goes on without a gap
    script = [*steady(0, 1000), (40.0, range(1000, 1170)), (0.05, range(41_000, 41_050)), *steady(41_050, 950)]
    items = played(script)
    index = np.concatenate([np.arange(b.first_index, b.end_index) for b in blocks_of(items)])
    assert index.tolist() == [*range(1170), *range(41_000, 42_000)]
    assert [(g["first_index"], g["missing"]) for g in events_of(items, "gap")] == [(1170, 39_830)]


def test_block_arrival_time_is_unaffected_by_late_reads() -> None:
    script: list[Step] = [(0.05, range(50)), (0.08, range(50, 100)), (0.02, range(100, 150)), *steady(150, 100)]
    (block,) = blocks_of(played(script))
    assert block.arrival_time - block.arrival_index * 1_000_000 == START + 1_000_000


def test_damaged_bytes_are_flagged_on_their_block() -> None:
    blocks = blocks_of(played(steady(0, 1000), bad={8: 24}))  # the 8th read holds scans 350 to 399
    assert [b.first_index for b in blocks if b.flags & Flag.BAD_FRAMES] == [250]


@pytest.mark.parametrize("counter", [0, 7, 65_530])
def test_recovered_device_continues_with_new_index_origin(counter: int) -> None:
    script = [*steady(0, 400), (0.5, None), *steady(counter, 600)]
    items = played(script, refusals=1)
    blocks = blocks_of(items)
    topics = [item.topic for item in items if isinstance(item, Event) and item.topic != "/event/gap"]
    assert topics == ["/event/device_open", "/event/device_failed", "/event/device_recovered"]
    assert [b.n_scans for b in blocks if b.first_index < 400] == [250, 150]  # the open block is handed on
    after = [b for b in blocks if b.first_index >= 400]
    assert [bool(b.flags & Flag.RESTARTED) for b in after] == [True, False, False]
    assert all(not b.flags & Flag.RESTARTED for b in blocks if b.first_index < 400)
    first = after[0].first_index
    assert first == pytest.approx(900, abs=2)  # 0.5 s without scans, by the host's clock
    np.testing.assert_array_equal(np.concatenate([b.counts for b in after])[:, 0], np.arange(counter, counter + 600))
    assert [b.first_index for b in after] == [first, first + 250, first + 500]
    (gap,) = events_of(items, "gap")
    assert (gap["first_index"], gap["exact"]) == (400, False)


def test_driver_exception_is_handled_as_temporary_device_loss() -> None:
    """A thread that ends with an error of the program would be silent for good."""
    clock, items = HandClock(speed=1000.0), list[Item]()
    script: list[Step] = [(0.25, range(250)), (0.25, None), (0.25, range(250)), (0.25, range(250, 500))]
    driver = ScriptedDriver(clock, script, stumbles=True)
    reader = driver.reader = DeviceReader("beam", driver, RATE, clock, items.append, block_seconds=0.25)
    reader.connect()
    reader.start()
    reader.join(5.0)
    events = [item for item in items if isinstance(item, Event)]
    assert [event.topic for event in events[:3]] == [
        "/event/device_open",
        "/event/device_failed",
        "/event/device_recovered",
    ]
    assert events[1].payload["why"] == "ValueError: a field that is no number"
    assert sum(len(item.counts) for item in items if isinstance(item, Block)) == 750


def test_silent_device_is_reported_as_failed() -> None:
    items = played([*steady(0, 400), *[(500.0, range(0))] * 5, *steady(0, 500)])
    (lost,) = events_of(items, "device_failed")
    assert lost["why"] == "beam: silent for 1.7 s"
    assert len(events_of(items, "device_recovered")) == 1


def test_different_device_at_the_port_is_not_accepted() -> None:
    """Another device responds at two attempts: reported once, none of its scans accepted; then the device is back."""
    items = played([*steady(0, 400), (0.1, None), *steady(0, 500)], strangers=2)
    (wrong,) = events_of(items, "wrong_device")
    assert wrong["found"] == {"product": "P", "serial": "S2"}
    assert len(events_of(items, "device_recovered")) == 1


def arriving(n: int, stalls: dict[int, float]) -> list[Step]:
    """Return reads of n scans each quarter of a second, for 90 s; scans that wait during a stall arrive at once, in
    pieces.

    Parameters
    ----------
    stalls : number of the read before which the host stands still -> for so long [s]
    """
    script: list[Step] = []
    owed = 0.0  # s that scans are behind
    for k in range(360):
        stall = stalls.get(k, 0.0)
        seconds = max(0.0, 0.25 - owed)
        owed = max(0.0, owed - 0.25) + stall
        script.append((seconds + stall, range(k * n, (k + 1) * n)))
    return script


@pytest.mark.parametrize("stalls", [{}, {0: 6.0}, {84: 3.0}, {0: 4.0, 90: 5.0, 200: 2.0, 300: 8.0}])
@pytest.mark.parametrize(
    ("n", "found"), [(250, None), (245, None), (255, None), (230, 920.0), (270, 1080.0), (100, 400.0), (300, 1200.0)]
)
def test_wrong_device_rate_is_reported_once(n: int, found: float | None, stalls: dict[int, float]) -> None:
    """A stall of the host for seconds neither looks like another rate nor hides one."""
    expected = [] if found is None else [{"device": "beam", "expected": RATE, "found": pytest.approx(found, rel=0.01)}]
    assert events_of(played(arriving(n, stalls), speed=1.0), "wrong_rate") == expected


def test_busy_host_is_not_reported_as_wrong_device_rate() -> None:
    """Each read is three seconds late for half a minute, amid which a part of 20 s lies."""
    script: list[Step] = [(0.25 + 3.0 * (k == 60), range(k * 250, (k + 1) * 250)) for k in range(180)]
    script[180:] = [(0.25 * (k >= 192), range(k * 250, (k + 1) * 250)) for k in range(180, 400)]
    assert events_of(played(script, speed=1.0), "wrong_rate") == []
