"""`repair`, `log info` and `log export`."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from daq import DeviceInfo, LogError, LogInfo, export_recording, log_info, repair_log
from monitor.cli.files import write_json
from monitor.recordings import log_recordings

console = Console(highlight=False)


def repair_command(path: Path) -> int:
    """Mend a log; say what it was worth."""
    state = repair_log(path)
    if state.whole:
        console.print(f"{escape(str(path))}: whole, {state.n_messages} messages; not touched", soft_wrap=True)
    else:
        console.print(f"{escape(str(path))}: mended, {state.n_messages} messages kept; it was {state}", soft_wrap=True)
    return 0


def info_command(path: Path, json_path: Path | None) -> int:
    """Say what is in a log."""
    info = log_info(path)
    _say(path, info)
    if json_path:
        write_json(json_path, as_json(path, info))
    return 0


def export_command(path: Path, out: Path) -> int:
    """Write the signals of a log to a file of measurements."""
    recordings = list(log_recordings(path))
    if not recordings:
        raise LogError(path, "holds less than the two seconds that the clocks need")
    export_recording(out, recordings[0])
    found = recordings[0]
    console.print(
        f"{escape(str(out))}: {len(found.channels)} channels, {found.duration:.6g} s at {found.rate:g} Hz, "
        f"{len(found.gaps)} gaps; it starts at {found.start} ns UTC",
        soft_wrap=True,
    )
    return 0


def as_json(path: Path, info: LogInfo) -> dict[str, Any]:
    """Return what other programs read; times are ns UTC."""
    return {
        "file": str(path),
        "bytes": info.size,
        "state": str(info.state),
        "whole": info.state.whole,
        "messages": info.state.n_messages,
        "start": info.start,
        "end": info.end,
        "devices": {name: _device_json(device) for name, device in info.devices.items()},
        "events": info.events,
        "attachments": info.attachments,
    }


def _device_json(device: DeviceInfo) -> dict[str, Any]:
    return {
        "rate": device.rate,
        "axes": device.n_axes,
        "scale": device.scale,
        "start": device.start,
        "end": device.end,
        "scans": device.n_scans,
        "missing": device.missing,
        "gaps": device.gaps,
        "restarts": device.restarts,
        "temperature": _mean(device.temperatures),
    }


def _mean(values: list[float]) -> float | None:
    return sum(values) / len(values) if values else None


def _say(path: Path, info: LogInfo) -> None:
    table = Table(title=escape(path.name), box=SIMPLE_HEAD)
    for name in ("device", "Hz", "axes", "scans", "s", "gaps", "missing", "restarts", "°C"):
        table.add_column(name, justify="left" if name == "device" else "right", no_wrap=True)
    for name, device in info.devices.items():
        temperature = _mean(device.temperatures)
        figures = [f"{device.rate:g}", str(device.n_axes), str(device.n_scans)]
        figures += [f"{(device.end - device.start) * 1e-9:.2f}", str(device.gaps), str(device.missing)]
        figures += [str(device.restarts), "-" if temperature is None else f"{temperature:.1f}"]
        table.add_row(escape(name), *figures)
    console.print(table)
    if info.start is not None and info.end is not None:
        console.print(f"{_utc(info.start)} to {_utc(info.end)}, {(info.end - info.start) * 1e-9:.2f} s")
    console.print(f"state: {info.state}; {info.size / 1e6:.2f} MB, {info.state.n_messages} messages")
    said = ", ".join(f"{topic} {count}" for topic, count in sorted(info.events.items()))
    console.print(f"events and results: {escape(said) or 'none'}")
    console.print(f"attached: {escape(', '.join(info.attachments)) or 'nothing'}")
    if not info.state.whole:
        console.print(f"mend it: modalwatch repair {escape(str(path))}", soft_wrap=True)


def _utc(time: int) -> str:
    return datetime.fromtimestamp(time // 10**9, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
