"""Speed of the decoders of burst frames, checksums included, and of lines of text: the figures in the documentation.

The stream comes in blocks of 4 kB that end amid frames, whole or with one byte in a thousand replaced. CPU time of the
process counts, so that other work on the machine does not.

Usage: python benchmarks/daq/decode.py, or make bench-daq-speed
"""

import time

import numpy as np

from daq.protocol import epson
from daq.protocol.text_line import LineFormat, TextDecoder, TextScans, encode_lines

N_SCANS, BLOCK, TURNS, SEED = 400_000, 4096, 5, 1
DAMAGE = 1e-3  # of the bytes
N_LINES = 20_000


def speed(stream: bytes) -> tuple[float, int]:
    """Return megabytes a second of CPU time, the median of some turns, and the scans found."""
    rates, found = [], 0
    for _ in range(TURNS):
        decoder = epson.BurstDecoder()
        begun = time.process_time()
        found = sum(len(decoder.feed(stream[at : at + BLOCK]).counter) for at in range(0, len(stream), BLOCK))
        rates.append(len(stream) / 1e6 / (time.process_time() - begun))
    return float(np.median(rates)), found


def line_seconds(columns: tuple[str, ...], checksum: bool) -> float:
    """Return the CPU time of a line of text [s], the median of some turns."""
    form, number = LineFormat(columns=columns, unit="g"), np.arange(N_LINES)
    counts = np.random.default_rng(SEED).integers(-(10**7), 10**7, (N_LINES, 3)).astype(np.int32)
    scans = TextScans(counts, number, number / 1000, np.zeros(N_LINES), number)
    stream, spent = encode_lines(scans, form, checksum=checksum), []
    for _ in range(TURNS):
        decoder = TextDecoder(form)
        begun = time.process_time()
        found = sum(len(decoder.feed(stream[at : at + BLOCK])) for at in range(0, len(stream), BLOCK))
        spent.append((time.process_time() - begun) / found)
    return float(np.median(spent))


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
    print("| line of text | µs of a core | with a checksum |\n| --- | ---: | ---: |")
    for columns in (("x", "y", "z"), ("counter", "time_us", "x", "y", "z")):
        plain, sealed = (1e6 * line_seconds(columns, checksum) for checksum in (False, True))
        print(f"| {' '.join(columns)} | {plain:.1f} | {sealed:.1f} |")


if __name__ == "__main__":
    main()
