"""The driver of DBC sensors, and the emulated one in another process behind a pty."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest

from daq import (
    Block,
    CanAddress,
    DbcAddress,
    DeviceReader,
    DriverError,
    Event,
    Flag,
    HostClock,
    Item,
    SystemClock,
    make_driver,
)
from daq.drivers import CanPlace
from daq.drivers.can.bus import SlcanBus
from daq.emulator import EmulatedDbc, EmulatedSlcan
from tests.support.daq.can_buses import can_process, pty, served, wait_for
from tests.support.daq.emulated_can import imu
from tests.support.daq.emulated_ports import Ramp
from tests.support.daq.readers import running

pytestmark = pytest.mark.live

FILE = Path(__file__).parents[4] / "examples" / "imu.dbc"
RATE = 1000.0


@contextmanager
def reading(places: dict[str, CanPlace], clock: HostClock, items: list[Item]) -> Iterator[None]:
    """Connect and run a reader for each driver name and place."""
    readers = [
        DeviceReader(driver, make_driver(driver, place, RATE), RATE, clock, items.append)
        for driver, place in places.items()
    ]
    with running(readers):
        yield


def on(channel: str) -> DbcAddress:
    return DbcAddress(interface="slcan", channel=channel, sensor=imu(FILE))


def blocks_of(items: list[Item], device: str = "can-dbc") -> list[Block]:
    return [item for item in items if isinstance(item, Block) and item.device == device]


def events_of(items: list[Item], what: str) -> list[dict[str, Any]]:
    return [item.payload for item in items if isinstance(item, Event) and item.topic == f"/event/{what}"]


def assert_each_says_its_number(blocks: list[Block]) -> None:
    """Assert that scans ascend, and each has the counts of its own index, as far as 16 bits hold them."""
    index = np.concatenate([np.arange(b.first_index, b.end_index) for b in blocks])
    assert (np.diff(index) > 0).all()
    counts = np.concatenate([b.counts for b in blocks])
    k = index + counts[0, 0] - index[0]  # the first one's index is 0, whatever the sensor has counted by then
    np.testing.assert_array_equal(counts, np.clip(np.stack([k, -k, 3 * k], axis=1), -32768, 32767))


def test_dbc_sensor_and_node_share_bus_and_recover_from_unplugging(tmp_path: Path) -> None:
    items: list[Item] = []
    with can_process(tmp_path, 1, dbc=(str(FILE), "0", "0")) as found:
        node = CanAddress(interface="slcan", channel=found.channel, node=1)
        with reading({"can-dbc": on(found.channel), "epson-can": node}, found.clock, items):
            wait_for(lambda: len(blocks_of(items)) >= 3 and len(blocks_of(items, "epson-can")) >= 2)
            with pytest.raises(DriverError, match=r"identifier 0x6 is read already, by slcan:.* accX$"):
                make_driver("can-dbc", on(found.channel), RATE).open()
            found.say("unplug")
            wait_for(lambda: len(events_of(items, "device_failed")) == 2)
            lossless = list(items)
            found.say("plug")
            wait_for(lambda: any(block.flags & Flag.RESTARTED for block in blocks_of(items)))
    assert not events_of(lossless, "gap")
    blocks = blocks_of(lossless)
    assert_each_says_its_number(blocks)
    assert all(not b.flags & (Flag.AFTER_GAP | Flag.BAD_FRAMES) for b in blocks)
    assert blocks[0].scale == 2**-8
    assert events_of(items, "device_open")[0] == {
        "device": "can-dbc",
        "product": "imu",
        "messages": "GroupCounter 0x6, Acceleration 0x34",
    }


def test_lost_and_repeated_frames_give_exact_gaps(tmp_path: Path) -> None:
    items: list[Item] = []
    with can_process(tmp_path, 0, speed=4, dbc=(str(FILE), "0.01", "0.02")) as found:
        with reading({"can-dbc": on(found.channel)}, found.clock, items):
            wait_for(lambda: bool(blocks_of(items)) and blocks_of(items)[-1].end_index > 1500)
        found.end()
    blocks = blocks_of(items)
    assert_each_says_its_number(blocks)
    gaps = events_of(items, "gap")
    missing = blocks[-1].end_index - sum(block.n_scans for block in blocks)
    assert sum(gap["missing"] for gap in gaps) == missing
    assert all(gap["exact"] for gap in gaps)
    # one frame in a hundred is lost of two a scan: 2 % of scans, and at most as many beside them
    assert 0.01 < missing / blocks[-1].end_index < 0.06


def test_frames_of_emulated_sensor_are_decoded_by_cantools() -> None:
    database = cantools.database.load_file(FILE)
    assert isinstance(database, cantools.database.Database)
    sensor = EmulatedDbc(Ramp(), SystemClock(), imu(FILE), rate=RATE)
    found: list[Any] = []
    with served(EmulatedSlcan([sensor])) as adapter, SlcanBus(adapter.port) as bus:
        while len(found) < 200:
            message = bus.recv(5.0)
            assert message is not None
            found.append(database.decode_message(message.arbitration_id, bytes(message.data)))
    start = next(k for k, values in enumerate(found) if "Counter" in values)
    for counter, values in zip(found[start:-1:2], found[start + 1 :: 2], strict=False):
        k = counter["Counter"]
        assert values == {"accX": k / 256, "accY": -k / 256, "accZ": min(3 * k, 32767) / 256}


def test_silent_sensor_raises_error_naming_the_missing_message() -> None:
    with (
        pty() as (_, port),
        pytest.raises(DriverError, match=f"slcan:{port} accX: no scan within 1 s: no frame of Group"),
    ):
        make_driver("can-dbc", on(port), RATE).open()


def test_invalid_rate_or_address_is_refused() -> None:
    with pytest.raises(ValueError, match="rate of slcan:x accX: expected a positive number of Hz, found 0"):
        make_driver("can-dbc", on("x"), 0.0)
    with pytest.raises(ValueError, match="driver can-dbc: expected `can` and `dbc`, found `port`: /dev/ttyS0"):
        make_driver("can-dbc", "/dev/ttyS0", RATE)
