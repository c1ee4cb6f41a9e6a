"""The driver of CAN nodes: another process behind a pty, and a bus that python-can opens."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest

from daq import Block, CanAddress, DeviceReader, DriverError, Event, Flag, HostClock, Item, SystemClock, make_driver
from daq.drivers.can.bus import frames_of, messages_of
from daq.emulator import EmulatedEpsonCan
from daq.protocol.frames import can_frames
from tests.support.daq.can_buses import can_process, pty, serving, wait_for
from tests.support.daq.emulated_ports import Ramp
from tests.support.daq.readers import running

pytestmark = pytest.mark.live

RATE = 1000.0


@contextmanager
def reading(addresses: list[CanAddress], clock: HostClock, items: list[Item]) -> Iterator[None]:
    """Connect and run a reader a node; devices are d0, d1, ..."""
    readers = [
        DeviceReader(f"d{k}", make_driver("epson-can", address, RATE), RATE, clock, items.append)
        for k, address in enumerate(addresses)
    ]
    with running(readers):
        yield


def on(channel: str, n: int) -> list[CanAddress]:
    return [CanAddress(interface="slcan", channel=channel, node=1 + k) for k in range(n)]


def blocks_of(items: list[Item], device: str) -> list[Block]:
    return [item for item in items if isinstance(item, Block) and item.device == device]


def events_of(items: list[Item], what: str) -> list[dict[str, Any]]:
    return [item.payload for item in items if isinstance(item, Event) and item.topic == f"/event/{what}"]


def assert_continuous(blocks: list[Block]) -> None:
    """Assert that no scan is missing and each has its number, counted from the second: the first is not taken."""
    index = np.concatenate([np.arange(b.first_index, b.end_index) for b in blocks])
    np.testing.assert_array_equal(index, index[0] + np.arange(len(index)))
    k = (1 + np.arange(len(index))).astype(np.int32)
    np.testing.assert_array_equal(np.concatenate([b.counts for b in blocks]), np.stack([k, -k, 3 * k], axis=1))


def test_two_nodes_at_tenfold_speed_lose_no_scans(tmp_path: Path) -> None:
    items: list[Item] = []
    with can_process(tmp_path, 2, speed=10) as found:
        with reading(on(found.channel, 2), found.clock, items):
            wait_for(lambda: len(blocks_of(items, "d1")) >= 80)  # 20 s of data
        report = found.end()
    assert report["dropped"] == [0, 0]
    for k in range(2):
        blocks = blocks_of(items, f"d{k}")
        assert_continuous(blocks)
        assert all(not b.flags & (Flag.AFTER_GAP | Flag.BAD_FRAMES) for b in blocks)
        assert 0 < report["sent"][k] - blocks[-1].end_index < 5000  # under way when the reader stopped
    assert not events_of(items, "gap")
    assert events_of(items, "device_open") == [
        {
            "device": f"d{k}",
            "product": "A552",
            "hardware": "AC10",
            "version": "1.00",
            "serial": str(100 + k),
            "filter_delay": 0.063875,
        }
        for k in range(2)
    ]


def test_unplugged_adapter_fails_all_nodes_and_all_recover(tmp_path: Path) -> None:
    items: list[Item] = []
    with can_process(tmp_path, 2) as found, reading(on(found.channel, 2), found.clock, items):
        wait_for(lambda: all(blocks_of(items, name) for name in ("d0", "d1")))
        found.say("unplug")
        wait_for(lambda: len(events_of(items, "device_failed")) == 2)
        found.say("plug")
        wait_for(lambda: len(events_of(items, "device_recovered")) == 2)
        n = len(items)
        wait_for(lambda: all(blocks_of(items[n:], name) for name in ("d0", "d1")))
    assert {event["device"] for event in events_of(items, "device_failed")} == {"d0", "d1"}
    assert all("the bus is not available" in event["why"] for event in events_of(items, "device_failed"))
    for name in ("d0", "d1"):
        blocks = blocks_of(items, name)
        again = next(k for k, block in enumerate(blocks) if block.flags & Flag.RESTARTED)
        assert_continuous(blocks[:again])
        assert_continuous(blocks[again:])


@contextmanager
def virtual_bus(channel: str, node: EmulatedEpsonCan) -> Iterator[None]:
    """Put a node on python-can's virtual bus of this process."""
    with can.Bus(interface="virtual", channel=channel) as bus:

        def serve() -> None:
            while (message := bus.recv(0)) is not None:
                for can_id, data in frames_of([message]):
                    for answer in messages_of(can_frames(node.receive(can_id, data)), 0.0):
                        bus.send(answer)
            for message in messages_of(node.scans(1000), 0.0):
                bus.send(message)

        with serving(serve):
            yield


