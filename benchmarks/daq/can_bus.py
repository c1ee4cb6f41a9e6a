"""CAN frames per second that our SLCAN bus takes from a port, compared with python-can's own.

A process writes scans of emulated nodes into a pty. In the first table it writes as fast as they are taken, so that the
reader sets the pace; the ratio is of alternating turns, so that other load on the machine affects both, and the median
of three. In the second it writes at the pace of nodes with 1000 scans per second, and scans without room are lost, as
with hardware; a pty holds less than 0.1 s of them.

Usage: python benchmarks/daq/can_bus.py, or make bench-daq-speed
"""

import os
import statistics
import subprocess
import sys
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import can
import numpy as np

from daq.drivers.can.bus import SlcanBus
from daq.protocol.epson_can import encode_scans
from daq.protocol.slcan import encode

TURNS = 3
PACES = 8000, 40_000  # frames/s of four nodes; of the demo's two, ten times as fast as life
PACED_SECONDS = 3.0
_STEP = 0.002  # s between writes at that pace
_SCANS = np.arange(300, dtype=np.int32).reshape(-1, 3) * 65_537


def write(port: int, n_frames: int, pace: int) -> None:
    """Write frames; a pace of 0 is as fast as they are taken."""
    lines = [line + b"\r" for line in encode(encode_scans(1, _SCANS, 0)).split(b"\r")[:-1]]
    if pace:
        write_paced(port, lines, n_frames, pace)
    else:
        _write_all(port, b"".join(lines[k % len(lines)] for k in range(n_frames)))


def _write_all(port: int, data: bytes) -> None:
    while data:
        data = data[os.write(port, data[: 1 << 16]) :]


def write_paced(port: int, lines: list[bytes], n_frames: int, pace: int) -> None:
    """Write frames when they are due; of those that find no room the first is ended later, the others are lost."""
    os.set_blocking(port, False)
    begun, sent, rest = time.monotonic(), 0, b""
    while sent < n_frames:
        time.sleep(_STEP)
        due = min(n_frames, int((time.monotonic() - begun) * pace))
        for k in range(sent, due):
            rest = rest or lines[k % len(lines)]
            with suppress(BlockingIOError):
                rest = rest[os.write(port, rest) :]
        sent = due
    os.set_blocking(port, True)
    _write_all(port, rest)


@contextmanager
def writing(
    n_frames: int, pace: int, script: str = __file__
) -> Iterator[tuple[str, Callable[[], subprocess.Popen[bytes]]]]:
    """Return a port, and a function that starts a process writing to it."""
    master, slave = os.openpty()
    tty.setraw(slave)

    def start() -> subprocess.Popen[bytes]:
        command = [sys.executable, script, "write", str(master), str(n_frames), str(pace)]
        return subprocess.Popen(command, pass_fds=[master])

    try:
        yield os.ttyname(slave), start
    finally:
        os.close(slave)
        os.close(master)


def blocks(bus: can.BusABC) -> int:
    """Take a block of frames; return how many."""
    assert isinstance(bus, SlcanBus)
    return len(bus.recv_frames(1.0))


def messages(bus: can.BusABC) -> int:
    """Take one message; return how many."""
    return int(bus.recv(1.0) is not None)


def open_ours(port: str) -> can.BusABC:
    """Open our bus."""
    return SlcanBus(port)


def open_theirs(port: str) -> can.BusABC:
    """Open python-can's."""
    return can.Bus(interface="slcan", channel=port, bitrate=1_000_000, sleep_after_open=0)


Open = Callable[[str], can.BusABC]
Take = Callable[[can.BusABC], int]
READERS: dict[str, tuple[Open, Take, int]] = {
    "python-can's `slcan`": (open_theirs, messages, 10_000),
    "ours, as a python-can bus": (open_ours, messages, 100_000),
    "ours, in blocks": (open_ours, blocks, 400_000),
}


def taken(open_bus: Open, take: Take, n_frames: int, pace: int) -> tuple[int, float, float]:
    """Return frames taken, seconds from the first to the last, and share of a core meanwhile."""
    with writing(n_frames, pace) as (port, start), open_bus(port) as bus, start() as process:
        n = take(bus)
        begun, cpu = time.monotonic(), time.process_time()
        last = begun
        while n < n_frames and (found := take(bus)):
            n, last = n + found, time.monotonic()
        used = (time.process_time() - cpu) / (time.monotonic() - begun)
        process.kill()  # it may wait for a reader that has gone deaf
    return n, last - begun, used


def fast() -> None:
    """Print the table of the largest rates that readers take."""
    rates: dict[str, list[float]] = {name: [] for name in READERS}
    for _ in range(TURNS):
        for name, (open_bus, take, n_frames) in READERS.items():
            n, seconds, _ = taken(open_bus, take, n_frames, 0)
            if n != n_frames:
                raise SystemExit(f"{name}: {n} of {n_frames} frames")
            rates[name].append(n / seconds)
    print("| bus | frames per second | times python-can's |\n| --- | ---: | ---: |")
    first = rates[next(iter(READERS))]
    for name, found in rates.items():
        ratio = statistics.median(a / b for a, b in zip(found, first, strict=True))
        print(f"| {name} | {statistics.median(found):.0f} | {ratio:.1f} |")


def paced() -> None:
    """Print the table of the losses of readers and their cost."""
    print("\n| bus |" + "".join(f" lost of {pace} frames/s | of a core |" for pace in PACES))
    print("| --- |" + " ---: | ---: |" * len(PACES))
    for name, (open_bus, take, _) in READERS.items():
        row = f"| {name} |"
        for n_frames, pace in ((int(pace * PACED_SECONDS), pace) for pace in PACES):
            n, _, used = taken(open_bus, take, n_frames, pace)
            row += f" {100 * (n_frames - n) / n_frames:.1f} % | {100 * used:.0f} % |"
        print(row)


if __name__ == "__main__":
    if sys.argv[1:2] == ["write"]:
        write(*(int(word) for word in sys.argv[2:]))
    else:
        fast()
        paced()
