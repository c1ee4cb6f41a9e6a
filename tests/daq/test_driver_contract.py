"""What every driver of a serial port promises, against its emulated device in another process."""

import itertools
import json
import time

import numpy as np
import pytest
from port_helpers import Emulators, emulators

from daq import Block, DeviceLost, DeviceReader, Driver, DriverError, IntArray, Item, make_driver

pytestmark = pytest.mark.live

RATE = 1000.0
SERIAL = ("epson-uart", "modalwatch-node")


def scans_of(driver: Driver, n: int) -> tuple[IntArray, IntArray]:
    """Return counts and counters of at least n scans."""
    counts: list[IntArray] = []
    counters: list[IntArray] = []
    until = time.monotonic() + 10.0
    while sum(len(part) for part in counts) < n:
        assert time.monotonic() < until, f"not {n} scans within 10 s"
        scans = driver.read()
        assert scans.bad_bytes == 0
        assert 0 <= scans.age < 1e9
        counts.append(scans.counts)
        counters.append(scans.counter)
    return np.concatenate(counts), np.concatenate(counters)


def check_stream(driver: Driver) -> None:
    """Read a ramp: scan k is (k, -k, 3 k), and the counter goes on with it."""
    counts, counter = scans_of(driver, 200)
    assert counts.dtype == counter.dtype == np.int32
    k = counts[0, 0] + np.arange(len(counts), dtype=np.int32)
    np.testing.assert_array_equal(counts, np.stack([k, -k, 3 * k], axis=1))
    np.testing.assert_array_equal(np.remainder(np.diff(counter.astype(np.int64)), driver.modulus), 1)
    assert 0 < driver.scale < 1e-3


def check_blocks(driver: Driver, found: Emulators) -> None:
    """Let a reader cut the stream into blocks."""
    items: list[Item] = []
    reader = DeviceReader("d", driver, RATE, found.clock, items.append, block_seconds=0.05)
    reader.connect()
    reader.start()
    until = time.monotonic() + 10.0
    while len(items) < 4 and time.monotonic() < until:
        time.sleep(0.01)
    reader.stop()
    reader.join(10.0)
    blocks = [item for item in items[1:] if isinstance(item, Block)]
    assert len(blocks) == len(items) - 1 >= 3
    assert {block.scale for block in blocks} == {driver.scale}
    assert blocks[0].first_index == 0
    assert all(a.end_index == b.first_index for a, b in itertools.pairwise(blocks))


def check_life(found: Emulators, name: str) -> None:
    """Open, read, be alone at the port, close, open again, be unplugged."""
    port = found.ports[0]
    driver, other = (make_driver(name, port, RATE) for _ in range(2))
    identity = driver.open()
    assert identity == json.loads(json.dumps(identity))
    assert identity["serial"] == "E0000000"
    check_stream(driver)
    with pytest.raises(DriverError, match=port):
        other.open()
    driver.close()
    driver.close()
    with pytest.raises(DeviceLost, match=f"{port}: is not open"):
        driver.read()
    assert driver.open() == identity
    check_stream(driver)
    driver.close()
    check_blocks(driver, found)
    driver.open()
    found.unplug(0)
    with pytest.raises(DeviceLost, match=port):
        scans_of(driver, 100_000)
    driver.close()


@pytest.mark.parametrize("name", SERIAL)
def test_driver_keeps_the_contract(name: str) -> None:
    with emulators(1, kind=name) as found:
        check_life(found, name)


@pytest.mark.parametrize("name", SERIAL)
def test_port_that_is_not_there_is_named(name: str) -> None:
    with pytest.raises(DriverError, match=r"/dev/none: no .* answers: .*No such file"):
        make_driver(name, "/dev/none", RATE).open()


@pytest.mark.parametrize("name", SERIAL)
@pytest.mark.parametrize("rate", [0.0, -1000.0, float("nan")])
def test_rate_that_is_none_is_refused(name: str, rate: float) -> None:
    with pytest.raises(ValueError, match="rate of /dev/none: expected "):
        make_driver(name, "/dev/none", rate)
