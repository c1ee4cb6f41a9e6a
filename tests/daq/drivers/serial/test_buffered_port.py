"""Large reads of a port: nothing is lost or late by them, and a port that goes is seen at once."""

import os
import threading
import time
import tty
from collections.abc import Iterator

import pytest

from daq.drivers.serial.buffered_port import BufferedPort

pytestmark = pytest.mark.live

GATHERED = 0.19  # s
WAITING = 2600  # bytes that may wait in a port
SEEN_SECONDS = 0.1  # a tenth is promised half of; the rest is for a host with other work


@pytest.fixture
def pty() -> Iterator[tuple[int, int]]:
    """Give both ends of a port; the device's is closed by the test."""
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(slave, False)
    yield master, slave
    os.close(slave)


def send(master: int, seconds: float, step: float, size: int) -> threading.Thread:
    """Send numbered bytes from a thread, which then unplugs the port."""

    def run() -> None:
        for k in range(round(seconds / step)):
            os.write(master, bytes([k % 256]) * size)
            time.sleep(step)
        os.close(master)

    thread = threading.Thread(target=run)
    thread.start()
    return thread


def read_all(bites: BufferedPort) -> list[bytes]:
    """Return reads until the port is gone."""
    reads = []
    while True:
        try:
            reads.append(bites.read(0.1))
        except OSError:
            return reads


def test_fast_bytes_are_batched_and_closed_port_is_detected_promptly(pty: tuple[int, int]) -> None:
    master, slave = pty
    thread = send(master, 0.6, 0.01, 240)
    reads = read_all(BufferedPort(slave, most_seconds=GATHERED, least_rate=500.0))
    seen = time.monotonic()
    thread.join()
    sent, found = b"".join(bytes([k]) * 240 for k in range(60)), b"".join(reads)
    assert sent.startswith(found)
    assert len(sent) - len(found) < 2 * WAITING  # with the port goes what waits in it; twice for a busy host
    assert len([data for data in reads if data]) < 20  # of 60 that were sent
    assert time.monotonic() - seen < SEEN_SECONDS


def test_slow_bytes_are_read_on_arrival(pty: tuple[int, int]) -> None:
    master, slave = pty
    thread = send(master, 0.3, 0.03, 8)
    reads = read_all(BufferedPort(slave, most_seconds=GATHERED, least_rate=500.0))
    thread.join()
    assert len([data for data in reads if data]) > 7  # of ten; a busy host may find two at once


def test_arrival_time_excludes_waiting_for_more_bytes(pty: tuple[int, int]) -> None:
    master, slave = pty
    bites = BufferedPort(slave, most_seconds=GATHERED, least_rate=500.0)
    time.sleep(0.02)
    os.write(master, bytes(240))
    bites.read(1.0)  # 12 kB/s: the next ones gather
    os.write(master, bytes(240))
    sent = time.perf_counter_ns()
    bites.read(0.5)  # what gathers, and then nothing
    os.close(master)
    assert bites.arrived - sent < 0.25e9
