"""Scans of nodes, a reader of their frames that goes byte by byte, and the firmware as a program."""

import struct
import subprocess
from binascii import crc_hqx
from pathlib import Path

import numpy as np

from daq.protocol.node import NodeScans

NODE = Path(__file__).parents[3] / "examples" / "node"
#: the node's main loop on a computer: a scan k every 1/rate s is (k, -k, 3 k), as that of `emulated_ports.Ramp`
MAIN = """
#include <poll.h>
#include <time.h>
#include <unistd.h>

static uint64_t now_us(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000u + (uint64_t)t.tv_nsec / 1000u;
}

static void send(const uint8_t *frame, size_t n) { if (write(1, frame, n) < 0) return; }

int main(void) {
    uint8_t out[MW_LONGEST], byte;
    uint32_t millihertz = 0, counter = 0;
    uint64_t start = 0;
    struct pollfd input = {0, POLLIN, 0};
    for (;;) {
        while (poll(&input, 1, 1) > 0) {
            if (read(0, &byte, 1) != 1)
                return 0;
            int command = mw_hear(byte, &millihertz);
            if (command == MW_WHO || command == MW_START)
                send(out, mw_hello("adxl355", "C0000007", 7, 3.8e-5f, millihertz, out));
            if (command == MW_START)
                counter = 0, start = now_us();
            else if (command == MW_STOP)
                start = 0;
        }
        while (start && now_us() - start >= (uint64_t)counter * 1000000000u / millihertz) {
            int32_t k = (int32_t)counter, xyz[3] = {k, -k, 3 * k};
            send(out, mw_scan(counter, (uint32_t)((uint64_t)counter * 1000000000u / millihertz), xyz, 2150, out));
            counter++;
        }
    }
}
"""


def compiled(folder: Path, main: str) -> Path:
    """Return the firmware with a main of ours as a program."""
    source, program = folder / "node.c", folder / "node"
    source.write_text(f'#include "modalwatch_node.h"\n{main}', encoding="utf-8")
    command = [
        "cc",
        "-std=c99",
        "-I",
        str(NODE / "src"),
        "-D_POSIX_C_SOURCE=200809L",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-O1",
        "-o",
    ]
    subprocess.run([*command, str(program), str(source)], check=True, timeout=60)
    return program


def some_scans(seed: int, n: int, *, first: int = 2**32 - 7, small: bool = False) -> NodeScans:
    """Return scans drawn over all of int32, or over few bytes; their counter and clock wrap on the way."""
    random = np.random.default_rng(seed)
    limit = 300 if small else 2**31
    number = first + np.arange(n)
    return NodeScans(
        random.integers(-limit, limit, (n, 3)).astype(np.int32),
        (number % 2**32).astype(np.uint32),
        (number * 1000 % 2**32).astype(np.uint32),
        random.integers(-4000, 8500, n).astype(np.int16),
    )


def values(*parts: NodeScans) -> list[tuple[int, ...]]:
    """Return scans as numbers that compare."""
    return [
        (int(count), int(time), *map(int, xyz), int(temperature))
        for part in parts
        for xyz, count, time, temperature in zip(part.counts, part.counter, part.time, part.temperature, strict=True)
    ]


def read_byte_by_byte(stream: bytes) -> list[tuple[int, ...]]:
    """Return the scans of a stream by the description of docs/howto/rig/node.md, one byte after the other."""
    found = []
    for segment in stream.split(b"\0")[:-1]:
        content, at = bytearray(), 0
        while at < len(segment):
            content += segment[at + 1 : at + segment[at]] + b"\0"
            at += segment[at]
        if at == len(segment) == 26 and content[0] == 1 and _crc_is_right(bytes(content[:-1])):
            found.append(struct.unpack("<IIiiih", content[1:23]))
    return found


def _crc_is_right(frame: bytes) -> bool:
    return crc_hqx(frame[:-2], 0xFFFF) == int.from_bytes(frame[-2:], "little")
