"""Emulated serial devices in a process of their own."""

import json
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from daq import ScaledClock
from tests.support.daq.blocks import START
from tests.support.processes import script_process

SCRIPT = Path(__file__).parent / "emulated_ports.py"


@dataclass(frozen=True)
class Emulators:
    """A process with emulated devices."""

    process: subprocess.Popen[str]
    clock: ScaledClock
    ports: list[str]

    def unplug(self, k: int) -> None:
        self._say(f"unplug {k}")

    def end(self) -> dict[str, list[int]]:
        """Stop it; return frames sent and dropped."""
        self._say("end")
        assert self.process.stdout is not None
        found: dict[str, list[int]] = json.loads(self.process.stdout.readline())
        return found

    def _say(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()


@contextmanager
def emulators(n: int, speed: int = 1, kind: str = "epson-uart") -> Iterator[Emulators]:
    """Run n devices of the kind that a driver is for; the process is gone afterwards."""
    clock = ScaledClock(speed=speed, origin_wall=time.time_ns(), origin=START)
    with script_process(SCRIPT, n, speed, clock.origin_wall, clock.origin, kind) as (process, ports):
        yield Emulators(process, clock, json.loads(ports))
