"""Connected devices, with settings to paste."""

import json
import re
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from daq import CanAddress, DriverError, search_port, serial_ports
from daq.drivers import Found, PortAnswer, SerialPortInfo, TextAddress, can_adapters, daqmx_devices
from monitor.cli.options import DONE
from monitor.cli.output import write_json
from monitor.cli.terminal import console, echo, new_table, progress, start_error
from monitor.settings import AXES

Seen = PortAnswer | str | None  #: an answer, why there is none, or silence


def list_devices(paths: Sequence[str], json_path: Path | None, *, probe: bool, every: bool, bitrate: int) -> int:
    """Print connected devices; every given port must answer.

    Raises
    ------
    StartError
        If a port that was named cannot be opened, or nothing that is known answers there.
    """
    ports = _named(paths) if paths else serial_ports()
    adapters = [] if paths else can_adapters()
    analog = [] if paths else daqmx_devices()
    wanted = [port for port in ports if probe and (paths or every or port.is_usb)]
    with progress(f"querying {len(wanted)} ports"):
        seen = dict(zip((port.path for port in wanted), _asked_at_once(wanted, bitrate), strict=True))
    console.print(_table(ports, adapters, analog, seen))
    found = [device for answer in seen.values() if isinstance(answer, PortAnswer) for device in answer.devices]
    echo(settings_for(found))
    if json_path is not None:
        write_json(json_path, _as_json(ports, adapters, analog, seen))
    silent = [_why(path, answer) for path, answer in seen.items() if not isinstance(answer, PortAnswer)]
    if silent and paths:
        raise start_error(silent)
    return DONE


def _named(paths: Sequence[str]) -> list[SerialPortInfo]:
    return [SerialPortInfo(device=path, by_id=None, description="", is_usb=False) for path in dict.fromkeys(paths)]


def _asked_at_once(ports: Sequence[SerialPortInfo], bitrate: int) -> list[Seen]:
    def ask(port: SerialPortInfo) -> Seen:
        try:
            return search_port(port.path, bitrate)
        except DriverError as error:
            return str(error)

    with ThreadPoolExecutor(max(1, len(ports))) as pool:
        return list(pool.map(ask, ports))


def _why(path: str, answer: Seen) -> str:
    return answer if isinstance(answer, str) else f"{path}: no device that is known answers"


def _table(
    ports: Sequence[SerialPortInfo],
    adapters: Sequence[tuple[str, str]],
    analog: Sequence[tuple[str, str, list[str]]],
    seen: dict[str, Seen],
) -> Table:
    table = new_table(("port", "system's name", "what", "who answers"), overflow="fold")
    for port in ports:
        answer = seen.get(port.path, "not queried")
        who = answer.who if isinstance(answer, PortAnswer) else answer or "no known device"
        if isinstance(answer, PortAnswer):
            nodes = [(d.place.node, d.identity) for d in answer.devices if isinstance(d.place, CanAddress)]
            who += "".join(f"\nnode {node}: {identity}" for node, identity in nodes)
        system = port.device if port.by_id else ""
        what = port.description or ("network" if "://" in port.path else "serial port")
        table.add_row(*(escape(text) for text in (port.path, system, what, who)))
    for interface, channel in adapters:
        table.add_row(escape(channel), "", escape(f"CAN, interface {interface}"), "not queried")
    for name, product, inputs in analog:
        table.add_row(escape(name), "", escape(f"NI-DAQmx, {product}"), escape(f"inputs {inputs[0]} to {inputs[-1]}"))
    if not ports and not adapters and not analog:
        table.add_row("none", "", "", "")
    return table


def settings_for(found: Sequence[Found]) -> str:
    """Return the devices as settings (TOML): names and sensors are to be changed, the rest is as found."""
    if not found:
        return "# no device was found"
    lines: list[str] = []
    names: set[str] = set()
    for number, device in enumerate(found, 1):
        name = re.sub(r"\W+", "_", f"device_{device.identity.serial or number}")
        name = f"{name}_{number}" if name in names else name
        names.add(name)
        axes = ", ".join(f'{AXES[axis]} = "{name}_{AXES[axis]}"' for axis in device.axes)
        lines += [
            f"[[device]]  # {device.identity}",
            f'name = "{name}"',
            f'driver = "{device.driver}"',
            _place(device.place),
            f"rate = {device.rate:g}",
            f"channels = {{{axes}}}  # device axis = sensor of your structure",
            "",
        ]
    return "\n".join(lines)


def _place(place: str | CanAddress | TextAddress) -> str:
    if isinstance(place, str):
        return f"port = {json.dumps(place)}"
    if isinstance(place, TextAddress):
        form = place.form
        words = [f"columns = {json.dumps(form.columns)}"]
        words.append(f"scale = {form.scale:g}" if form.unit is None else f'unit = "{form.unit}"')
        if form.decimal_comma:
            words.append("decimal_comma = true")
        if place.baud != TextAddress.baud:
            words.append(f"baud = {place.baud}")
        return f"port = {json.dumps(place.port)}\ntext = {{{', '.join(words)}}}"
    words = [f'interface = "{place.interface}"', f"channel = {json.dumps(place.channel)}", f"node = {place.node}"]
    if place.bitrate != 1_000_000:
        words.append(f"bitrate = {place.bitrate}")
    return f"can = {{{', '.join(words)}}}"


def _as_json(
    ports: Sequence[SerialPortInfo],
    adapters: Sequence[tuple[str, str]],
    analog: Sequence[tuple[str, str, list[str]]],
    seen: dict[str, Seen],
) -> dict[str, Any]:
    def answer_of(port: SerialPortInfo) -> dict[str, Any]:
        answer = seen.get(port.path)
        if isinstance(answer, PortAnswer):
            return {
                "who": answer.who,
                "devices": [asdict(d) | {"identity": d.identity.payload()} for d in answer.devices],
            }
        return {"who": None, "devices": [], "why": answer if port.path in seen else "not queried"}

    return {
        "ports": [asdict(port) | answer_of(port) for port in ports],
        "can": [{"interface": interface, "channel": channel} for interface, channel in adapters],
        "daqmx": [{"device": name, "product": product, "inputs": inputs} for name, product, inputs in analog],
    }
