"""Driver against emulator, two processes, real bytes on ptys."""

import os
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq import Block, DeviceReader, DriverError, Event, Flag, Item, make_driver
from tests.support.daq.ports import Emulators, emulators
from tests.support.daq.readers import running

pytestmark = pytest.mark.live

RATE = 1000.0


@contextmanager
def reading(found: Emulators, items: list[Item]) -> Iterator[list[DeviceReader]]:
    """Connect and run a reader a port; devices are d0, d1, ..."""
    readers = [
        DeviceReader(f"d{k}", make_driver("epson-uart", port, RATE), RATE, found.clock, items.append)
        for k, port in enumerate(found.ports)
    ]
    with running(readers):
        yield readers


def blocks_of(items: list[Item], device: str) -> list[Block]:
    return [item for item in items if isinstance(item, Block) and item.device == device]


def events_of(items: list[Item], what: str) -> list[dict[str, Any]]:
    return [item.payload for item in items if isinstance(item, Event) and item.topic == f"/event/{what}"]


def wait_for(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"not within {seconds} s"
        time.sleep(0.02)


def assert_continuous(blocks: list[Block]) -> None:
    """Assert that every scan from the first on is there, with the counts of its index."""
    index = np.concatenate([np.arange(b.first_index, b.end_index) for b in blocks])
    np.testing.assert_array_equal(index, np.arange(len(index)))
    k = index.astype(np.int32)
    np.testing.assert_array_equal(np.concatenate([b.counts for b in blocks]), np.stack([k, -k, 3 * k], axis=1))


def test_six_devices_at_tenfold_speed_lose_no_scans() -> None:
    items: list[Item] = []
    with emulators(6, speed=10) as found:
        with reading(found, items):
            time.sleep(2.0)
        dropped = found.end()["dropped"]
    assert dropped == [0] * 6
    assert not events_of(items, "gap")
    assert not events_of(items, "device_failed")
    for k in range(6):
        blocks = blocks_of(items, f"d{k}")
        assert_continuous(blocks)
        assert blocks[-1].end_index > 15_000  # 20 s of data, but for starting and stopping
        assert all(not b.flags & (Flag.AFTER_GAP | Flag.BAD_FRAMES) for b in blocks)
        assert all(b.temperature == pytest.approx(21.0, abs=0.002) for b in blocks)
    assert events_of(items, "device_open") == [
        {"device": f"d{k}", "product": "A352AD10", "serial": f"E{k:07}", "version": "0100", "filter_delay": 0.063875}
        for k in range(6)
    ]


def test_arrival_delays_vary_by_less_than_100_ms() -> None:
    items: list[Item] = []
    with emulators(1) as found, reading(found, items):
        time.sleep(1.5)
    blocks = blocks_of(items, "d0")
    late = np.array([b.arrival_time - b.arrival_index * 1_000_000 for b in blocks])
    assert len(blocks) >= 4
    # The first scan's time is not known here, but all were taken by one clock: the spread is the reading alone.
    assert np.ptp(late) < 100e6  # ns; the process slept that long only if the machine is far overloaded


def test_unplugged_device_fails_and_other_devices_continue() -> None:
    items: list[Item] = []
    with emulators(3) as found:
        with reading(found, items):
            wait_for(lambda: len(blocks_of(items, "d1")) >= 2)
            found.unplug(1)
            wait_for(lambda: bool(events_of(items, "device_failed")))
            n = len(items)
            wait_for(lambda: len([i for i in items[n:] if isinstance(i, Block)]) >= 6)
        dropped = found.end()["dropped"]
    (lost,) = events_of(items, "device_failed")
    assert lost["device"] == "d1"
    assert found.ports[1] in lost["why"]
    assert {i.device for i in items[n:] if isinstance(i, Block)} == {"d0", "d2"}
    for device in ("d0", "d1", "d2"):
        assert_continuous(blocks_of(items, device))
    assert dropped[0] == dropped[2] == 0


@contextmanager
def answering(reply: bytes) -> Iterator[str]:
    """Give a port where something answers every command with the same bytes."""
    with ExitStack() as stack:
        master, slave = os.openpty()
        tty.setraw(slave)
        ending = threading.Event()

        def serve() -> None:
            os.set_blocking(master, False)
            while not ending.wait(0.005):
                with suppress(BlockingIOError):
                    if os.read(master, 256) and reply:
                        os.write(master, reply)

        thread = threading.Thread(target=serve)
        stack.callback(os.close, slave)
        stack.callback(os.close, master)
        stack.callback(thread.join)
        stack.callback(ending.set)
        thread.start()
        yield os.ttyname(slave)


@pytest.mark.parametrize(
    ("reply", "why"),
    [
        (b"", "expected 4 bytes 4c .. .. 0d, found ''"),
        (b"\x4c\x12\x34\x0d", "identity: expected 0x5345, found 0x1234"),
        (b"OK\r\n", "expected 4 bytes 4c"),
    ],
    ids=["silence", "other identity", "modem"],
)
def test_wrong_device_raises_error_naming_the_port(reply: bytes, why: str) -> None:
    with answering(reply) as port:
        driver = make_driver("epson-uart", port, RATE)
        with pytest.raises(DriverError, match=why) as found:
            driver.open()
        assert found.value.port == port
        assert str(found.value).startswith(f"{port}: no M-A352 answers: ")


def test_missing_port_raises_error_naming_the_port() -> None:
    with pytest.raises(DriverError, match=r"/dev/none: no M-A352 answers: .*No such file"):
        make_driver("epson-uart", "/dev/none", RATE).open()


def test_port_in_use_by_another_driver_is_an_error(tmp_path: Path) -> None:
    with emulators(1) as found:
        first, second = (make_driver("epson-uart", found.ports[0], RATE) for _ in range(2))
        first.open()
        with pytest.raises(DriverError, match="no M-A352 answers"):
            second.open()
        assert len(first.read().counts) > 0
        first.close()


def test_unsupported_rate_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected one of \[50, 100, 200, 500, 1000\] Hz, found 250"):
        make_driver("epson-uart", "/dev/none", 250.0)


def test_unknown_driver_name_is_refused() -> None:
    with pytest.raises(ValueError, match=r"driver: expected one of can-dbc, epson-can, epson-uart.*, found 'epsom'"):
        make_driver("epsom", "/dev/none", RATE)
