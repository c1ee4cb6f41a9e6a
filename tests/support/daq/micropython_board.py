"""A program for MicroPython, run by CPython on a board with an ADXL355: scan k is (k, -k, 3 k), every 8 ms.

python micropython_board.py PROGRAM
"""

import runpy
import sys
import time
from types import ModuleType

_PERIOD = 250e-6  # at 4000 Hz
_MEMORY = 32  # scans


class I2C:
    """A bus with the sensor."""

    def __init__(self, *_: object, **__: object) -> None:
        self._start, self._period, self._next, self._overrun = 0.0, _PERIOD, 0, False

    def scan(self) -> list[int]:
        return [0x1D]

    def writeto_mem(self, _: int, register: int, content: bytes) -> None:
        if register == 0x28:
            self._period = _PERIOD * 2 ** (content[0] & 15)
        elif register == 0x2D and content == b"\0":
            self._start = time.monotonic()

    def readfrom_mem(self, _: int, register: int, n: int) -> bytes:
        made = int((time.monotonic() - self._start) / self._period) if self._start else 0
        if made > self._next + _MEMORY:
            self._overrun, self._next = True, made - _MEMORY
        if register == 0x11:
            return self._scan(made)
        found = {0x00: 0xAD, 0x04: 4 * self._overrun, 0x05: 3 * (made - self._next)}[register]
        self._overrun = self._overrun and register != 0x04
        return bytes([found] * n)

    def _scan(self, made: int) -> bytes:
        if self._next >= made:
            return bytes([0, 0, 2] * 3)
        k, self._next = self._next, self._next + 1
        entries = [(value & 0xFFFFF) << 4 | (axis == 0) for axis, value in enumerate((k, -k, 3 * k))]
        return b"".join(entry.to_bytes(3, "big") for entry in entries)


def main() -> None:
    """Run the program until its reader has gone."""
    machine = ModuleType("machine")
    vars(machine).update(I2C=I2C, Pin=int)
    sys.modules["machine"] = machine
    vars(time).update(
        ticks_us=lambda: time.monotonic_ns() // 1000,
        ticks_diff=lambda after, before: after - before,
        ticks_add=lambda ticks, more: ticks + more,
        sleep_ms=lambda ms: time.sleep(1e-3 * ms),
    )
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    runpy.run_path(sys.argv[1])


if __name__ == "__main__":
    main()
