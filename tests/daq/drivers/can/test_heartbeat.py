"""Heartbeats and emergencies of CAN nodes: what they report earlier than silence does."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import canopen
import numpy as np
import pytest

from daq import Block, CanAddress, DeviceReader, Event, HostClock, Item, ScaledClock, SystemClock, make_driver
from daq.drivers.can import heartbeat
from daq.drivers.can.heartbeat import HeartbeatConsumer
from daq.emulator import EmulatedEpsonCan, EmulatedSlcan, LineFaults, LineSpell
from tests.support.daq.blocks import START
from tests.support.daq.can_buses import served, wait_for
from tests.support.daq.emulated_ports import Ramp
from tests.support.daq.readers import running

OPERATIONAL, PRE_OPERATIONAL, BOOT_UP = 5, 127, 0


@dataclass
class HandTime:
    """Replaces the module `time`, set by hand."""

    now: float = 100.0

    def monotonic(self) -> float:
        return self.now


@dataclass
class ControlledNode:
    """A node that a test controls, and the events of it."""

    clock: HandTime = field(default_factory=HandTime)
    node: canopen.RemoteNode = field(
        default_factory=lambda: canopen.RemoteNode(3, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
    )

    def send(self, state: int) -> None:
        self.node.nmt.on_heartbeat(0x703, bytes([state]), 0.0)  # type: ignore[no-untyped-call]


@pytest.fixture
def controlled(monkeypatch: pytest.MonkeyPatch) -> ControlledNode:
    """Return a node whose time is set by hand."""
    found = ControlledNode()
    monkeypatch.setattr(heartbeat, "time", found.clock)
    return found


def test_pre_operational_state_is_an_error_only_after_start(controlled: ControlledNode) -> None:
    consumer = HeartbeatConsumer(controlled.node)
    controlled.send(PRE_OPERATIONAL)
    controlled.send(OPERATIONAL)
    assert consumer.trouble() == ""
    controlled.send(PRE_OPERATIONAL)
    assert consumer.trouble() == "state of its heartbeat: PRE-OPERATIONAL, expected OPERATIONAL"


def test_boot_up_between_two_checks_is_reported_as_restart(controlled: ControlledNode) -> None:
    consumer = HeartbeatConsumer(controlled.node)
    for state in (OPERATIONAL, BOOT_UP, PRE_OPERATIONAL):
        controlled.send(state)
    assert consumer.trouble() == "it has restarted: its settings are lost"


def test_heartbeats_or_scans_alone_prevent_a_timeout(controlled: ControlledNode) -> None:
    consumer = HeartbeatConsumer(controlled.node)
    for _ in range(5):
        controlled.clock.now += 0.9
        controlled.send(OPERATIONAL)
        assert consumer.trouble() == ""
    for _ in range(5):
        controlled.clock.now += 0.9
        consumer.note_scans()
        assert consumer.trouble() == ""
    assert not consumer.alive
    controlled.clock.now += 1.1
    assert consumer.trouble() == "neither heartbeat nor scan for 1 s"


def test_missing_heartbeat_is_reported_once_per_outage(controlled: ControlledNode) -> None:
    consumer, stated = HeartbeatConsumer(controlled.node), list[str]()
    for second in range(12):
        controlled.clock.now += 1.0
        if second == 5:
            controlled.send(OPERATIONAL)
        stated.append(consumer.warning())
    assert [k for k, text in enumerate(stated) if text] == [2, 8]
    assert stated[2].startswith("no heartbeat for 2 s although scans arrive: the bus is overloaded")


@contextmanager
def reading(node: EmulatedEpsonCan, items: list[Item], clock: HostClock | None = None) -> Iterator[None]:
    """Let a reader read one node."""
    with served(EmulatedSlcan([node])) as adapter:
        driver = make_driver("epson-can", CanAddress(interface="slcan", channel=adapter.port, node=node.node), 1000.0)
        reader = DeviceReader("d", driver, 1000.0, clock or SystemClock(), items.append)
        with running([reader]):
            wait_for(lambda: len(items) > 1)
            yield


def seconds_until(items: list[Item], what: str, does: Callable[[], None]) -> tuple[float, str]:
    """Return the time from an action to an event, and its content."""
    begun = time.monotonic()
    does()
    found: list[Event] = []

    def came() -> bool:
        found.extend(item for item in items if isinstance(item, Event) and item.topic == f"/event/{what}")
        return bool(found)

    wait_for(came)
    return time.monotonic() - begun, found[0].payload.get("why", found[0].payload.get("what", ""))


@pytest.mark.live
def test_lost_scans_are_counted_exactly_and_repeated_frames_are_ignored() -> None:
    clock = ScaledClock(speed=4.0, origin_wall=time.time_ns(), origin=START)
    spells = (
        LineSpell(what="lost", at=0.68, seconds=0.04),  # the counter wraps meanwhile
        LineSpell(what="repeated", at=0.9, seconds=0.02),
        LineSpell(what="cut", at=1.1, seconds=0.005),
    )
    faults = LineFaults(spells=spells, counter=2**16 - 700)
    items: list[Item] = []
    with reading(EmulatedEpsonCan(Ramp(), clock, node=3, serial_number=7, faults=faults), items, clock):
        wait_for(lambda: any(isinstance(item, Block) and item.end_index > 1400 for item in items))
    blocks = [item for item in items if isinstance(item, Block)]
    gaps = [item.payload for item in items if isinstance(item, Event) and item.topic == "/event/gap"]
    # The first scan is not taken, nor the one after a scan that is lost whole: nothing tells their halves apart.
    found = [(1 + gap["first_index"], gap["missing"], gap["exact"]) for gap in gaps]
    assert found == [(680, 41, True), (1100, 5, True)]
    k = np.concatenate([block.counts[:, 0] for block in blocks])
    np.testing.assert_array_equal(k, 1 + np.concatenate([np.arange(b.first_index, b.end_index) for b in blocks]))


@pytest.mark.live
def test_emergency_restart_and_hang_are_reported_before_silence_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(heartbeat, "PATIENCE", 0.5)  # two beats, not four
    monkeypatch.setattr("daq.drivers.can.hub._REPLY_SECONDS", 0.2)
    items: list[Item] = []
    node = EmulatedEpsonCan(Ramp(), SystemClock(), node=3, serial_number=7)
    with reading(node, items):
        _, reported = seconds_until(items, "device_warning", lambda: node.fail(0x8110))
        assert reported == "emergency 0x8110: Monitoring (register 0x01, data 0000000000)"
        seconds, why = seconds_until(items, "device_failed", node.power_cycle)
        assert why.endswith("node 3: it has restarted: its settings are lost")
        assert seconds < 1.0  # 0.1 s of a read, and a busy host; silence would take two
        wait_for(lambda: isinstance(items[-1], Event) and items[-1].topic == "/event/device_recovered")
        items.clear()
        seconds, why = seconds_until(items, "device_failed", node.hang)
        assert why.endswith("node 3: neither heartbeat nor scan for 0.5 s")
        assert seconds < 2.0  # which silence would take
