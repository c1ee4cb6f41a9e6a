"""The virtual rig as a process: emulated devices on ptys, a world that moves, a timeline of what happens."""

import json
import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from daq import EmulatedEpson, HostClock, ScaledClock, serve_all, unplugging
from monitor.rig.scenario import Scenario, load_scenario
from monitor.rig.truth import World, describe, make_sources
from updater import Structure, load_structure

_TICK = 0.004  # s of wall time between servings
_ORIGIN = 1_767_225_600_000_000_000  # 2026-01-01: where scaled time begins


@dataclass(frozen=True, kw_only=True)
class PlayReport:
    """What the rig did."""

    sent: int  #: frames handed to the ptys
    dropped: int  #: frames that found a full pty
    events: tuple[int, ...]  #: times of the scenario's events that came to pass [ns UTC]


def play(
    structure: Structure,
    scenario: Scenario,
    clock: HostClock,
    ready: Callable[[dict[str, str]], None],
    stop: threading.Event,
) -> PlayReport:
    """Play a scenario until its duration is over or `stop` is set.

    Devices sample from when they are told to. The timeline counts from when the last of them began; a device not asked
    for yet keeps everything waiting.

    Parameters
    ----------
    structure : nominal
    scenario : of the rig
    clock : of the world
    ready : called once with device -> port
    stop : ends it early
    """
    world, sources = make_sources(structure, scenario)
    devices = [
        EmulatedEpson(source, clock, serial_number=describe(device), clock_error=device.clock_error)
        for device, source in zip(scenario.device, sources, strict=True)
    ]
    with unplugging(devices):
        ready({device.name: emulated.port for device, emulated in zip(scenario.device, devices, strict=True)})
        events = _serve(devices, scenario, world, clock, stop)
    return PlayReport(sent=sum(d.sent for d in devices), dropped=sum(d.dropped for d in devices), events=events)


def _serve(
    devices: list[EmulatedEpson],
    scenario: Scenario,
    world: World,
    clock: HostClock,
    stop: threading.Event,
) -> tuple[int, ...]:
    begun: int | None = None
    turn = 0
    while not stop.wait(_TICK):
        turn += 1
        serve_all(devices, turn)
        since = [d.sampling_since for d in devices]
        if begun is None:
            times = [t for t in since if t is not None]
            if len(times) == len(devices):
                begun = max(times)
                for event in scenario.event:
                    world.schedule(event.body, begun + round(event.at * 1e9))
        elif clock.now() - begun > scenario.duration * 1e9 or not any(since):
            break
    end = clock.now()
    planned = [begun + round(event.at * 1e9) for event in scenario.event] if begun else []
    return tuple(time for time in planned if time < end)


def run_rig(path: Path, *, speed: float, ports: Path, report: Path) -> PlayReport:
    """Run a rig as this process until it is over, SIGTERM or SIGINT.

    Parameters
    ----------
    path : SCENARIO.toml
    speed : seconds of data a second of wall time
    ports : file that gets, once devices can be opened, {"clock": .., "ports": {device: path}}
    report : file that gets the report at the end

    Raises
    ------
    SettingsError, StructureError
        If the scenario or its structure cannot be used.
    """
    scenario = load_scenario(path)
    structure = load_structure(path.parent / scenario.structure)
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    clock = ScaledClock(speed=speed, origin_wall=time.time_ns(), origin=_ORIGIN if speed != 1 else time.time_ns())

    def ready(found: dict[str, str]) -> None:
        _write(ports, {"clock": asdict(clock), "ports": found})

    done = play(structure, scenario, clock, ready, stop)
    _write(report, asdict(done))
    return done


def _write(path: Path, content: object) -> None:
    """Write a file so that a reader sees it whole or not at all."""
    part = path.with_suffix(".part")
    part.write_text(json.dumps(content), encoding="utf-8")
    os.replace(part, path)
