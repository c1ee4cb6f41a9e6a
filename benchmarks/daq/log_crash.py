"""Loss of a recording by a kill and by a power cut, and size and repair time of logs: tables in the documentation.

Kills: a process records four emulated devices (1000 scans/s, real time, ptys, emulated by another process) with the
default settings and is killed (SIGKILL) at a random moment. The loss is the time from the last scan in the repaired log
to the kill, of the device with the largest one. Power cuts are the same kills with all bytes dropped that were not yet
synced: files are cut back to the length at their last completed fdatasync, as recorded by the writing process.

Usage: python benchmarks/daq/log_crash.py [N_KILLS] [SEED], or make bench-log-crash
"""

import json
import math
import mmap
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from daq import Block, DeviceReader, Event, IntArray, SystemClock, make_driver, read_log, repair_log
from daq.drivers import EPSON_SCALE
from daq.files import expand_log
from daq.log import DiskGuard, ResilientWriter, Retention, RotatingWriter, WriterThread, as_logs, log_info
from monitor.settings import RecorderSettings

SUPPORT = Path(__file__).parents[2] / "tests" / "support" / "daq"
N_DEVICES, RATE = 4, 1000.0
RUNNING = 1.5, 4.0  # s from the first scan to the kill, drawn between
NOTE = struct.Struct("<Qd")  # length of the newest file at its last sync [bytes], longest sync so far [s]
NOISE = 72.0  # counts rms: 0.2 ug/sqrt(Hz) of an M-A352 up to 460 Hz, at 0.06 ug a count
START = 1_767_225_600_000_000_000  # ns UTC
CHUNK = RecorderSettings().chunk_seconds


def record(folder: Path, ports: list[str]) -> None:
    """Record until killed; note how much is synced."""
    _note_syncs(folder / "synced")
    clock = SystemClock()
    recorder = RotatingWriter(folder, {"site.toml": "x = 1"}, clock.now())
    keeper = ResilientWriter(recorder, DiskGuard(folder, Retention()), _ignore)
    with WriterThread(keeper, _ignore, chunk_seconds=CHUNK) as log:
        for k, port in enumerate(ports):
            reader = DeviceReader(f"d{k}", make_driver("epson-uart", port, RATE), RATE, clock, log.put)
            reader.connect()
            reader.start()
        print("recording", flush=True)
        threading.Event().wait()


def _ignore(_: object) -> None:
    """Nothing analyses here."""


def _note_syncs(path: Path) -> None:
    """Record, where a kill leaves it, the length of the file that was synced last."""
    path.write_bytes(NOTE.pack(0, 0.0))
    with path.open("r+b") as file:
        note = mmap.mmap(file.fileno(), NOTE.size)
    sync, longest = os.fdatasync, 0.0

    def noted(number: object) -> None:
        nonlocal longest
        assert isinstance(number, int)
        length, begun = os.fstat(number).st_size, time.monotonic()
        sync(number)
        longest = max(longest, time.monotonic() - begun)
        note[:] = NOTE.pack(length, longest)

    os.fdatasync = noted  # type: ignore[assignment]  # only a number is given here


@contextmanager
def devices() -> Iterator[list[str]]:
    """Emulate devices in a process of their own; yield their ports."""
    arguments = [sys.executable, str(SUPPORT / "emulated_ports.py"), str(N_DEVICES), "1", "0", "0"]
    with subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            yield json.loads(process.stdout.readline())
        finally:
            process.stdin.write("end\n")
            process.stdin.flush()
            process.stdout.read()


def kill_once(folder: Path, seconds: float) -> int:
    """Record for some seconds, then kill; return when [ns UTC]."""
    with devices() as ports:
        arguments = [sys.executable, __file__, "record", str(folder), *ports]
        with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "recording\n"
            time.sleep(seconds)
            process.kill()
            return time.time_ns()


