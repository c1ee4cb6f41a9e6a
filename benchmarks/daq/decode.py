"""Bytes per second of the decoder of burst frames, checksums included: the line in the documentation.

The stream comes in blocks of 4 kB that end amid frames, whole or with one byte in a thousand replaced. CPU time of the
process counts, so that other work on the machine does not.

Usage: python benchmarks/daq/decode.py, or make bench-daq-speed
"""

import time

import numpy as np

from daq.protocol import epson

N_SCANS, BLOCK, TURNS, SEED = 400_000, 4096, 5, 1
DAMAGE = 1e-3  # of the bytes


def speed(stream: bytes) -> tuple[float, int]:
    """Return megabytes a second of CPU time, the median of some turns, and the scans found."""
    rates, found = [], 0
    for _ in range(TURNS):
        decoder = epson.BurstDecoder()
        begun = time.process_time()
        found = sum(len(decoder.feed(stream[at : at + BLOCK]).counter) for at in range(0, len(stream), BLOCK))
        rates.append(len(stream) / 1e6 / (time.process_time() - begun))
    return float(np.median(rates)), found


def main() -> None:
    """Measure a whole stream and a damaged one."""
    random = np.random.default_rng(SEED)
    counts = random.integers(-(2**31), 2**31, (N_SCANS, 3)).astype(np.int32)
    whole = epson.encode_frames(counts, 0, 0)
    bytes_ = np.frombuffer(whole, np.uint8).copy()
    hit = random.random(len(bytes_)) < DAMAGE
    bytes_[hit] ^= random.integers(1, 256, int(hit.sum())).astype(np.uint8)
    print("| stream | MB/s of a core | scans found |\n| --- | ---: | ---: |")
    for name, stream in (("whole", whole), ("damaged, 1 byte in 1000", bytes_.tobytes())):
        rate, found = speed(stream)
        print(f"| {name} | {rate:.0f} | {100 * found / N_SCANS:.2f} % |")
    intact = N_SCANS - np.count_nonzero(hit.reshape(N_SCANS, epson.FRAME_SIZE).any(1))
    print(f"frames without a damaged byte: {100 * intact / N_SCANS:.2f} %")


if __name__ == "__main__":
    main()