def test_node_is_read_over_another_python_can_interface() -> None:
    items: list[Item] = []
    node = EmulatedEpsonCan(Ramp(), SystemClock(), node=9, serial_number=7)
    address = CanAddress(interface="virtual", channel="test", node=9)
    with virtual_bus("test", node), reading([address], SystemClock(), items):
        wait_for(lambda: len(blocks_of(items, "d0")) >= 4)
    assert_continuous(blocks_of(items, "d0"))
    assert events_of(items, "device_open")[0]["serial"] == "7"


def test_unreachable_node_raises_error_naming_bus_and_node(tmp_path: Path) -> None:
    with pty() as (_, port):
        driver = make_driver("epson-can", CanAddress(interface="slcan", channel=port, node=5), RATE)
        with pytest.raises(DriverError, match=f"slcan:{port} node 5: no M-A552 answers: No SDO response"):
            driver.open()
    with pytest.raises(
        DriverError, match=r"^slcan:/dev/none node 1: the bus cannot be opened: No such file or directory$"
    ):
        make_driver("epson-can", on("/dev/none", 1)[0], RATE).open()
    bad = CanAddress(interface="slcann", channel="x", node=1)
    with pytest.raises(DriverError, match="slcann:x node 1: the bus cannot be opened"):
        make_driver("epson-can", bad, RATE).open()


@pytest.mark.parametrize("interface", sorted({*can.interfaces.BACKENDS} - {"virtual", "udp_multicast"}))
def test_missing_adapter_raises_driver_error_for_every_can_backend(interface: str) -> None:
    address = CanAddress(interface=interface, channel="modalwatch-99", node=1)
    with pytest.raises(DriverError, match=f"^{interface}:modalwatch-99 node 1: the bus cannot be opened: "):
        make_driver("epson-can", address, RATE).open()
    with pytest.raises(DriverError, match=f"^{interface}:99 node 1: the bus cannot be opened: "):
        make_driver("epson-can", CanAddress(interface=interface, channel="99", node=1), RATE).open()


def test_second_reader_of_node_or_second_bit_rate_is_refused(tmp_path: Path) -> None:
    with can_process(tmp_path, 2) as found:
        address = on(found.channel, 1)[0]
        first, second = (make_driver("epson-can", address, RATE) for _ in range(2))
        first.open()
        with pytest.raises(DriverError, match=r"node 1: identifier 0x181 is read already, by slcan:.* node 1$"):
            second.open()
        slow = CanAddress(interface="slcan", channel=found.channel, node=2, bitrate=500_000)
        with pytest.raises(DriverError, match="node 2: the bus is open at 1000000 bit/s, expected 500000"):
            make_driver("epson-can", slow, RATE).open()
        first.close()
        second.open()  # the bus was closed and is opened again
        second.close()


def test_invalid_rate_address_or_node_number_is_refused() -> None:
    address = on("x", 1)[0]
    with pytest.raises(ValueError, match=r"rate of slcan:x node 1: expected one of \[50, 100, 200, 500, 1000\] Hz"):
        make_driver("epson-can", address, 300.0)
    with pytest.raises(ValueError, match="driver epson-can: expected `can`, found `port`: /dev/ttyS0"):
        make_driver("epson-can", "/dev/ttyS0", RATE)
    with pytest.raises(ValueError, match="driver epson-uart: expected `port`, found `can`: slcan:x node 1"):
        make_driver("epson-uart", address, RATE)
    with pytest.raises(ValueError, match="node: expected 1 to 127, found 128"):
        CanAddress(interface="slcan", channel="x", node=128)