def lost_seconds(folder: Path, killed: int) -> float:
    """Repair a log and check every scan in it; return the time missing before the kill, of the worst device [s]."""
    (log,) = folder.glob("*.mcap")
    repair_log(log)
    with log.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        n_messages = sum(1 for _ in reader.iter_messages(log_time_order=False))
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == n_messages
    last = dict.fromkeys((f"d{k}" for k in range(N_DEVICES)), 0)
    ends: dict[str, int] = {}
    late = 0.0  # by the devices' filter: times are those of the motion
    for item in read_log(log):
        if isinstance(item, Event):
            late = item.payload.get("filter_delay", late)
        else:
            assert item.first_index == ends.get(item.device, item.first_index), "a scan is missing amid"
            k = item.counts[0, 0] + np.arange(item.n_scans)
            assert (item.counts == np.stack([k, -k, 3 * k], 1)).all(), "a scan is not what was sent"
            ends[item.device] = item.end_index
            last[item.device] = item.arrival_time + round((item.end_index - item.arrival_index) / RATE * 1e9)
    return (killed - min(last.values())) * 1e-9 - late


def converts(folder: Path) -> bool:
    """Return whether rerun converts the repaired log as it is."""
    (log,) = folder.glob("*.mcap")
    rerun = Path(sys.executable).with_name("rerun")
    command = [str(rerun), "mcap", "convert", str(log), "-o", str(folder / "out.rrd")]
    return subprocess.run(command, capture_output=True).returncode == 0


def kills(n: int, seed: int) -> None:
    """Kill many times; print a row for kills, one for power cuts."""
    random = np.random.default_rng(seed)
    killed, cut, longest, converted = [], [], 0.0, 0
    for _ in range(n):
        with tempfile.TemporaryDirectory(dir=Path.cwd()) as name:
            folder, powerless = Path(name) / "log", Path(name) / "cut"
            folder.mkdir()
            when = kill_once(folder, random.uniform(*RUNNING))
            shutil.copytree(folder, powerless)
            synced, slowest = NOTE.unpack((folder / "synced").read_bytes())
            (log,) = powerless.glob("*.mcap")
            os.truncate(log, synced)
            longest = max(longest, slowest)
            killed.append(lost_seconds(folder, when))
            cut.append(lost_seconds(powerless, when))
            converted += converts(folder)
    print(f"\n{n} kills, seed {seed}; longest fdatasync {longest:.3f} s; {converted} of {n} convert in rerun")
    print("| | median lost [s] | most lost [s] |\n| --- | ---: | ---: |")
    print(f"| kill -9 | {np.median(killed):.2f} | {max(killed):.2f} |")
    print(f"| power cut | {np.median(cut):.2f} | {max(cut):.2f} |")


def noise(n: int, rms: float, seed: int) -> IntArray:
    """Return scans (n, 3) of a device: its own noise and white motion of an rms [counts]."""
    return np.rint(np.random.default_rng(seed).normal(0, np.hypot(NOISE, rms), (n, 3))).astype(np.int32)


def block(device: str, first: int, counts: IntArray, arrived: int) -> Block:
    """Return a block as a driver makes it."""
    return Block(
        device=device,
        rate=RATE,
        first_index=first,
        counts=counts,
        scale=EPSON_SCALE,
        arrival_index=first + len(counts) - 1,
        arrival_time=START + arrived,
        temperature=21.5,
    )


def write(folder: Path, n_devices: int, seconds: int, rms: float, view_rate: float = 0.0) -> Path:
    """Write the data of devices, with chunks as often as live: reads are evenly spaced, for the shortest log."""
    random = np.random.default_rng(1)
    scans = [noise(60_000, rms, k) for k in range(n_devices)]
    writer, waits = RotatingWriter(folder, {}, START, view_rate=view_rate), 0
    n, chunk = round(0.2 * RATE), round(1e9 * CHUNK)
    for first in range(0, round(seconds * RATE), n):
        for k, known in enumerate(scans):
            now = round(1e9 * (first / n + 1 + k / n_devices) * n / RATE) + int(random.integers(1_000_000))
            if waits and now > waits + chunk:
                writer.flush()
                waits = 0
            waits = waits or now
            writer.write(block(f"d{k}", first, known[first % 60_000 :][:n], now))
    writer.flush()
    writer.close()
    return writer.paths[0]


