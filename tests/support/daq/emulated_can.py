"""Emulated CAN nodes behind one adapter in a separate process, with commands over its standard input.

    python emulated_can.py LINK N SPEED ORIGIN_WALL ORIGIN [DBC LOST REPEATED | witmotion]

With a DBC file there is a sensor of it as well, with the motion of `imu`, at 1000 Hz, the first in the final line; a
share of its frames is lost or comes twice. Or there is a WT901.

LINK always points to the adapter's port. First line out: "ready". Lines in: `unplug`, `plug`, `end`. Last line out:
scans sent and dropped by each node. Nodes are 1, 2, ...
"""

import sys
from pathlib import Path

from daq import DbcSensor, ScaledClock
from daq.emulator import EmulatedDbc, EmulatedEpsonCan, EmulatedSlcan, EmulatedWitmotionCan, unplugging
from tests.support.daq.emulated_ports import Ramp, reported, say


def imu(file: Path) -> DbcSensor:
    """Return the sensor of examples/imu.dbc."""
    return DbcSensor(file=file, signals=("accX", "accY", "accZ"), counter="Counter", temperature="Temp")


def plugged(link: Path, n: int, clock: ScaledClock, words: list[str]) -> EmulatedSlcan:
    """Return a new adapter with its nodes, at the target of the link."""
    nodes = [EmulatedEpsonCan(Ramp(), clock, node=1 + k, serial_number=100 + k) for k in range(n)]
    sensors: list[EmulatedDbc | EmulatedWitmotionCan] = []
    if words == ["witmotion"]:
        sensors.append(EmulatedWitmotionCan(Ramp(), clock))
    elif words:
        lost, repeated = float(words[1]), float(words[2])
        sensors.append(EmulatedDbc(Ramp(), clock, imu(Path(words[0])), rate=1000.0, lost=lost, repeated=repeated))
    adapter = EmulatedSlcan([*sensors, *nodes])
    link.unlink(missing_ok=True)
    link.symlink_to(adapter.port)
    return adapter


def main() -> None:
    """Serve until the command to end."""
    link, (n, speed, origin_wall, origin) = Path(sys.argv[1]), (int(word) for word in sys.argv[2:6])
    dbc = sys.argv[6:]
    clock = ScaledClock(speed=speed, origin_wall=origin_wall, origin=origin)
    with unplugging([plugged(link, n, clock, dbc)]) as adapters:
        say("ready")
        while (words := reported()) != ["end"]:
            if words == ["unplug"]:
                adapters[-1].close()
            elif words == ["plug"]:
                adapters.append(plugged(link, n, clock, dbc))
            adapters[-1].serve()
        nodes = adapters[-1].nodes
        say({"sent": [node.sent for node in nodes], "dropped": [node.dropped for node in nodes]})


if __name__ == "__main__":
    main()
