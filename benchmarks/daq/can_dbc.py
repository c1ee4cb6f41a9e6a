"""Cost of sensors described by a DBC file, compared with cantools' own decoding: tables in the documentation.

Four sensors send a counter frame and an acceleration frame a scan, 1000 times a second: 8000 frames/s, a full bus of
1 Mbit/s. First decoding alone, of the same frames in memory, median of five turns one after the other. Then from a
process that writes lines of SLCAN to a pty at that pace, read by our bus, for ten seconds: by the driver, its readers
and blocks included, and by cantools a frame at a time.

Usage: python benchmarks/daq/can_dbc.py, or make bench-daq-speed
"""

import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
from cantools.database import Database, load_string

from benchmarks.daq.can_bus import write_paced, writing
from daq import Block, DbcAddress, DbcSensor, DeviceReader, Event, Item, SystemClock, make_driver
from daq.drivers import read_layout
from daq.drivers.can.bus import SlcanBus
from daq.protocol.can_scan import ScanDecoder, ScanLayout, encode_scans
from daq.protocol.frames import CanFrames
from daq.protocol.slcan import encode

SENSORS, RATE, SECONDS, TURNS = 4, 1000, 10.0, 5
PACE = 2 * SENSORS * RATE  # frames/s
_DECODED = 40_000  # frames a turn
_MESSAGES = """
BO_ {counter} Counter{k}: 2 N
 SG_ n{k} : 7|16@0+ (1,0) [0|65535] "" N
BO_ {acceleration} Acceleration{k}: 6 N
 SG_ x{k} : 7|16@0- (0.00390625,0) [0|0] "m/s^2" N
 SG_ y{k} : 23|16@0- (0.00390625,0) [0|0] "m/s^2" N
 SG_ z{k} : 39|16@0- (0.00390625,0) [0|0] "m/s^2" N
"""


@contextmanager
def described() -> Iterator[list[DbcSensor]]:
    """Give the sensors, and their file for as long."""
    parts = [_MESSAGES.format(k=k, counter=6 + 64 * k, acceleration=52 + 64 * k) for k in range(SENSORS)]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "four.dbc"
        file.write_text('VERSION ""\nBU_: N\n' + "".join(parts))
        yield [DbcSensor(file=file, signals=(f"x{k}", f"y{k}", f"z{k}"), counter=f"n{k}") for k in range(SENSORS)]


def sent(layouts: list[ScanLayout], n_frames: int) -> CanFrames:
    """Return frames of all sensors, scan by scan; each contains the number of its scan."""
    n = n_frames // (2 * SENSORS)
    counts = np.random.default_rng(0).integers(-(2**15), 2**15, (n, 3)).astype(np.int32)
    streams = [encode_scans(layout, counts, 0) for layout in layouts]
    order = np.arange(2 * n * SENSORS).reshape(SENSORS, n, 2).transpose(1, 0, 2).ravel()
    return CanFrames(*(np.concatenate([getattr(s, name) for s in streams])[order] for name in ("ids", "dlc", "data")))


def write(port: int, n_frames: int, pace: int) -> None:
    """Write frames at that pace."""
    with described() as sensors:
        frames = sent([read_layout(sensor) for sensor in sensors], n_frames)
    write_paced(port, [line + b"\r" for line in encode(frames).split(b"\r")[:-1]], n_frames, pace)


def ours(layouts: list[ScanLayout], frames: CanFrames, block: int) -> float:
    """Decode frames in blocks; return CPU seconds."""
    decoders = [ScanDecoder(layout) for layout in layouts]
    begun, found = time.process_time(), 0
    for start in range(0, len(frames), block):
        part = frames[start : start + block]
        for layout, decoder in zip(layouts, decoders, strict=True):
            own = part[np.isin(part.ids, layout.identifiers)]
            found += len(decoder.feed(own, np.zeros(len(own), np.intp)).counts)
    used = time.process_time() - begun
    if found < len(frames) // 2 - SENSORS:
        raise SystemExit(f"{found} scans of {len(frames) // 2}")
    return used


