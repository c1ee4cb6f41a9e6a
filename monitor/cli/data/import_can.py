"""`import` of a file of CAN traffic."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.markup import escape

from daq import Channel, DbcSensor
from daq.files import LoggedSensor, import_can_log
from monitor.cli.data.import_ import ImportOptions, columns_of, start_of
from monitor.cli.exit_codes import DONE
from monitor.cli.terminal import Terminal
from monitor.errors import ArgumentError
from monitor.service.site import load_site
from updater import parse_structure
from updater.structure import portable_text

_DEVICE = "import"
_AXES = 3

console = Terminal()


def import_can_command(data: Sequence[Path], out: Path, options: ImportOptions) -> int:
    """Write the log and print a summary of each sensor."""
    if len(data) > 1:
        raise ArgumentError("DATA", f"expected one file of CAN traffic, found {len(data)}: {data[0]}, {data[1]}")
    if options.velocities or options.unit is not None:
        raise ArgumentError("--velocity" if options.velocities else "--unit", "not for a CAN log: its DBC file has it")
    if options.new_site is not None:
        raise ArgumentError("--new-site", "not of a CAN log, whose sensors [device.dbc] describes: give --site")
    sensors, channels, attachments = _of_site(options.site) if options.site else _of_options(options)
    if options.structure is not None:
        attachments["structure.toml"] = _structure_text(channels, options.structure)
    start = None if options.start is None else start_of(options.start)
    for found in import_can_log(data[0], out, sensors, channels, attachments, start=start):
        console.print(
            f"{escape(str(out))}: {escape(found.device)}: {found.scans} scans, {found.missing} missing, "
            f"{found.seconds:.6g} s",
            soft_wrap=True,
        )
    return DONE


_What = tuple[list[LoggedSensor], tuple[Channel, ...], dict[str, str]]


def _of_site(path: Path) -> _What:
    """Return the devices of a site, its channels, and the attachments."""
    site = load_site(path)
    sensors = []
    for device in site.settings.device:
        if device.dbc is None:
            raise ArgumentError("--site", f"{path}: device {device.name!r} has no `dbc`: a CAN log holds none of it")
        sensors.append(LoggedSensor(device=device.name, rate=device.rate, sensor=device.dbc.sensor))
    return sensors, site.settings.channels, {"site.toml": site.site_text, "structure.toml": site.structure_text}


def _of_options(options: ImportOptions) -> _What:
    """Return the one sensor that the command line describes."""
    columns = columns_of(options.columns) or {}
    if options.dbc is None or options.counter is None or options.rate is None or not columns:
        raise ArgumentError("--dbc", "expected --site, or --dbc with --counter, --rate and --column SIGNAL[=SENSOR]")
    if len(columns) > _AXES:
        raise ArgumentError("--column", f"expected at most {_AXES} signals of a sensor, found {len(columns)}")
    scale = None if options.scale in (None, 1) else options.scale
    sensor = DbcSensor(file=options.dbc, signals=tuple(columns), counter=options.counter, scale=scale)
    return [LoggedSensor(device=_DEVICE, rate=options.rate, sensor=sensor)], _channels(columns), {}


def _channels(columns: Mapping[str, str]) -> tuple[Channel, ...]:
    return tuple(Channel(name=name, device=_DEVICE, axis=axis) for axis, name in enumerate(columns.values()))


def _structure_text(channels: tuple[Channel, ...], path: Path) -> str:
    """Return the text of a structure file, once all channels are known to be sensors of it."""
    text = portable_text(path)
    known = parse_structure(text, path).channels
    for channel in channels:
        if channel.name not in known:
            raise ArgumentError("--column", f"{channel.name!r} is no sensor of {path}; there are {', '.join(known)}")
    return text
