"""An M-A552's temperature: known from the first scan on, followed while it samples, of no harm where there is none."""

import math
from itertools import pairwise

import pytest

from daq import Block, CanAddress, DeviceReader, Item, SystemClock, make_driver
from daq.drivers.can import epson_can
from daq.emulator import EmulatedEpsonCan, EmulatedSlcan
from tests.support.daq.can_buses import served, wait_for
from tests.support.daq.emulated_ports import Ramp
from tests.support.daq.readers import running

pytestmark = pytest.mark.live


def blocks(items: list[Item]) -> list[Block]:
    return [item for item in items if isinstance(item, Block)]


def test_temperature_is_updated_from_first_block_without_lost_scans(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(epson_can, "PERIOD", 0.1)
    node = EmulatedEpsonCan(Ramp(), SystemClock(), node=3, serial_number=7, temperature=21.0)
    without = EmulatedEpsonCan(Ramp(), SystemClock(), node=4, serial_number=8, temperature=None)
    items: dict[int, list[Item]] = {3: [], 4: []}
    with served(EmulatedSlcan([node, without])) as adapter:
        readers = [
            DeviceReader(
                f"d{number}",
                make_driver("epson-can", CanAddress(interface="slcan", channel=adapter.port, node=number), 1000.0),
                1000.0,
                SystemClock(),
                items[number].append,
            )
            for number in items
        ]
        with running(readers):
            wait_for(lambda: len(blocks(items[3])) > 1)
            node.warm_to(-30.0)
            wait_for(lambda: blocks(items[3])[-1].temperature < 0)
            node.warm_to(85.0)
            wait_for(lambda: blocks(items[3])[-1].temperature > 80)
    reported = [block.temperature for block in blocks(items[3])]
    assert reported[0] == pytest.approx(21.0, abs=0.002)  # half a count
    assert min(reported) == pytest.approx(-30.0, abs=0.002)
    assert reported[-1] == pytest.approx(85.0, abs=0.002)
    assert all(math.isnan(block.temperature) for block in blocks(items[4]))
    for read in items.values():
        assert all(a.end_index == b.first_index for a, b in pairwise(blocks(read)))


def test_temperature_is_read_again_after_device_recovery(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(epson_can, "PERIOD", 0.1)
    node = EmulatedEpsonCan(Ramp(), SystemClock(), node=3, serial_number=7, temperature=10.0)
    items: list[Item] = []
    with served(EmulatedSlcan([node])) as adapter:
        address = CanAddress(interface="slcan", channel=adapter.port, node=3)
        reader = DeviceReader("d", make_driver("epson-can", address, 1000.0), 1000.0, SystemClock(), items.append)
        with running([reader]):
            wait_for(lambda: bool(blocks(items)))
            node.power_cycle()
            node.warm_to(12.0)
            wait_for(lambda: blocks(items)[-1].temperature == pytest.approx(12.0, abs=0.002))
            node.warm_to(14.0)
            wait_for(lambda: blocks(items)[-1].temperature == pytest.approx(14.0, abs=0.002))