def theirs(database: Database, frames: CanFrames) -> float:
    """Decode frames one by one; return CPU seconds."""
    begun = time.process_time()
    for identifier, data in frames:
        database.decode_message(identifier, data)
    return time.process_time() - begun


def parsed(file: Path) -> Database:
    """Return cantools' own of a DBC file."""
    database = load_string(file.read_text(), "dbc")
    assert isinstance(database, Database)
    return database


def decoding() -> None:
    """Print the table of decoding alone."""
    with described() as sensors:
        layouts, database = [read_layout(sensor) for sensor in sensors], parsed(sensors[0].file)
    frames = sent(layouts, _DECODED)
    ways: dict[str, Callable[[], float]] = {
        "cantools, a frame at a time": lambda: theirs(database, frames),
        "ours, 200 frames at a time (25 ms)": lambda: ours(layouts, frames, 200),
        "ours, 2000 frames at a time (0.25 s)": lambda: ours(layouts, frames, 2000),
        "ours, 40 000 frames at a time (a log)": lambda: ours(layouts, frames, _DECODED),
    }
    turns = [[way() for way in ways.values()] for _ in range(TURNS)]
    print(f"| decoding | frames/s | of a core at {PACE} frames/s | times cantools' |\n| --- | ---: | ---: | ---: |")
    for column, name in enumerate(ways):
        used = statistics.median(turn[column] for turn in turns)
        ratio = statistics.median(turn[0] / turn[column] for turn in turns)
        print(f"| {name} | {_DECODED / used:.0f} | {100 * PACE * used / _DECODED:.1f} % | {ratio:.1f} |")


def by_driver(port: str) -> tuple[float, float]:
    """Read until nothing comes; return the share of scans that are missing, and of a core."""
    items: list[Item] = []
    with SlcanBus(port) as bus:
        while not len(bus.recv_frames(1.0)):  # the other process is not ready yet
            continue
    with described() as sensors, ExitStack() as stack:
        for number, sensor in enumerate(sensors):
            driver = make_driver("can-dbc", DbcAddress(interface="slcan", channel=port, sensor=sensor), RATE)
            reader = DeviceReader(f"d{number}", driver, RATE, SystemClock(), items.append)
            reader.connect()
            reader.start()
            stack.callback(reader.join, 10.0)
            stack.callback(reader.stop)
        begun, cpu = time.monotonic(), time.process_time()
        time.sleep(SECONDS)
        used = (time.process_time() - cpu) / (time.monotonic() - begun)
    scans = sum(item.n_scans for item in items if isinstance(item, Block))
    gaps = [item for item in items if isinstance(item, Event) and item.topic == "/event/gap"]
    missing = sum(gap.payload["missing"] for gap in gaps)
    return missing / (scans + missing), used


def by_cantools(port: str) -> tuple[float, float]:
    """Decode a frame at a time; return the share of frames that are missing, and of a core."""
    with described() as sensors, SlcanBus(port) as bus:
        database = parsed(sensors[0].file)
        while not len(bus.recv_frames(1.0)):
            continue
        begun, cpu, n = time.monotonic(), time.process_time(), 0
        while (elapsed := time.monotonic() - begun) < SECONDS:
            for identifier, data in bus.recv_frames(1.0):
                database.decode_message(identifier, data)
                n += 1
        used = (time.process_time() - cpu) / elapsed
    return max(0.0, 1 - n / (PACE * elapsed)), used


def paced() -> None:
    """Print the table of a full bus."""
    print(f"\n| {PACE} frames/s for {SECONDS:g} s | missing | of a core |\n| --- | ---: | ---: |")
    ways = {"our bus, cantools a frame at a time": by_cantools, "our bus and driver, blocks made": by_driver}
    for name, way in ways.items():
        with writing(int(PACE * (SECONDS + 5)), PACE, __file__) as (port, start), start() as process:
            try:
                missing, used = way(port)
            finally:
                process.kill()
        print(f"| {name} | {100 * missing:.2f} % | {100 * used:.0f} % |")


if __name__ == "__main__":
    if sys.argv[1:2] == ["write"]:
        write(*(int(word) for word in sys.argv[2:]))
    else:
        decoding()
        paced()
