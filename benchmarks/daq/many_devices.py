"""Cost of recording: 32 serial devices of three axes at 1000 scans per second, to the disk.

Another process emulates the devices on ptys and hands their bytes on every ten milliseconds, between the one and the
sixteen of USB adapters. This one records them as `modalwatch run` does (readers, writer, disk guard; no analysis) and
states its own CPU time, system calls included, as a share of one core: other work on the machine does not count.

Usage: python benchmarks/daq/many_devices.py [SECONDS] [DRIVER] [VIEW_RATE], or make bench-many-devices
"""

import json
import os
import select
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from daq import Block, DeviceReader, IntArray, SystemClock, make_driver, read_log
from daq.emulator import EmulatedEpson, EmulatedNode, LineFaults, serve_all, unplugging
from daq.log import DiskGuard, ResilientWriter, Retention, RotatingWriter, WriterThread, newest_log
from monitor.settings import RecorderSettings

N_DEVICES, RATE, SECONDS = 32, 1000.0, 600.0
_TURN = 0.01  # s
_NOISE, _SEED = 72.0, 1  # counts rms of an M-A352


class Noise:
    """A second of a sensor's own noise, again and again."""

    def __init__(self, seed: int) -> None:
        self._scans = np.rint(np.random.default_rng(seed).normal(0, _NOISE, (1000, 3))).astype(np.int32)

    def start(self, time: int, rate: float) -> None:
        """Begin."""

    def read(self, index: int, n: int) -> IntArray:
        """Return counts (n, 3)."""
        return np.take(self._scans, np.arange(index, index + n), axis=0, mode="wrap")


def serve(kind: str) -> None:
    """Emulate devices until standard input ends; then print the number of scans without room."""
    clock, faults = SystemClock(), LineFaults(latency=_TURN)
    make = {"epson-uart": EmulatedEpson, "modalwatch-node": EmulatedNode}[kind]
    devices = [make(Noise(_SEED + k), clock, serial_number=f"E{k:07}", faults=faults) for k in range(N_DEVICES)]
    with unplugging(devices):
        print(json.dumps([device.port for device in devices]), flush=True)
        turn = 0
        while not select.select([sys.stdin], [], [], _TURN)[0]:
            serve_all(devices, turn := turn + 1)
        print(json.dumps(sum(device.dropped for device in devices)), flush=True)


@contextmanager
def emulated(kind: str) -> Iterator[tuple[list[str], Callable[[], int]]]:
    """Emulate devices in a process; return their ports, and a function that ends them."""
    command = [sys.executable, __file__, "serve", kind]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None

        def end() -> int:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.close()
            return int(process.stdout.readline())

        yield json.loads(process.stdout.readline()), end
        process.kill()


def record(folder: Path, kind: str, ports: Sequence[str], seconds: float, view_rate: float) -> float:
    """Record for so long; return the share of a core that it took."""
    clock = SystemClock()
    recorder = RotatingWriter(folder, {}, clock.now(), view_rate=view_rate)
    keeper = ResilientWriter(recorder, DiskGuard(folder, Retention()), _ignore)
    with WriterThread(keeper, _ignore, chunk_seconds=RecorderSettings().chunk_seconds) as log, ExitStack() as stack:
        for k, port in enumerate(ports):
            reader = DeviceReader(f"d{k}", make_driver(kind, port, RATE), RATE, clock, log.put)
            reader.connect()
            reader.start()
            stack.callback(reader.join)
            stack.callback(reader.stop)
        begun, cpu = time.monotonic(), time.process_time()
        time.sleep(seconds)
        return (time.process_time() - cpu) / (time.monotonic() - begun)


def _ignore(_: object) -> None:
    """Nothing analyses here."""


def missing(folder: Path) -> tuple[int, int]:
    """Return how many scans are in the log, and how many are missing amid."""
    scans, ends, gaps = 0, dict[str, int](), 0
    for item in read_log(newest_log(folder)):
        if isinstance(item, Block):
            gaps += item.first_index - ends.get(item.device, item.first_index)
            ends[item.device] = item.end_index
            scans += item.n_scans
    return scans, gaps


def memory() -> float:
    """Return the memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> None:
    """Measure, and print a row."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    kind = sys.argv[2] if len(sys.argv) > 2 else "epson-uart"
    view_rate = float(sys.argv[3]) if len(sys.argv) > 3 else 0.0
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as name, emulated(kind) as (ports, end):
        share = record(Path(name), kind, ports, seconds, view_rate)
        held, dropped = memory(), end()
        scans, gaps = missing(Path(name))
        size = sum(path.stat().st_size for path in Path(name).glob("*.mcap"))
    print("| driver | view [Hz] | seconds | scans | missing | no room | of a core | RSS [MB] | bytes a scan |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    row = (f"`{kind}`", f"{view_rate:g}", f"{seconds:g}", scans, gaps, dropped, f"{100 * share:.1f} %", f"{held:.0f}")
    print("| " + " | ".join(map(str, (*row, f"{size / scans:.2f}"))) + " |")


if __name__ == "__main__":
    if sys.argv[1:2] == ["serve"]:
        serve(sys.argv[2])
    else:
        main()
