"""Emulated devices in a separate process, with commands over its standard input.

    python emulated_ports.py N SPEED ORIGIN_WALL ORIGIN [KIND]

First line out: the ports as JSON. Lines in: `unplug K`, `end`. Last line out: frames sent and dropped by each device.
KIND is the name of a driver, by default epson-uart; or several with commas between, then there are N of each.
"""

import json
import os
import select
import sys
from collections.abc import Callable

import numpy as np

from daq import HostClock, IntArray, ScaledClock
from daq.drivers import LineFormat
from daq.emulator import (
    EmulatedAdapter,
    EmulatedEpson,
    EmulatedNode,
    EmulatedShake,
    EmulatedTextLines,
    EmulatedWitmotion,
    serve_all,
    unplugging,
)

Device = EmulatedEpson | EmulatedNode | EmulatedTextLines | EmulatedWitmotion | EmulatedAdapter | EmulatedShake
LINES = LineFormat(columns=("counter", "time_us", "x", "y", "z", "temperature"), unit="mg")


class Ramp:
    """Scan k is (k, -k, 3 k)."""

    def start(self, time: int, rate: float) -> None:
        """Begin."""

    def read(self, index: int, n: int) -> IntArray:
        """Return counts (n, 3)."""
        k = np.arange(index, index + n, dtype=np.int32)
        return np.stack([k, -k, 3 * k], axis=1)


def say(value: object) -> None:
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def reported() -> list[str]:
    """Return the words of a line if one is there within a millisecond."""
    ready, _, _ = select.select([0], [], [], 1e-3)
    return os.read(0, 100).decode().split() or ["end"] if ready else []


def text_lines(clock: HostClock) -> EmulatedTextLines:
    """Return a sensor that sends lines of text."""
    return EmulatedTextLines(Ramp(), clock, LINES, rate=200.0, checksum=True)


KINDS: dict[str, Callable[[HostClock, str], Device]] = {
    "epson-uart": lambda clock, name: EmulatedEpson(Ramp(), clock, serial_number=name),
    "modalwatch-node": lambda clock, name: EmulatedNode(Ramp(), clock, serial_number=name),
    "serial-text": lambda clock, _: text_lines(clock),
    "serial-text over TCP": lambda clock, _: EmulatedAdapter(text_lines(clock), "tcp"),
    "serial-text over UDP": lambda clock, _: EmulatedAdapter(text_lines(clock), "udp"),
    "raspberry-shake": lambda clock, _: EmulatedShake(Ramp(), clock),
    "witmotion": lambda clock, _: EmulatedWitmotion(Ramp(), clock),
}


def main() -> None:
    """Serve until the command to end."""
    n, speed, origin_wall, origin = (int(word) for word in sys.argv[1:5])
    kinds = sys.argv[5].split(",") if len(sys.argv) > 5 else ["epson-uart"]
    clock = ScaledClock(speed=speed, origin_wall=origin_wall, origin=origin)
    with unplugging([KINDS[kind](clock, f"E{k:07}") for kind in kinds for k in range(n)]) as devices:
        say([device.port for device in devices])
        turn = 0
        while (words := reported()) != ["end"]:
            if words:
                devices[int(words[1])].close()
            serve_all(devices, turn := turn + 1)
        say({"sent": [device.sent for device in devices], "dropped": [device.dropped for device in devices]})


if __name__ == "__main__":
    main()
