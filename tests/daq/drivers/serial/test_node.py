"""The driver of home-built nodes: refused and accepted scans, and nodes that restart."""

import itertools
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from daq import DeviceLost, Driver, DriverError, SystemClock, make_driver
from daq.drivers.serial.node import FrameValidator
from daq.emulator import EmulatedNode
from daq.protocol import node
from daq.protocol.node import NodeScans
from tests.support.daq.can_buses import serving
from tests.support.daq.emulated_ports import Ramp
from tests.support.daq.node_frames import some_scans, values


@contextmanager
def plugged(device: EmulatedNode) -> Iterator[EmulatedNode]:
    with serving(device.serve):
        yield device
    device.close()


def driver_of(device: EmulatedNode, rate: float = 1000.0) -> Driver:
    return make_driver("modalwatch-node", device.port, rate)


class Wrong(EmulatedNode):
    """A node that announces one thing and does another."""

    def __init__(self, hello: node.Hello, rate: float) -> None:
        super().__init__(Ramp(), SystemClock(), serial_number="W")
        self._hello, self._own = hello, rate

    def receive(self, data: bytes) -> None:
        if self._own > 0 and self.sampling_since is None:
            self.start(self._own)
        self.say(node.encode_hello(self._hello))

    def encode(self, counts: np.ndarray[tuple[int, ...], np.dtype[np.int32]], first: int) -> bytes:
        k = first + np.arange(len(counts))
        time = (k * (1e6 / self._own)).astype(np.uint32)
        return node.encode_scans(NodeScans(counts, k.astype(np.uint32), time, np.zeros(len(k), np.int16)))


GOOD = {"product": "p", "serial": "W", "axes": (0,), "scale": 1e-5, "rate": 1000.0}


@pytest.mark.live
@pytest.mark.parametrize(
    ("reported", "rate", "why"),
    [
        ({"version": 2}, 1000.0, "protocol: expected version 1, found 2"),
        ({"scale": 0.0}, 1000.0, "hello: expected a scale and an axis, found Hello"),
        ({"scale": float("nan")}, 1000.0, "hello: expected a scale"),
        ({"axes": ()}, 1000.0, "hello: expected a scale and an axis"),
        ({"rate": 800.0}, 1000.0, "rate: expected 1000 Hz, found 800"),
        ({}, 500.0, "rate: expected 1000 Hz, found 500 by the node's own clock"),
    ],
)
def test_node_with_invalid_hello_or_rate_is_refused(reported: dict[str, object], rate: float, why: str) -> None:
    hello = node.Hello(**{**GOOD, **reported})  # type: ignore[arg-type]
    with plugged(Wrong(hello, rate)) as device:
        driver = driver_of(device)
        with pytest.raises(DriverError, match=f"{device.port}: no node answers: {why}"):
            driver.open()


@pytest.mark.live
def test_node_without_command_input_and_temperature_sensor_is_read() -> None:
    device = EmulatedNode(Ramp(), SystemClock(), serial_number="deaf", rate=500.0, axes=(2,), temperature=None)
    with plugged(device):
        driver = driver_of(device, 500.0)
        identity = driver.open()
        assert (identity.product, identity.serial, identity.details["axes"]) == ("emulated", "deaf", [2])
        scans = driver.read()
        assert np.isnan(scans.temperature)
        driver.close()


def read_for_a_while(driver: Driver) -> None:
    for _ in range(1000):
        driver.read()


@pytest.mark.live
def test_restarted_node_is_lost_and_can_be_reopened() -> None:
    device = EmulatedNode(Ramp(), SystemClock(), serial_number="N")
    restart = threading.Event()

    def serve() -> None:
        if restart.is_set():
            restart.clear()
            device.stop()
            device.start(1000.0)
        device.serve()

    with serving(serve):
        driver = driver_of(device)
        identity = driver.open()
        restart.set()
        with pytest.raises(DeviceLost, match="the node has started anew"):
            read_for_a_while(driver)
        driver.close()
        assert driver.open() == identity
        driver.close()
    device.close()


def fed(believer: FrameValidator, scans: NodeScans, cuts: list[int]) -> tuple[list[tuple[int, ...]], int]:
    """Return the accepted scans of a stream in pieces, and the number of those that are refused."""
    edges = [0, *cuts, len(scans.counter)]
    pairs = [believer.evaluate(scans[a:b]) for a, b in itertools.pairwise(edges)]
    return [value for scans, _ in pairs for value in values(scans)], sum(refused for _, refused in pairs)


@pytest.mark.parametrize("seed", range(5))
def test_frame_validator_drops_only_false_scans(seed: int) -> None:
    """False ones have counters and clocks drawn anew, as damage that a CRC lets pass makes them."""
    random = np.random.default_rng([seed, 71])
    scans = some_scans(seed, 400)
    false = np.sort(random.choice(np.arange(1, 130), 20, replace=False) * 3)  # true ones between have a neighbour
    for words in (scans.counter, scans.time):
        words[false] = random.integers(0, 2**32, len(false), np.uint32)
    true = np.setdiff1d(np.arange(400), false)
    expected = [value for k, value in enumerate(values(scans)) if k in set(true.tolist())]
    for n_cuts in (0, 10, 100):
        cuts = sorted(random.integers(0, 400, n_cuts).tolist())
        found, refused = fed(believer := FrameValidator(1000.0), scans, cuts)
        assert (found, refused) == (expected, len(false))
        assert not believer.restarted


def test_frame_validator_accepts_gaps_of_any_length() -> None:
    parts = [some_scans(1, 5, first=first) for first in (10, 1000, 2**31, 2**32 + 5)]
    scans = node.joined(node.joined(parts[0], parts[1]), node.joined(parts[2], parts[3]))
    found, refused = fed(believer := FrameValidator(1000.0), scans, list(range(1, 20)))
    assert (found, refused) == (values(scans), 0)
    assert not believer.restarted


def test_single_scan_is_held_until_the_next_scan_arrives() -> None:
    scans, believer = some_scans(1, 3), FrameValidator(1000.0)
    assert values(believer.evaluate(scans[:1])[0]) == []
    assert values(believer.evaluate(node.NO_SCANS)[0]) == []
    assert values(believer.evaluate(scans[1:])[0]) == values(scans)
