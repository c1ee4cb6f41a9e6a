"""SITE.toml for the sensors of a structure: one device per place."""

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from daq.drivers import driver_names
from monitor.cli.options import DONE
from monitor.cli.output import asked, write_new
from monitor.cli.terminal import echo
from monitor.errors import ArgumentError
from monitor.settings import AXES, AnalysisSettings, DeviceSettings, Settings, annotated
from updater import load_structure
from updater.structure import Sensor


def axis_channels(sensors: Sequence[Sensor]) -> dict[str, str]:
    """Return device axis -> channel: the axis along the sensor's direction if it is free, else the first free one."""
    found: dict[str, str] = {}
    oblique: list[Sensor] = []
    for sensor in sensors:
        along = max(range(3), key=lambda axis, sensor=sensor: abs(sensor.direction[axis]))  # type: ignore[misc]
        straight = sum(bool(part) for part in sensor.direction) == 1
        if straight and AXES[along] not in found:
            found[AXES[along]] = sensor.channel
        else:
            oblique.append(sensor)
    free = (axis for axis in AXES if axis not in found)
    found |= {next(free): sensor.channel for sensor in oblique}
    return dict(sorted(found.items()))


_NOT_OFFERED = ("nidaqmx", "replay")  # they have no port


def write_site(
    path: Path,
    structure: Path,
    *,
    driver: str | None,
    ports: Sequence[str],
    can: str | None,
    rate: float,
    window: float,
    force: bool,
) -> int:
    """Write the site of a structure file, all settings with their meaning; what is not given is asked for.

    Raises
    ------
    StructureError
        If the structure file cannot be used.
    ArgumentError
        If something is missing or invalid, or the file exists.
    """
    places = list(_places(load_structure(structure).sensor))
    if not places:
        raise ArgumentError("STRUCTURE.toml", f"{structure} has no sensors")
    drivers = [name for name in driver_names() if name not in _NOT_OFFERED]
    driver = driver or asked("--driver", "driver of the devices", drivers)
    if driver == "replay":
        raise ArgumentError(
            "--driver",
            "replay reads a log, which contains its devices: `modalwatch import FILES -o run.mcap --structure "
            f"{structure} --new-site {path}` writes the settings of files of measurements; a log of `run` has its "
            "settings attached: `modalwatch replay run.mcap`",
        )
    if driver not in drivers:
        raise ArgumentError("--driver", f"expected one of {', '.join(drivers)}, found {driver!r}")
    if len(ports) > len(places):
        raise ArgumentError("--port", f"{len(ports)} ports for {len(places)} places of sensors")
    named = [_name(sensors, number) for number, sensors in enumerate(places, 1)]
    names = [name if named.count(name) == 1 else f"{name}_{k}" for k, name in enumerate(named, 1)]
    try:
        devices = tuple(
            DeviceSettings.model_validate(
                {
                    "name": name,
                    "driver": driver,
                    "rate": rate,
                    "channels": axis_channels(sensors),
                    **(_on_bus(can, number) if can else {"port": _port(ports, number, name, sensors[0])}),
                }
            )
            for number, (name, sensors) in enumerate(zip(names, places, strict=True))
        )
        file = Path(os.path.relpath(structure.resolve(), path.resolve().parent)).as_posix()
        settings = Settings(structure=file, device=devices, analysis=AnalysisSettings(window_seconds=window))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise ArgumentError("new site", f"{where}: {first['msg'].removeprefix('Value error, ')}") from error
    write_new(path, annotated(settings), force=force)
    echo(f"written: {path}: {len(devices)} devices, {sum(map(len, places))} channels")
    echo(f"next: edit it, then check it and the devices: modalwatch check {path}")
    return DONE


def _places(sensors: Sequence[Sensor]) -> Iterator[list[Sensor]]:
    """Yield the sensors of each place, three at most."""
    together: dict[tuple[float, ...], list[Sensor]] = {}
    for sensor in sensors:
        together.setdefault(tuple(sensor.at), []).append(sensor)
    for own in together.values():
        yield from (own[k : k + len(AXES)] for k in range(0, len(own), len(AXES)))


def _name(sensors: Sequence[Sensor], number: int) -> str:
    """Return the name of the channels without their axes if it is one, else a number."""
    stems = {re.sub("[_.-]?[xyz]$", "", sensor.channel) for sensor in sensors}
    name = re.sub(r"[^\w.-]+", "_", stems.pop()) if len(stems) == 1 else ""
    return name or f"device_{number}"


def _port(ports: Sequence[str], number: int, name: str, sensor: Sensor) -> str:
    if number < len(ports):
        return ports[number]
    at = ", ".join(f"{c:g}" for c in sensor.at)
    return asked("--port", f"serial port of device {name} at [{at}] m")


def _on_bus(can: str, number: int) -> dict[str, Any]:
    """Return the place of a device on a bus; nodes are numbered from 1."""
    interface, _, channel = can.partition(":")
    if not channel:
        raise ArgumentError("--can", f"expected INTERFACE:CHANNEL, found {can!r}")
    return {"can": {"interface": interface, "channel": channel, "node": number + 1}}
