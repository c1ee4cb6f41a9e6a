"""Accuracy of the times of scans over an hour behind USB adapters: the table in the documentation.

The device's clock has a constant error, or one that wanders over the hour. Its adapter passes bytes on every 1 or 16
milliseconds; the host wakes up 0.1 ms later on average, exponentially distributed, and for one read in a hundred 5 to
30 ms later. Reads are as long as those of `daq.drivers.serial.buffered_port`. These arrivals go through the drivers'
`BlockBuilder` and the `ClockFit` of live and replayed data. The error of a scan's time is the difference between the
fit two seconds later, when windows are cut, and the true time. Jitter is its standard deviation over the hour, late its
mean.

Usage: python benchmarks/daq/jitter.py [SECONDS], or make bench-jitter
"""

import sys
from collections.abc import Callable, Iterator

import numpy as np

from daq import FloatArray, IntArray, Scans
from daq.drivers.block_builder import BlockBuilder
from daq.timing import ClockFit

RATE, SECONDS, SEED = 1000.0, 3600.0, 1
GATHER, AHEAD, SETTLED = 0.19, 2.0, 120.0  # s
START = 1_767_225_600_000_000_000  # ns UTC
WAKE, BUSY, BUSY_SECONDS = 1e-4, 0.01, (5e-3, 30e-3)

Oscillator = Callable[[FloatArray], FloatArray]  # time of the host [s] -> seconds of the device's own clock


def steady(ppm: float) -> Oscillator:
    """Return a clock that is off by a constant."""
    return lambda t: t * (1 + 1e-6 * ppm)


def wandering(mean: float, ppm: float) -> Oscillator:
    """Return a clock whose error goes once up and down about its mean within an hour, as in sunlight."""
    turn = 2 * np.pi / 3600
    return lambda t: t * (1 + 1e-6 * mean) + 1e-6 * ppm * (1 - np.cos(turn * t)) / turn


def reads(oscillator: Oscillator, latency: float, seconds: float, seed: int) -> Iterator[tuple[float, IntArray]]:
    """Yield when each read ends [s] and the numbers of its scans."""
    random = np.random.default_rng(seed)
    phase = random.uniform(0, latency)
    last, end = -1, 0.0
    while end < seconds:
        packet = phase + np.ceil((end + GATHER - phase) / latency) * latency
        end = packet + random.exponential(WAKE) + (random.uniform(*BUSY_SECONDS) if random.random() < BUSY else 0.0)
        handed_on = phase + np.floor((end - phase) / latency) * latency
        newest = int(np.floor(oscillator(np.array(handed_on)) * RATE))
        yield end, np.arange(last + 1, newest + 1, dtype=np.int32)
        last = newest


def errors(oscillator: Oscillator, latency: float, seconds: float, seed: int) -> FloatArray:
    """Return the error of the time of a scan in each block [s], once the fit has settled."""
    blocks, fit, found = BlockBuilder("d", RATE, 1.0, 1 << 16, round(0.2 * RATE)), ClockFit(RATE), []
    grid = np.linspace(0, seconds + 1, round(seconds) + 2)
    ticks = oscillator(grid)
    for end, number in reads(oscillator, latency, seconds, seed):
        scans = Scans(np.zeros((len(number), 1), np.int32), number & 0xFFFF, float("nan"), 0)
        for block in blocks.add(scans, START + round(end * 1e9)):
            fit.add(block.arrival_index, block.arrival_time)
            index = block.end_index - round(AHEAD * RATE)
            if end > SETTLED:
                found.append(1e-9 * (fit.time_at(index) - START) - float(np.interp(index / RATE, ticks, grid)))
    return np.array(found)


def main() -> None:
    """Print the table."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    clocks = {f"{ppm:+g} ppm": steady(ppm) for ppm in (-50.0, -20.0, 5.0, 20.0, 50.0)}
    clocks["+30 ppm, wanders by 10"] = wandering(30.0, 10.0)
    print("| oscillator | adapter [ms] | jitter [ms rms] | most off its mean [ms] | late [ms] |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for name, oscillator in clocks.items():
        for latency in (0.001, 0.016):
            error = 1e3 * errors(oscillator, latency, seconds, SEED)
            off = np.abs(error - error.mean()).max()
            print(f"| {name} | {1e3 * latency:g} | {error.std():.3f} | {off:.3f} | {error.mean():.2f} |")


if __name__ == "__main__":
    main()
