"""From a log to modes: processor time by stage and of the whole command, and of the stock reader with pyOMA2.

Two logs of 20 minutes hold the same signals of six devices at 1 kHz, of which 12 of 18 axes are analysed. One is as
recorded live: blocks of 0.2 s, chunks of 0.05 s, a preview of 50 Hz, devices with clocks of their own, late arrivals.
Its scans are interpolated to one grid. The other one is as imported: long blocks on one grid. The live log is also
replayed: windows in which nothing has changed, with a baseline of 12 windows, where there are so many.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/oma/log_speed.py [without-peer], or make bench-log-speed
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
import zlib
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.records import Chunk
from scipy import fft, linalg, signal

import oma.identification as identification
from benchmarks.common.peers import OURS, measured, peer_python
from daq import Block, Channel, Flag, McapWriter, load_recordings, read_log
from daq.log import CHANNELS, ChannelMap
from daq.log.format.block_codec import decode_block
from daq.log.format.chunks import ChunkReader
from daq.log.format.preview import View
from daq.log.format.record_stream import RecordStream
from daq.log.mcap_log import MAGIC
from daq.timing.interpolation import half_taps, interpolate
from oma import DataSSI, identify_all
from oma.methods.ssi import SSILevel
from oma.preparation import TOP, levels

N_SAMPLES, RATE, SCALE = 1_206_000, 1000.0, 3e-6
FREQUENCIES = (2.3, 5.1, 7.7, 13.0, 22.0, 41.0, 77.0, 130.0)  # Hz
DAMPING = 0.01
START = 1_700_000_000_000_000_000  # ns UTC
CHANNEL_MAP = tuple(Channel(name=f"c{k}", device=f"d{k // 2}", axis=k % 2) for k in range(12))
_PIECE = 128  # samples of one Fourier transform of the floors
BLOCK_ROWS, MAX_ORDER = 50, 60  # of the peer, as in benchmarks/oma/speed.py
COMMAND = """import atexit, sys
from benchmarks.common.peers import peak
atexit.register(lambda: sys.stderr.write(f"\\n{peak()}"))
from monitor.cli.main import main
main()"""
SITE = "[analysis]\nbaseline_windows = 12\n" + "".join(
    f'[[device]]\nname = "d{d}"\ndriver = "epson-uart"\nport = "/dev/none{d}"\nrate = {RATE}\n'
    f'channels = {{x = "c{2 * d}", y = "c{2 * d + 1}"}}\n'
    for d in range(6)
)
START_SAMPLES = 30_000  # of a log without a window, whose replay is the start of the command


def signals(random: np.random.Generator) -> np.ndarray:
    """Return accelerations in counts (n_samples, 18) of eight modes under white forces, with sensor noise."""
    data = np.zeros((N_SAMPLES, 18), np.float32)
    for frequency in FREQUENCIES:
        omega = 2 * np.pi * frequency / RATE
        radius = np.exp(-DAMPING * omega)
        mode = signal.lfilter([1], [1, -2 * radius * np.cos(omega), radius**2], random.standard_normal(N_SAMPLES))
        data += (mode[:, None] / mode.std() * random.standard_normal(18)).astype(np.float32)
    data = 0.01 * data + 5e-4 * random.standard_normal(data.shape).astype(np.float32)
    return np.asarray(data / SCALE)


def sampled(signals: np.ndarray, drift: float) -> np.ndarray:
    """Return counts (n, 3) at the scans of a device whose clock is slow by `drift`."""
    margin = half_taps(1.0) + 2
    n = int((len(signals) - 2 * margin) / (1 + abs(drift)))
    return np.asarray(np.round(interpolate(signals.astype(np.float64), margin, 1 + drift, n)), np.int32)


def write(path: Path, data: np.ndarray, random: np.random.Generator, *, live: bool) -> None:
    """Write a log."""
    drifts = [10e-6 * (device - 2) if live else 0.0 for device in range(6)]
    counts = [
        sampled(data[:, 3 * d : 3 * d + 3], drift) if live else np.round(data[:, 3 * d : 3 * d + 3]).astype(np.int32)
        for d, drift in enumerate(drifts)
    ]
    n_scans = 200 if live else 6000
    writer, view = (
        McapWriter(path, {"site.toml": SITE, CHANNELS: ChannelMap(channels=CHANNEL_MAP, on_grid=not live).to_json()}),
        View(50.0),
    )
    for first in range(0, min(map(len, counts)) - n_scans + 1, n_scans):
        for device in range(6):
            last = first + n_scans - 1
            block = Block(
                device=f"d{device}",
                rate=RATE,
                first_index=first,
                counts=counts[device][first : first + n_scans],
                scale=SCALE,
                arrival_index=last,
                arrival_time=START + round(last * 1e6 * (1 + drifts[device]) + live * random.exponential(2e6)),
                temperature=20.0,
                flags=Flag.NONE,
                clock="",
            )
            writer.write(block)
            for message in view.add(block) if live else ():
                writer.show(message)
            if live and device % 2:
                writer.hand_over()
    writer.close()


class Stages:
    """Processor time of functions, by stage, while they are replaced by timed ones."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)

    def timed(self, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function whose time is added to a stage."""

        def run(*arguments: Any, **options: Any) -> Any:
            start = time.process_time()
            try:
                return function(*arguments, **options)
            finally:
                self.seconds[stage] += time.process_time() - start

        return run

    def watch(self) -> None:
        """Replace the functions of the identification."""
        for name in ("cleaned", "usable_share", "delays_of_clean", "aligned"):
            setattr(identification, name, self.timed("clean", getattr(identification, name)))
        stream: Any = identification.IdentificationStream
        stream.add = self.timed("correlate", stream.add)
        level: Any = SSILevel
        level.identify = self.timed("identify", level.identify)


def stages(path: Path, length: float, stages: Stages) -> dict[str, float]:
    """Return processor time by stage [s], all in one process."""
    start = time.process_time()
    for _ in read_log(path):
        pass
    reading = time.process_time() - start
    stages.seconds.clear()
    start, assembled, windows = time.process_time(), 0.0, load_recordings(path, window_seconds=length)
    identified = 0.0
    while True:
        begin = time.process_time()
        window = next(windows, None)
        assembled += time.process_time() - begin
        if window is None:
            break
        begin = time.process_time()
        assert len(identify_all(window).estimate.frequency) > len(FREQUENCIES) / 2
        identified += time.process_time() - begin
    parts = {name: stages.seconds[name] for name in ("clean", "correlate", "identify")}
    return {"read": reading, "assemble": assembled - reading, **parts, "select": identified - sum(parts.values())}


def floors(path: Path, length: float) -> dict[str, float]:
    """Return the processor time of the least that any program does for each stage [s].

    read: chunks decompressed, with their checksums, and one copy of the counts; assemble, clean: one copy of the
    samples; correlate, select: one Fourier transform of the samples in pieces that fit the cache; identify: eigenvalues
    and vectors of all orders and one singular value decomposition per rate, by LAPACK.
    """
    found: defaultdict[str, float] = defaultdict(float)

    def spent(names: tuple[str, ...], work: Callable[[], object]) -> None:
        start = time.process_time()
        work()
        for name in names:
            found[name] += time.process_time() - start

    def decompressed() -> None:
        chunks = ChunkReader(lambda _: False)
        with path.open("rb") as file:
            file.seek(len(MAGIC))
            for record in RecordStream(file):
                if isinstance(record, Chunk):
                    zlib.crc32(chunks.uncompressed(record))

    spent(("read",), decompressed)
    method, random = DataSSI(), np.random.default_rng(0)
    for window in load_recordings(path, window_seconds=length):
        n_channels = len(window.channels)
        pieces = window.data[: len(window.data) // _PIECE * _PIECE].T.reshape(n_channels, -1, _PIECE)
        spent(("assemble", "clean"), window.data.copy)
        spent(("correlate", "select"), partial(fft.rfft, pieces, axis=-1))
        size = method.rows(n_channels) * n_channels
        hankel = random.standard_normal((size, size))
        for level in levels(RATE, (method.min_cycles / length, TOP * RATE), method.decimation):
            if level:
                spent(("identify",), partial(linalg.svd, hankel, full_matrices=False, check_finite=False))
                for n in method.orders(method.first_order):
                    spent(("identify",), partial(np.linalg.eig, hankel[:n, :n]))
    spent(("read",), np.zeros(3 * len(CHANNEL_MAP) // 2 * N_SAMPLES, np.int32).copy)
    return found


def whole(folder: Path, *arguments: str, repeats: int = 3) -> tuple[float, float]:
    """Return the processor time of a command, with its start [s], and its largest memory [MB]: the least of some runs.

    The first run compiles the modules, as an installation does, where the environment prevents that.
    """
    bytecode = {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(folder / "bytecode")}
    spent, memory = [], []
    for _ in range(repeats):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [sys.executable, "-c", COMMAND, *arguments],
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"} | bytecode,
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        memory.append(float(done.stderr.splitlines()[-1]))
    return min(spent), max(memory)


def show_replay(folder: Path, path: Path, short: Path) -> None:
    """Print the table of replays of a log, and of a short log without a window."""
    start, _ = whole(folder, "replay", str(short))
    print(
        "\n| `replay` of the live log | start | whole command | data over processor time | beyond its start | memory |"
    )
    print("|:--|---:|---:|---:|---:|---:|")
    for length in (600.0, 40.0):
        spent, memory = whole(folder, "replay", str(path), "--set", f"analysis.window_seconds={length}")
        seconds = N_SAMPLES / RATE // length * length
        print(
            f"| {length:g} s | {start:.1f} s | {spent:.1f} s | {seconds / spent:.0f} | {seconds / (spent - start):.0f} "
            f"| {memory:.0f} MB |",
            flush=True,
        )


# what the children run for the comparison


def stock_reader(path: str, folder: str) -> tuple[Callable[[], Any], Callable[[Any], Any]]:
    """Read a log by the stock reader, message by message, and save its channels on the scans' own indices."""

    def work() -> str:
        scans: dict[str, list[np.ndarray]] = {}
        with Path(path).open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages():
                if channel.topic.startswith("/accel/"):
                    block = decode_block(channel.topic.removeprefix("/accel/"), message.data)
                    scans.setdefault(block.device, []).append(block.counts[:, :2] * block.scale)
        whole = [np.concatenate(scans[device]) for device in sorted(scans)]
        np.save(Path(folder) / "data.npy", np.concatenate([each[: min(map(len, whole))] for each in whole], axis=1))
        return ""

    return work, lambda found: found


def pyoma(folder: str, length: float) -> tuple[Callable[[], Any], Callable[[Any], Any]]:
    """Identify the windows by SSI-COV of pyOMA2 from correlation functions, poles of all orders."""
    from pyoma2.algorithms import SSI
    from pyoma2.setup import SingleSetup

    data = np.load(Path(folder) / "data.npy")
    n = round(length * RATE)

    def work() -> int:
        for k in range(len(data) // n):
            setup = SingleSetup(data[k * n : (k + 1) * n], fs=RATE)
            setup.add_algorithms(SSI(name="s", method="cov_R", br=BLOCK_ROWS, ordmin=2, ordmax=MAX_ORDER, step=2))
            setup.run_by_name("s")
        return len(data) // n

    return work, lambda found: found


def peer(path: Path, folder: Path, length: float) -> tuple[float, float]:
    """Return the processor time of the stock reader and of pyOMA2, without their start [s]."""
    read = measured(OURS, Path(__file__), "stock_reader", 1, path=str(path), folder=str(folder))
    found = measured(peer_python(), folder / "peer.py", "pyoma", 1, folder=str(folder), length=length)
    return read["cpu"], found["cpu"]


def peer_source() -> str:
    """Return the part of this file that runs in the peer's environment, which has none of our packages."""
    source = Path(__file__).read_text()
    begin, end = source.index("def pyoma("), source.index("def peer(")
    heads = (
        "from collections.abc import Callable\nfrom pathlib import Path\nfrom typing import Any\nimport numpy as np\n"
    )
    return f"{heads}RATE, BLOCK_ROWS, MAX_ORDER = {RATE}, {BLOCK_ROWS}, {MAX_ORDER}\n{source[begin:end]}"


def main(*arguments: str) -> None:
    """Print the tables of docs/validation/identification/log_speed.md."""
    random = np.random.default_rng(1)
    data, watch = signals(random), Stages()
    watch.watch()
    names = ("read", "assemble", "clean", "correlate", "identify", "select")
    print(
        "| log | window | "
        + " | ".join(names)
        + " | whole command | data over processor time | memory | stock reader | pyOMA2 |"
    )
    print("|:--|---:" + "|---:" * (len(names) + 5) + "|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "peer.py").write_text(peer_source())
        for log, live in (("as recorded live", True), ("imported", False)):
            path = folder / f"{log}.mcap"
            write(path, data, random, live=live)
            for length in (600.0, 40.0):
                parts = stages(path, length, watch)
                command, memory = whole(folder, "identify", str(path), "--window", f"{length:g}")
                others = ("-", "-") if arguments else tuple(f"{each:.1f} s" for each in peer(path, folder, length))
                seconds = N_SAMPLES / RATE // length * length
                cells = [f"{parts[name]:.2f} s" for name in names]
                print(
                    f"| {log} | {length:g} s | {' | '.join(cells)} | {command:.1f} s | {seconds / command:.0f} "
                    f"| {memory:.0f} MB | {others[0]} | {others[1]} |",
                    flush=True,
                )
                least = floors(path, length)
                print(f"| | floor | {' | '.join(f'{least[name]:.2f} s' for name in names)} | | | | | |")
                ratios = [f"{parts[name] / least[name]:.1f}" for name in names]
                print(f"| | over floor | {' | '.join(ratios)} | | | | | |", flush=True)
        write(folder / "short.mcap", data[:START_SAMPLES], random, live=True)
        show_replay(folder, folder / "as recorded live.mcap", folder / "short.mcap")


if __name__ == "__main__":
    main(*sys.argv[1:])
