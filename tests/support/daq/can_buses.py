"""Ports and buses that tests of CAN share."""

import json
import os
import select
import subprocess
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from daq import ScaledClock
from daq.emulator import EmulatedSlcan
from tests.support.daq.blocks import START
from tests.support.processes import script_process

SCRIPT = Path(__file__).parent / "emulated_can.py"
IMU = Path(__file__).parents[3] / "examples" / "imu.dbc"
#: of one sensor that IMU describes, on the bus PORT
DBC_SITE = """structure = "t_structure.toml"
[[device]]
name = "beam_left"
driver = "can-dbc"
can = {interface = "slcan", channel = "PORT"}
dbc = {file = "imu.dbc", signals = {x = "accX", y = "accY", z = "accZ"}, counter = "Counter"}
rate = 1000
channels = {y = "beam_left_y", z = "beam_left_z"}
"""


@contextmanager
def pty() -> Iterator[tuple[int, str]]:
    """Give the device's side of a pty as a descriptor, and the path of the host's side."""
    master, slave = os.openpty()
    tty.setraw(slave)
    try:
        yield master, os.ttyname(slave)
    finally:
        os.close(slave)
        os.close(master)


def read(line: int, size: int) -> bytes:
    """Read a number of bytes: a pty passes on written bytes with any delay."""
    found = b""
    while len(found) < size and select.select([line], [], [], 5.0)[0]:
        found += os.read(line, size - len(found))
    return found


@contextmanager
def serving(serve: Callable[[], None]) -> Iterator[None]:
    """Serve from a thread."""
    stop = threading.Event()

    def run() -> None:
        while not stop.wait(0.002):
            serve()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


@contextmanager
def served(adapter: EmulatedSlcan) -> Iterator[EmulatedSlcan]:
    """Serve an adapter from a thread, and unplug it at the end."""
    with serving(adapter.serve):
        yield adapter
    adapter.close()


def wait_for(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"not within {seconds} s"
        time.sleep(0.02)


@dataclass(frozen=True)
class CanProcess:
    """An adapter and its nodes in another process."""

    process: subprocess.Popen[str]
    clock: ScaledClock
    channel: str

    def say(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def end(self) -> dict[str, list[int]]:
        """Stop it; return scans sent and dropped."""
        self.say("end")
        assert self.process.stdout is not None
        found: dict[str, list[int]] = json.loads(self.process.stdout.readline())
        return found


@contextmanager
def can_process(folder: Path, n: int, speed: int = 1, dbc: tuple[str, ...] = ()) -> Iterator[CanProcess]:
    """Run an adapter with n nodes, and the sensor of `dbc` (emulated_can.py); it is gone afterwards."""
    clock = ScaledClock(speed=speed, origin_wall=time.time_ns(), origin=START)
    link = folder / "adapter"
    with script_process(SCRIPT, link, n, speed, clock.origin_wall, clock.origin, *dbc) as (process, ready):
        assert ready == '"ready"\n'
        yield CanProcess(process, clock, str(link))
