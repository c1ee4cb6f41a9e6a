"""From a log to modes: processor time of reading and of identification, per window length, in one process.

Two logs of 20 minutes hold the same signals of six devices at 1 kHz, of which 12 of 18 axes are analysed. One is as
recorded live (blocks of 0.2 s, clocks that drift, late arrivals) and is interpolated to one grid. The other one is as
imported (long blocks on one grid).

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/oma/log_speed.py, or make bench-log-speed
"""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy import signal

from daq import Block, Channel, Flag, McapWriter, Recording, load_recordings
from daq.log import CHANNELS, ChannelMap
from oma import identify_all

N_SAMPLES, RATE, SCALE = 1_206_000, 1000.0, 3e-6
FREQUENCIES = (2.3, 5.1, 7.7, 13.0, 22.0, 41.0, 77.0, 130.0)  # Hz
DAMPING = 0.01
START = 1_700_000_000_000_000_000  # ns UTC
CHANNEL_MAP = tuple(Channel(name=f"c{k}", device=f"d{k // 2}", axis=k % 2) for k in range(12))


def signals(random: np.random.Generator) -> np.ndarray:
    """Return counts (n_samples, 18) of eight modes under white forces, with sensor noise."""
    data = np.zeros((N_SAMPLES, 18), np.float32)
    for frequency in FREQUENCIES:
        omega = 2 * np.pi * frequency / RATE
        radius = np.exp(-DAMPING * omega)
        mode = signal.lfilter([1], [1, -2 * radius * np.cos(omega), radius**2], random.standard_normal(N_SAMPLES))
        data += (mode[:, None] / mode.std() * random.standard_normal(18)).astype(np.float32)
    data = 0.01 * data + 5e-4 * random.standard_normal(data.shape).astype(np.float32)
    return np.asarray(np.round(data / SCALE), np.int32)


def write(path: Path, counts: np.ndarray, random: np.random.Generator, *, live: bool) -> None:
    """Write the log."""
    n_scans = 200 if live else 6000
    writer = McapWriter(path, {CHANNELS: ChannelMap(channels=CHANNEL_MAP, on_grid=not live).to_json()})
    for first in range(0, N_SAMPLES - n_scans + 1, n_scans):
        for device in range(6):
            last = first + n_scans - 1
            late, drift = (random.exponential(2e6), 1 + 10e-6 * (device - 2)) if live else (0.0, 1.0)
            writer.write(
                Block(
                    device=f"d{device}",
                    rate=RATE,
                    first_index=first,
                    counts=counts[first : first + n_scans, 3 * device : 3 * device + 3],
                    scale=SCALE,
                    arrival_index=last,
                    arrival_time=START + round(last * 1e6 * drift + late),
                    temperature=20.0,
                    flags=Flag.NONE,
                    clock="",
                )
            )
    writer.close()


def timed(windows: Iterator[Recording]) -> tuple[float, float, float]:
    """Return seconds of data, and of processor time for reading and for identification."""
    seconds = reading = identifying = 0.0
    while True:
        start = time.process_time()
        window = next(windows, None)
        reading += time.process_time() - start
        if window is None:
            return seconds, reading, identifying
        start = time.process_time()
        n_modes = len(identify_all(window).estimate.frequency)
        identifying += time.process_time() - start
        assert n_modes > len(FREQUENCIES) / 2
        seconds += window.duration


def main() -> None:
    """Print the table of the documentation."""
    random = np.random.default_rng(1)
    counts = signals(random)
    print("| log | window | reading | identification | data over processor time |\n|:--|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as folder:
        for name, live in (("as recorded live", True), ("imported", False)):
            path = Path(folder) / f"{name}.mcap"
            write(path, counts, random, live=live)
            for length in (600.0, 40.0):
                seconds, reading, identifying = timed(load_recordings(path, window_seconds=length))
                total = reading + identifying
                print(f"| {name} | {length:g} s | {reading:.1f} s | {identifying:.1f} s | {seconds / total:.0f} |")


if __name__ == "__main__":
    main()