def sizes(folder: Path) -> None:
    """Print bytes a 3-axis scan on the disk: the least, ours, and a message a scan, bare (twelve bytes) or ROS 2.

    The entropy of normal white noise of s counts rms is log2(s sqrt(2 pi e)) bits per sample. Where messages are not
    compressed they are in chunks as well, as stock writers do by an option.
    """
    print("\n| devices | motion [mg rms] | entropy | ours | bare | bare, packed | Imu | Imu, packed | times ours |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for n_devices, milli_g in ((1, 0.0), (4, 0.0), (8, 0.0), (32, 0.0), (4, 0.1), (4, 1.0), (4, 10.0)):
        view = folder / "view.mcap"
        rms = milli_g * 1e-3 * 9.80665 / EPSON_SCALE
        least = 3 / 8 * np.log2(np.hypot(NOISE, rms) * np.sqrt(2 * np.pi * math.e))
        log = write(folder, n_devices, 20 if n_devices > 8 else 60, rms)
        n = sum(expand_log(log, view).values())
        sizes = [log.stat().st_size / n]
        for source in (_bare(log), _views(view)):
            for compression in (CompressionType.NONE, CompressionType.ZSTD):
                sizes.append(_plain(source, folder / "plain.mcap", compression) / n)
        ours, bare, bare_packed, imu, packed = sizes
        row = f"| {n_devices} | {milli_g:g} | {least:.2f} | {ours:.2f} | {bare:.0f} | {bare_packed:.1f} "
        print(f"{row}| {imu:.0f} | {packed:.1f} | {packed / ours:.1f} to {imu / ours:.0f} |")
        log.unlink()
        view.unlink()


def _bare(log: Path) -> list[tuple[str, int, bytes]]:
    """Return topic, time and content of a message a scan as small as such messages get: three int32."""
    blocks = (item for item in read_log(log) if isinstance(item, Block))
    return [
        (item.device, item.arrival_time + (k - item.n_scans) * 1_000_000, scan.tobytes())
        for item in blocks
        for k, scan in enumerate(item.counts)
    ]


def _views(view: Path) -> list[tuple[str, int, bytes]]:
    """Return topic, time and content of a message a scan as `log expand` writes them."""
    with view.open("rb") as file:
        messages = make_reader(file).iter_messages(log_time_order=False)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in messages]


def _plain(messages: list[tuple[str, int, bytes]], path: Path, compression: CompressionType) -> int:
    """Write messages as the stock writer does; return how long the file is."""
    with path.open("wb") as file:
        writer = Writer(file, compression=compression)
        writer.start()
        channels: dict[str, int] = {}
        for topic, time, data in messages:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "raw", 0)
            writer.add_message(channels[topic], time, data, time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path.stat().st_size


def mending(folder: Path, view_rate: float) -> None:
    """Print the repair time of an hour of eight devices after a cut."""
    path = write(folder, 8, 3600, 0.0, view_rate)
    os.truncate(path, path.stat().st_size - 4_000_000)
    begun, used = time.monotonic(), time.process_time()
    state = repair_log(path)
    seconds, used = time.monotonic() - begun, time.process_time() - used
    size = f"{path.stat().st_size / 1e6:.0f} MB, view {view_rate:g} Hz"
    print(f"\nan hour of 8 devices, {size}, {state}: mended in {seconds:.2f} s ({used:.2f} s of a core)")
    assert log_info(as_logs([path])[0]).state.whole
    path.unlink()


def main() -> None:
    """Measure everything."""
    n, seed = (int(word) for word in (*sys.argv[1:3], *("50", "1")[len(sys.argv[1:3]) :]))
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as name:
        sizes(Path(name))
        for view_rate in (0.0, RecorderSettings().view_rate):
            mending(Path(name), view_rate)
    kills(n, seed)


if __name__ == "__main__":
    if sys.argv[1:2] == ["record"]:
        with suppress(KeyboardInterrupt):
            record(Path(sys.argv[2]), sys.argv[3:])
    else:
        main()
