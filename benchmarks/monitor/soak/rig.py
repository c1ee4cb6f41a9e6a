"""Rig of the soak: a moving T-frame, emulated accelerometers on ptys with the number of the scan in every scan.

    python soak_rig.py FOLDER N SECONDS MASS_AT

Serves until standard input ends. First line out: the devices as JSON. Lines in: `unplug NAME`, `plug NAME`, `babble
NAME` (plug, with random bytes first). FOLDER/NAME is a link to the port, as /dev/serial/by-id is. FOLDER/sent.jsonl
gets a line twenty times a second: wall time [ns] and how many scans each device has taken.

The axis that is logged but not analysed counts scans, from 0 on and through all restarts of the device.
"""

import json
import os
import select
import sys
import time
from pathlib import Path
from typing import Literal

import numpy as np

from daq import IntArray, SystemClock
from daq.emulator import EmulatedEpson, LineFaults, LineSpell, serve_all
from monitor.rig import T_DEVICES, RigDevice, RigEvent, Scenario, make_sources
from updater import Body, parse_structure, t_structure_toml

CYCLE = 600.0  # s: after which the faults come again
SILENCE = "beam_right", 100.0, 6.0  # device, since it first sampled, how long [s]
CUT = "col_111", 130.0, 3.0
DRIFT = "beam_left", 50e-6  # device, of its clock
LEDGER = "sent.jsonl"
MIN = 60.0  # s between the end of a fault and that of the soak: shorter ones leave it out
What = Literal["silent", "cut"]
_TICK, _LEDGER = 0.004, 0.05  # s
_BABBLE = 20_000  # bytes
_MASS = 0.25  # kg


def places(n: int) -> dict[str, tuple[tuple[float, float, float], str]]:
    """Return name -> place and analysed axes: the six of the reference rig first, the others up the column."""
    found = dict(T_DEVICES)
    for k in range(n - len(found)):
        found[f"more_{k:02}"] = (0.0, 0.0, round(0.20 + 1.2 * k / max(1, n - 7), 4)), "xy"
    return dict(list(found.items())[:n])


def first_sampled(folder: Path, name: str) -> int:
    """Return when a device took its first scans [ns UTC], to a line of the ledger: its spells are timed from there."""
    with (folder / LEDGER).open(encoding="utf-8") as file:
        return next(int(line["time"]) for line in map(json.loads, file) if line["taken"][name])


class Numbered:
    """Motion measured by a device, with the number of the scan on the axis that is not analysed."""

    def __init__(self, source: object, axes: str) -> None:
        self._source, self._axis = source, next(i for i, axis in enumerate("xyz") if axis not in axes)
        self.taken = 0

    def start(self, time: int, rate: float) -> None:
        """Start, or start again."""
        self._source.start(time, rate)  # type: ignore[attr-defined]

    def read(self, index: int, n: int) -> IntArray:
        """Return scans (n, 3)."""
        counts: IntArray = self._source.read(index, n).copy()  # type: ignore[attr-defined]
        counts[:, self._axis] = np.arange(self.taken, self.taken + n)
        self.taken += n
        return counts


class Rig:
    """Devices that can be pulled and plugged."""

    def __init__(self, folder: Path, n: int, seconds: float, mass_at: float) -> None:
        at = places(n)
        body = Body(mass=_MASS, at=(0.0, 0.0, 0.92))
        scenario = Scenario(
            structure="t_structure",
            seed=7,
            duration=0,
            device=tuple(RigDevice(name=name, at=place) for name, (place, _) in at.items()),
            event=(RigEvent(at=mass_at, body=body),),
        )
        self.world, sources = make_sources(parse_structure(t_structure_toml()), scenario)
        self.sources = {name: Numbered(s, at[name][1]) for name, s in zip(at, sources, strict=True)}
        self._folder, self._seconds = folder, seconds
        self.devices: dict[str, EmulatedEpson] = {}
        for name in at:
            self.plug(name, babble=0)

    def plug(self, name: str, babble: int) -> None:
        """Plug a device in, at the place that its link always names."""
        spells = tuple(self._spells(name)) if name not in self.devices else ()
        faults = LineFaults(spells=spells, latency=0.001, babble=babble)
        error = DRIFT[1] if name == DRIFT[0] else 0.0
        number = name[-8:].upper()
        device = EmulatedEpson(
            self.sources[name], SystemClock(), serial_number=number, clock_error=error, faults=faults
        )
        link = self._folder / name
        link.unlink(missing_ok=True)
        link.symlink_to(device.port)
        self.devices[name] = device

    def _spells(self, name: str) -> list[LineSpell]:
        happens = SILENCE if name == SILENCE[0] else CUT if name == CUT[0] else None
        if happens is None:
            return []
        _, at, seconds = happens
        begins = [at + CYCLE * k for k in range(int(self._seconds // CYCLE) + 1)]
        what: What = "silent" if happens is SILENCE else "cut"
        return [LineSpell(what=what, at=t, seconds=seconds) for t in begins if t + seconds + MIN < self._seconds]

    def obey(self, line: str) -> None:
        """Execute a command line."""
        what, _, name = line.partition(" ")
        if what == "unplug":
            (self._folder / name).unlink()
            self.devices[name].close()
        else:
            self.plug(name, babble=_BABBLE if what == "babble" else 0)

    @property
    def taken(self) -> dict[str, int]:
        """Scans that each device has taken so far."""
        return {name: source.taken for name, source in self.sources.items()}


def main() -> None:
    """Serve."""
    folder, n = Path(sys.argv[1]), int(sys.argv[2])
    rig = Rig(folder, n, float(sys.argv[3]), float(sys.argv[4]))
    print(json.dumps(list(rig.devices)), flush=True)
    begun, turn, due, text = False, 0, 0.0, b""
    with (folder / LEDGER).open("w", encoding="utf-8", buffering=1) as ledger:
        while True:
            if select.select([0], [], [], _TICK)[0]:
                label = os.read(0, 4096)
                if not label:
                    return
                *lines, text = (text + label).split(b"\n")
                for line in lines:
                    rig.obey(line.decode())
            rig.world.keep_up(time.time_ns())
            serve_all(list(rig.devices.values()), turn := turn + 1)
            if not begun and all(device.sampling_since for device in rig.devices.values()):
                begun = True
                rig.world.begin(time.time_ns() + 2_000_000_000)
            if time.monotonic() >= due:
                due = time.monotonic() + _LEDGER
                ledger.write(json.dumps({"time": time.time_ns(), "taken": rig.taken}) + "\n")


if __name__ == "__main__":
    main()
