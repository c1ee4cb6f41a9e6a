"""Serial devices: how fast their frames are decoded, and how soon a pulled plug, a new one and silence are seen.

Devices are emulated in a process of their own, behind a link that points to their port as udev's do. Usage:

    python benchmarks/daq/serial_ports.py [CYCLES]
"""

import select
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from daq import Block, DeviceReader, Event, IntArray, Item, SystemClock, make_driver
from daq.emulator import EmulatedEpson, EmulatedNode, EmulatedPort
from daq.protocol import epson, node, witmotion

RATE = 1000.0
BLOCK_SECONDS = 0.01
MEGABYTES = 8
SIZES = (4096, 65536)
SEED = 1


class Noise:
    """Counts as of a sensor at rest: small, of both signs."""

    def start(self, time: int, rate: float) -> None:
        """Begin."""

    def read(self, index: int, n: int) -> IntArray:
        """Return counts (n, 3)."""
        return np.random.default_rng([SEED, index]).normal(scale=2e4, size=(n, 3)).astype(np.int32)


def streams() -> dict[str, tuple[bytes, Callable[[], Callable[[bytes], object]]]]:
    """Return protocol -> (a stream, a function that makes a decoder's feed)."""
    n = MEGABYTES * 40_000
    counts, k = Noise().read(0, n), np.arange(n)
    scans = node.NodeScans(
        counts, k.astype(np.uint32), (1000 * k % 2**32).astype(np.uint32), np.full(n, 2150, np.int16)
    )
    words = np.concatenate([counts // 40, np.full((n, 1), 2150)], axis=1).astype(np.int16)
    return {
        "epson-uart": (epson.encode_frames(counts, 0, 0), lambda: epson.BurstDecoder().feed),
        "modalwatch-node": (node.encode_scans(scans), lambda: node.NodeDecoder().feed),
        "witmotion": (
            witmotion.encode_packets(witmotion.ACCELERATION, words),
            lambda: witmotion.WitDecoder().feed,
        ),
    }


def decode_speed(stream: bytes, feed: Callable[[bytes], object], size: int) -> float:
    """Return MB/s of CPU time."""
    begin = time.process_time()
    for at in range(0, len(stream), size):
        feed(stream[at : at + size])
    return len(stream) / (time.process_time() - begin) / 1e6


def serve(kind: str, link: Path) -> None:
    """Serve a device, plugged in and out, or left alone, by lines on standard input.

    Each is answered with the time it was done.
    """

    def plugged() -> EmulatedPort:
        device: EmulatedPort = (
            EmulatedEpson(Noise(), SystemClock(), serial_number="E")
            if kind == "epson-uart"
            else EmulatedNode(Noise(), SystemClock(), serial_number="E")
        )
        link.unlink(missing_ok=True)
        link.symlink_to(device.port)
        return device

    device, served = plugged(), True
    say()
    while True:
        if served:
            device.serve()
        if select.select([sys.stdin], [], [], 1e-3)[0]:
            word = sys.stdin.readline().strip()
            if word == "unplug":
                device.close()
                link.unlink()
            elif word == "plug":
                device = plugged()
            elif word in ("hang", "go on"):
                served = word == "go on"
            else:
                return
            say()


def say() -> None:
    """Print the present time."""
    sys.stdout.write(f"{time.time_ns()}\n")
    sys.stdout.flush()


@contextmanager
def emulated(kind: str, link: Path) -> Iterator[Callable[[str], int]]:
    """Run a device in a process; the returned function sends a command and returns its time [ns UTC]."""
    command = [sys.executable, __file__, kind, str(link)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdout.readline()

        def tell(word: str) -> int:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(word + "\n")
            process.stdin.flush()
            return int(process.stdout.readline())

        yield tell
        process.kill()


class Arrivals:
    """Times of the items that were passed on."""

    def __init__(self) -> None:
        self.items: list[tuple[int, Item]] = []

    def __call__(self, item: Item) -> None:
        """Take an item."""
        self.items.append((time.time_ns(), item))

    def wait(self, since: int, what: Callable[[Item], bool]) -> int:
        """Return when something came, at or after a time [ns UTC]."""
        while True:
            for when, item in list(self.items):
                if when >= since and what(item):
                    return when
            time.sleep(0.005)


def is_lost(item: Item) -> bool:
    """Return whether a device was lost."""
    return isinstance(item, Event) and item.topic == "/event/device_failed"


def is_back(item: Item) -> bool:
    """Return whether a device was accepted again."""
    return isinstance(item, Event) and item.topic == "/event/device_recovered"


def is_data(item: Item) -> bool:
    """Return whether scans have arrived."""
    return isinstance(item, Block)


def start_up(kind: str, link: Path) -> float:
    """Return how long it takes to open a device that is there, to its first scan [ms]."""
    driver = make_driver(kind, str(link), RATE)
    begin = time.perf_counter()
    driver.open()
    while not len(driver.read().counts):
        pass
    took = time.perf_counter() - begin
    driver.close()
    return 1e3 * took


@dataclass
class Delays:
    """Measured delays of a kind of device [ms]."""

    unplugged: list[float] = field(default_factory=list)  #: until the loss is seen
    plugged: list[float] = field(default_factory=list)  #: until data are back
    silent: list[float] = field(default_factory=list)  #: until it is seen that a device that is there says nothing
    start_up: float = 0.0  #: of the device itself

    def row(self) -> str:
        """Return the cells of a table: median and worst."""
        text = [f"{np.median(v):.0f} ms ({max(v):.0f})" for v in (self.unplugged, self.silent, self.plugged)]
        return " | ".join([*text, f"{self.start_up:.0f} ms"])


def delays_of(kind: str, cycles: int) -> Delays:
    """Unplug the device and plug it in again, and let the device hang, a number of times each."""
    found = Delays()
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / "port"
        with emulated(kind, link) as tell:
            found.start_up = start_up(kind, link)
            arrivals = Arrivals()
            driver = make_driver(kind, str(link), RATE)
            reader = DeviceReader("d", driver, RATE, SystemClock(), arrivals, block_seconds=BLOCK_SECONDS)
            reader.connect()
            reader.start()
            arrivals.wait(0, is_data)
            for cycle in range(cycles):
                time.sleep(0.2)
                out = tell("unplug")
                found.unplugged.append((arrivals.wait(out - 50_000_000, is_lost) - out) / 1e6)
                arrivals.items.clear()
                time.sleep(0.3 + 0.013 * cycle)  # at another moment between two tries each time
                in_again = tell("plug")
                found.plugged.append((arrivals.wait(in_again, is_data) - in_again) / 1e6)
            for cycle in range(cycles):
                time.sleep(0.3 + 0.013 * cycle)
                hung = tell("hang")
                found.silent.append((arrivals.wait(hung, is_lost) - hung) / 1e6)
                arrivals.wait(tell("go on"), is_back)
            reader.stop()
            reader.join(5.0)
    return found


def main() -> None:
    """Print two tables."""
    print("| protocol | bytes a scan | MB/s in blocks of 4 kB | of 64 kB |\n| --- | ---: | ---: | ---: |")
    for name, (stream, make) in streams().items():
        speeds = [max(decode_speed(stream, make(), size) for _ in range(3)) for size in SIZES]
        print(f"| `{name}` | {len(stream) // (MEGABYTES * 40_000)} | {speeds[0]:.0f} | {speeds[1]:.0f} |")
    cycles = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    head = ["unplug seen after, median (worst)", "silence seen", "data after replug", "own start-up"]
    print(f"\n| driver, {cycles} times | {' | '.join(head)} |\n| --- | ---: | ---: | ---: | ---: |")
    for kind in ("epson-uart", "modalwatch-node"):
        print(f"| `{kind}` | {delays_of(kind, cycles).row()} |")


if __name__ == "__main__":
    if len(sys.argv) > 2:
        serve(sys.argv[1], Path(sys.argv[2]))
    else:
        main()
