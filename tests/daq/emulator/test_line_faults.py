"""Serial devices on poor lines: babble, wrong and lost bytes, an adapter that hands on every 16 ms."""

import os
import select
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from daq import (
    Block,
    DeviceReader,
    DriverError,
    Event,
    Flag,
    HostClock,
    IndexArray,
    Item,
    ScaledClock,
    SystemClock,
    make_driver,
)
from daq.drivers import LineFormat, TextAddress
from daq.emulator import EmulatedEpson, EmulatedNode, EmulatedTextLines, LineFaults, LineSpell
from daq.emulator.serial_port import SerialEmulator
from daq.emulator.serving import FaultyLine
from daq.protocol import epson
from tests.support.daq.blocks import START
from tests.support.daq.can_buses import serving, wait_for
from tests.support.daq.emulated_ports import Ramp
from tests.support.daq.readers import running

RATE = 1000.0
POOR = LineFaults(flipped=2e-3, lost=1e-3, babble=500, latency=0.016, seed=3)

LINES = LineFormat(columns=("counter", "x", "y", "z"), unit="g")

KINDS: dict[str, Callable[[HostClock, LineFaults], SerialEmulator]] = {
    "epson-uart": lambda clock, faults: EmulatedEpson(Ramp(), clock, serial_number="E", faults=faults),
    "modalwatch-node": lambda clock, faults: EmulatedNode(Ramp(), clock, serial_number="E", faults=faults),
    "serial-text": lambda clock, faults: EmulatedTextLines(Ramp(), clock, LINES, rate=RATE, faults=faults),
}


@pytest.mark.live
@pytest.mark.parametrize("name", ["epson-uart", "modalwatch-node"])
def test_poor_line_loses_damaged_frames_and_gives_no_false_scans(name: str) -> None:
    device = KINDS[name](SystemClock(), POOR)  # which harms one frame in fourteen
    with serving(device.serve):
        driver = make_driver(name, device.port, RATE)
        driver.open()
        reads = [driver.read()]
        while sum(len(scans.counts) for scans in reads) < 400:
            reads.append(driver.read())
        harmed = device.line.harmed
        driver.close()
    device.close()
    counts = np.concatenate([scans.counts for scans in reads])
    counter = np.concatenate([scans.counter for scans in reads])
    k = counts[:, 0]
    np.testing.assert_array_equal(counts, np.stack([k, -k, 3 * k], axis=1))
    np.testing.assert_array_equal(np.diff(counter), np.diff(k))
    missing = int(k[-1] - k[0]) + 1 - len(k)
    assert 0 < missing <= 2 * harmed  # a lost end of a frame takes the next one with it
    assert sum(scans.bad_bytes for scans in reads) > 20 * missing
    # Handed on every 16 ms, not byte by byte: reads bring many scans, unless the machine was held up.
    assert np.median([len(scans.counts) for scans in reads if len(scans.counts)]) >= 10


def test_share_of_damaged_bytes_equals_the_stated_share() -> None:
    line, n = FaultyLine(LineFaults(flipped=0.01, lost=0.02, seed=1)), 100_000
    arrived = line.carried(bytes(n))
    # five deviations of binomial counts: 0.02 n, and 0.01 n of those that arrive
    assert n - len(arrived) == pytest.approx(2000, abs=5 * 45)
    assert len(arrived) - arrived.count(0) == pytest.approx(980, abs=5 * 32)
    assert line.harmed == pytest.approx(2980, abs=5 * 55)


@contextmanager
def reading(name: str, device: SerialEmulator, clock: HostClock) -> Iterator[list[Item]]:
    """Let a reader read a device that is served."""
    items: list[Item] = []
    with serving(device.serve):
        place = TextAddress(port=device.port, form=LINES) if name == "serial-text" else device.port
        driver = make_driver(name, place, RATE)
        reader = DeviceReader("d", driver, RATE, clock, items.append, block_seconds=0.02)
        with running([reader]):
            yield items
    device.close()


def blocks_of(items: list[Item]) -> list[Block]:
    return [item for item in items if isinstance(item, Block)]


def _indices(block: Block) -> IndexArray:
    return np.arange(block.first_index, block.end_index)


def payloads(items: list[Item], what: str) -> list[dict[str, Any]]:
    return [item.payload for item in items if isinstance(item, Event) and item.topic == f"/event/{what}"]


