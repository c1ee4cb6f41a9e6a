"""The virtual rig as a process: a scenario file in, ports and a report out as JSON files."""

import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path

from daq import ScaledClock
from daq.signals import STOP_SIGNALS, signal_event
from daq.timing import SharedTime
from monitor.errors import SettingsError, StartError
from monitor.rig.player import Place, PlayReport, play
from monitor.rig.scenario import RigEvent, Scenario, Vector, load_scenario
from monitor.rig.world import passes
from updater import Structure, load_structure, parse_structure, t_structure_toml

SHIPPED = "t_structure"  #: name of the structure that comes with the program
_ORIGIN = 1_767_225_600_000_000_000  # 2026-01-01: where scaled time begins


def run_rig(
    path: Path,
    *,
    speed: float,
    ports: Path,
    report: Path,
    ready: Callable[[dict[str, object]], None] = lambda _: None,
    happened: Callable[[RigEvent, int], None] = lambda _, __: None,
) -> PlayReport:
    """Run a rig in the main thread of this process until it is over, SIGTERM or SIGINT.

    Parameters
    ----------
    path : SCENARIO.toml
    speed : seconds of data per second of wall time
    ports : file that gets, once devices can be opened, {"clock": .., "ports": {device: path of a serial port, or
        CanAddress's fields}}; the clock is ScaledClock's fields, by which rig and monitor share one time scale, and
        wait together where one of them is held up
    report : file that gets the report at the end
    ready : called with the content of `ports` once it is written
    happened : called with each event and its time [ns UTC]

    Raises
    ------
    SettingsError, StructureError
        If the scenario or its structure cannot be used.
    StartError
        If a file cannot be written.
    ValueError
        If the speed is not positive.
    """
    if not speed > 0:
        raise ValueError(f"speed: expected a positive number, found {speed:g}")
    scenario = load_scenario(path)
    structure = load_rig_structure(path, scenario)
    for old in (ports, report):
        old.unlink(missing_ok=True)  # an earlier rig's file must not be mistaken for this one's
    with signal_event(*STOP_SIGNALS) as stop, tempfile.TemporaryDirectory(prefix="modalwatch-clock-") as folder:
        now, file = time.time_ns(), Path(folder) / "time"
        origin, of_monitor = (now, None) if speed == 1 else (_ORIGIN, str(file))  # real time waits for nobody
        shared = SharedTime(file, origin)
        clock = ScaledClock(speed=speed, origin_wall=now, origin=origin, shared=of_monitor)

        def start(places: Mapping[str, Place]) -> None:
            at = {name: place if isinstance(place, str) else asdict(place) for name, place in places.items()}
            found: dict[str, object] = {"clock": asdict(clock), "ports": at}
            _write(ports, found)
            ready(found)

        done = play(structure, scenario, replace(clock, shared=None), shared, start, stop, happened)
        shared.step(SharedTime.NEVER)  # the monitor's clock goes on
        _write(report, asdict(done))
    return done


def load_rig_structure(path: Path, scenario: Scenario) -> Structure:
    """Return a scenario's nominal structure, with the positions of all its devices and bodies.

    Raises
    ------
    SettingsError
        If one does not; names file, key and point.
    StructureError
        If the structure's file cannot be used.
    """
    shipped = scenario.structure == SHIPPED
    structure = parse_structure(t_structure_toml()) if shipped else load_structure(path.parent / scenario.structure)
    for key, at in _points(scenario):
        if not any(passes(member, at) for member in structure.member):
            raise SettingsError(path, f"{key}: expected a point on a member of {structure.name}, found {list(at)}")
    length = {member.name: member.length for member in structure.member}
    for i, event in enumerate(scenario.event):
        if event.crack and not event.crack.distance < length.get(event.crack.member, 0.0):
            raise SettingsError(
                path,
                f"event.{i}.crack: expected a distance on a member ({', '.join(length)}), "
                f"found {event.crack.distance:g} m on {event.crack.member!r}",
            )
    return structure


def _points(scenario: Scenario) -> Iterator[tuple[str, Vector]]:
    for i, device in enumerate(scenario.device):
        yield f"device.{i}.at", device.at
    for i, event in enumerate(scenario.event):
        if event.body:
            yield f"event.{i}.body.at", event.body.at


def _write(path: Path, content: object) -> None:
    """Write a file atomically."""
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(json.dumps(content), encoding="utf-8")
        os.replace(part, path)
    except OSError as error:
        raise StartError(f"{path}: cannot be written: {error.strerror}") from error
