"""A log as a device: the same scans, gaps and times again, and logs that cannot be played."""

import itertools
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq import (
    Block,
    DeviceLost,
    DeviceReader,
    DriverError,
    Event,
    IntArray,
    Item,
    LogAddress,
    ScaledClock,
    make_driver,
)
from tests.support.daq.blocks import START, make_block, write_log

SPEED = 10.0
RATE = 1000.0
PERIOD = 1_000_000  # ns


def at_time(device: str, first: int, *, shift: int = 0) -> Block:
    """Return 250 scans; the last had arrived up to 3 ms late, as it is on a busy host."""
    late = (first * 7919) % 3_000_000
    block = make_block(device, first, late=late)
    return replace(block, arrival_time=block.arrival_time + shift, scale=2e-6)


SHIFT = 4_321_000  # ns that b is later than a


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two devices for 3 s; a lacks a second from 1000 on, b begins at index 70 000 and counts on."""
    blocks = []
    for k in range(12):
        if not 4 <= k < 8:
            blocks.append(at_time("a", 250 * k))
        blocks.append(replace(at_time("b", 250 * k, shift=SHIFT), first_index=70_000 + 250 * k))
    blocks = [replace(b, arrival_index=b.end_index - 1) for b in blocks]
    return write_log(tmp_path_factory.mktemp("log") / "run.mcap", blocks)


def played(log: Path, devices: str, seconds: float) -> dict[str, list[Item]]:
    """Return the items that readers of devices pass on in some seconds of wall time."""
    clock = ScaledClock(speed=SPEED, origin_wall=time.time_ns(), origin=START)
    items: dict[str, list[Item]] = {device: [] for device in devices}
    readers = [
        DeviceReader(
            device,
            make_driver("replay", LogAddress(path=log, device=device, speed=SPEED), RATE),
            RATE,
            clock,
            items[device].append,
            silent_seconds=0.25,
        )
        for device in devices
    ]
    for reader in readers:
        reader.connect()
        reader.start()
    time.sleep(seconds)
    for reader in readers:
        reader.stop()
    for reader in readers:
        reader.join(10.0)
    return items


def blocks_of(items: list[Item]) -> list[Block]:
    return [item for item in items if isinstance(item, Block)]


def events_of(items: list[Item], what: str) -> list[dict[str, Any]]:
    return [item.payload for item in items if isinstance(item, Event) and item.topic == f"/event/{what}"]


def counts_of(items: list[Item]) -> IntArray:
    return np.concatenate([block.counts for block in blocks_of(items)])


@pytest.mark.live
def test_replayed_devices_repeat_scans_gaps_and_relative_times(log: Path) -> None:
    found = played(log, "ab", 0.6)
    for device, first in (("a", [0, 250, 500, 750, 2000, 2250, 2500, 2750]), ("b", range(0, 3000, 250))):
        expected = np.concatenate([make_block(device, k).counts for k in first])
        np.testing.assert_array_equal(counts_of(found[device]), expected)
        assert {block.scale for block in blocks_of(found[device])} == {2e-6}
        assert {block.temperature for block in blocks_of(found[device])} == {21.5}
    assert [(gap["first_index"], gap["missing"]) for gap in events_of(found["a"], "gap")] == [(1000, 1000)]
    assert events_of(found["a"], "device_open")[0] == {
        "device": "a",
        "product": "replay",
        "serial": "a",
        "log": "run.mcap",
    }
    late = {
        device: min(block.arrival_time - PERIOD * block.arrival_index for block in blocks_of(items))
        for device, items in found.items()
    }
    # Their earliest arrivals are as far apart as in the log; two reads of the clock lie between, at tenfold speed:
    # a busy machine parts them by 0.2 ms of wall time.
    assert late["b"] - late["a"] == pytest.approx(SHIFT, abs=2e6)


@pytest.mark.live
def test_replayed_device_is_lost_at_the_end_of_the_log(log: Path) -> None:
    driver = make_driver("replay", LogAddress(path=log, device="b", speed=100.0), RATE)
    driver.open()
    sizes: list[int] = []
    with pytest.raises(DeviceLost, match=r"run\.mcap device b: the log ends here"):
        sizes.extend(len(driver.read().counts) for _ in range(1000))
    assert sum(sizes) == 3000
    driver.close()
    with pytest.raises(DeviceLost, match="is not open"):
        driver.read()
    with pytest.raises(DriverError, match="cannot be played: the log has ended"):
        driver.open()


@pytest.mark.live
def test_device_loss_and_recovery_in_the_log_are_replayed(tmp_path: Path) -> None:
    """8 s at ten times real time are more than the 0.25 s that a device may be silent."""
    late = [at_time("a", first) for first in (8_000, 8_250)]
    log = write_log(tmp_path / "lost.mcap", [at_time("a", 0), at_time("a", 250), *late])
    items = played(log, "a", 1.2)["a"]
    topics = [item.topic.removeprefix("/event/") for item in items if isinstance(item, Event)]
    assert topics[:4] == ["device_open", "device_failed", "device_recovered", "gap"]
    first = [make_block("a", k).counts for k in (0, 250, 8_000, 8_250)]
    np.testing.assert_array_equal(counts_of(items), np.concatenate(first))
    blocks = blocks_of(items)
    (gap,) = events_of(items, "gap")
    assert gap["first_index"] == 500
    # after a loss indices go on by the host's clock, as with real hardware
    assert gap["missing"] == pytest.approx(7_500, abs=2_000)  # ten reads of 20 ms, at ten times real time
    assert all(a.end_index <= b.first_index for a, b in itertools.pairwise(blocks))


def other_version(folder: Path) -> Iterator[tuple[Path, str, float, str]]:
    """Yield logs that cannot be played: path, device, rate, reason."""
    good = write_log(folder / "good.mcap", [at_time("a", 0), at_time("b", 0)])
    (folder / "text.mcap").write_text("no log")
    write_log(folder / "empty.mcap", [])
    yield folder / "none.mcap", "a", RATE, r"none\.mcap: cannot be read"
    yield folder / "text.mcap", "a", RATE, r"text\.mcap: is not an MCAP log"
    yield folder / "empty.mcap", "a", RATE, "the log has no scans"
    yield good, "c", RATE, "the log has no scan of this device; there are a, b"
    yield good, "a", 500.0, "rate: expected 500 Hz, found 1000"
    yield folder, "a", RATE, "the folder holds 3 logs: name one of them"


def test_unplayable_log_gives_one_line_error_naming_the_log(tmp_path: Path) -> None:
    for path, device, rate, why in other_version(tmp_path):
        driver = make_driver("replay", LogAddress(path=path, device=device), rate)
        with pytest.raises(DriverError, match=f"{path} device {device}: cannot be played: .*{why}") as error:
            driver.open()
        assert "\n" not in str(error.value)


def test_invalid_rate_speed_or_address_is_refused(log: Path) -> None:
    for rate, speed, name in ((0.0, 1.0, "rate"), (1.0, -1.0, "speed")):
        with pytest.raises(ValueError, match=f"{name} of .*run.mcap device a: expected a positive number"):
            make_driver("replay", LogAddress(path=log, device="a", speed=speed), rate)
    with pytest.raises(ValueError, match=r"driver replay: expected `log`, found `port`: run\.mcap"):
        make_driver("replay", "run.mcap", RATE)
