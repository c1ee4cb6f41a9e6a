"""File of CAN traffic as a log."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from daq import Channel, DbcSensor
from daq.files import LoggedSensor, import_can_log
from monitor.cli.options import DONE
from monitor.cli.terminal import echo, progress
from monitor.errors import ArgumentError
from monitor.service.site import load_site
from updater import parse_structure
from updater.structure import no_sensor_text, portable_text

_DEVICE = "import"
_AXES = 3


@dataclass(frozen=True, kw_only=True)
class CanSource:
    """Sensors of a file of CAN traffic."""

    sensors: list[LoggedSensor]
    channels: tuple[Channel, ...]
    attachments: dict[str, str]  #: texts of SITE.toml and the structure, by name


def import_can_traffic(data: Path, out: Path, source: CanSource, structure: Path | None, start: int | None) -> int:
    """Write the log and print a summary of each sensor."""
    attachments = source.attachments
    if structure is not None:
        attachments = attachments | {"structure.toml": _structure_text(source.channels, structure)}
    with progress("reading", [data]):
        written = import_can_log(data, out, source.sensors, source.channels, attachments, start=start)
    for found in written:
        echo(f"{out}: {found.device}: {found.scans} scans, {found.missing} missing, {found.seconds:.6g} s")
    return DONE


def site_sensors(path: Path) -> CanSource:
    """Return the devices of a site."""
    site = load_site(path)
    sensors = []
    for device in site.settings.device:
        if device.dbc is None:
            raise ArgumentError("--site", f"{path}: device {device.name!r} has no `dbc`: the log has no data of it")
        sensors.append(LoggedSensor(device=device.name, rate=device.rate, sensor=device.dbc.sensor))
    return CanSource(sensors=sensors, channels=site.settings.channels, attachments=site.attachments)


def one_sensor(
    dbc: Path | None, counter: str | None, rate: float | None, columns: Mapping[str, str], scale: float | None
) -> CanSource:
    """Return the one sensor that the command line describes."""
    if dbc is None or counter is None or rate is None or not columns:
        raise ArgumentError("--dbc", "expected --site, or --dbc with --counter, --rate and --column SIGNAL[=SENSOR]")
    if len(columns) > _AXES:
        raise ArgumentError("--column", f"expected at most {_AXES} signals of a sensor, found {len(columns)}")
    sensor = DbcSensor(file=dbc, signals=tuple(columns), counter=counter, scale=None if scale == 1 else scale)
    channels = tuple(Channel(name=name, device=_DEVICE, axis=axis) for axis, name in enumerate(columns.values()))
    return CanSource(
        sensors=[LoggedSensor(device=_DEVICE, rate=rate, sensor=sensor)], channels=channels, attachments={}
    )


def _structure_text(channels: tuple[Channel, ...], path: Path) -> str:
    """Return the text of a structure file, once all channels are known to be sensors of it."""
    text = portable_text(path)
    known = parse_structure(text, path).channels
    for channel in channels:
        if channel.name not in known:
            raise ArgumentError("--column", no_sensor_text(channel.name, known, path))
    return text