@pytest.mark.live
@pytest.mark.parametrize(
    ("name", "modulus", "glued"), [("epson-uart", 2**16, 0), ("modalwatch-node", 2**31, 1), ("serial-text", 2**31, 1)]
)
def test_line_losses_give_exact_gaps_and_repeated_frames_are_ignored(name: str, modulus: int, glued: int) -> None:
    clock = ScaledClock(speed=4.0, origin_wall=time.time_ns(), origin=START)
    spells = (
        LineSpell(what="lost", at=0.68, seconds=0.04),  # the counter wraps meanwhile
        LineSpell(what="repeated", at=0.9, seconds=0.02),
        LineSpell(what="cut", at=1.1, seconds=0.005),
        LineSpell(what="silent", at=1.3, seconds=0.3),
    )
    faults = LineFaults(spells=spells, counter=modulus - 700)
    device = KINDS[name](clock, faults)
    with reading(name, device, clock) as items:
        wait_for(lambda: bool(blocks := blocks_of(items)) and blocks[-1].end_index > 2000)
    blocks = blocks_of(items)
    k, index = np.concatenate([b.counts[:, 0] for b in blocks]), np.concatenate([_indices(b) for b in blocks])
    began = int(k[0])  # what was on its way while the host still asked who is there was not taken
    gaps = [(began + int(gap["first_index"]), gap["missing"], gap["exact"]) for gap in payloads(items, "gap")]
    # The frame after a cut one has no delimiter before it, if frames end with one.
    assert gaps == [(680, 40, True), (1100, 5 + glued, True), (1300, 300, True)]
    assert device.line.missing == 345
    assert not payloads(items, "device_failed")
    np.testing.assert_array_equal(k, began + index)
    assert np.all(np.diff(index) > 0)
    damaged = [began + block.first_index for block in blocks if block.flags & Flag.BAD_FRAMES]
    assert any(600 < first <= 1106 for first in damaged)  # the block that was being read


class Spoilt(EmulatedNode):
    """A node whose first hello is lost among the output at power-on."""

    def say(self, data: bytes) -> None:
        self.reported = getattr(self, "reported", 0) + 1
        super().say(data if self.reported > 1 else b"\x55" + data[1:])


@pytest.mark.live
def test_hello_request_is_repeated_after_damaged_hello(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daq.drivers.serial.node._AGAIN_SECONDS", 0.05)
    device = Spoilt(Ramp(), SystemClock(), serial_number="E")
    with serving(device.serve):
        driver = make_driver("modalwatch-node", device.port, RATE)
        assert driver.open().serial == "E"
        driver.close()
    device.close()


@pytest.mark.live
def test_silent_device_sends_and_receives_nothing() -> None:
    device = KINDS["epson-uart"](SystemClock(), LineFaults(spells=(LineSpell(what="silent", at=0.0, seconds=100.0),)))
    line = os.open(device.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    os.write(line, epson.read_register(epson.ID))
    assert answered(device, line)  # it is dead from its first scan on
    os.write(line, epson.write_register(epson.MODE_CTRL, epson.MODE_SAMPLING))
    while device.sampling_since is None:
        device.serve()
    os.write(line, epson.write_register(epson.MODE_CTRL, epson.MODE_CONFIG) + epson.read_register(epson.ID))
    assert not answered(device, line)
    assert device.sampling_since is not None
    assert device.line.missing > 0
    os.close(line)
    device.close()


def answered(device: SerialEmulator, line: int) -> bool:
    """Serve for a while, and return whether any bytes arrived."""
    for _ in range(50):
        device.serve()
        if select.select([line], [], [], 2e-3)[0]:
            return bool(os.read(line, 64))
    return False


@pytest.mark.live
def test_device_at_wrong_baud_rate_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("daq.drivers.serial.epson_uart._REPLY_SECONDS", 0.1)
    device = KINDS["epson-uart"](SystemClock(), LineFaults(baud=115_200))
    with (
        serving(device.serve),
        pytest.raises(DriverError, match=r"no M-A352 answers: answer of register 0x4c: expected 4"),
    ):
        make_driver("epson-uart", device.port, RATE).open()
    device.close()


@pytest.mark.parametrize(
    "wrong", [{"flipped": -0.1}, {"lost": 1.5}, {"babble": -1}, {"latency": -1.0}, {"counter": -1}]
)
def test_invalid_line_faults_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(wrong))}.*: expected "):
        LineFaults(**wrong)  # type: ignore[arg-type]


def test_invalid_fault_intervals_are_refused() -> None:
    with pytest.raises(ValueError, match="what: expected lost, repeated, cut or silent, found 'dull'"):
        LineSpell(what="dull", at=0.0, seconds=1.0)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="at, seconds: expected a time and a length, found 1, 0"):
        LineSpell(what="lost", at=1.0, seconds=0.0)
