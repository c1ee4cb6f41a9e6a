"""Summary of a log."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.markup import escape

from daq import AnyLog, inspect_log
from daq.log import DeviceInfo, LogInfo, files_of, log_info
from monitor.cli.logs.run_log import one_log
from monitor.cli.options import DONE
from monitor.cli.output import write_json
from monitor.cli.terminal import console, echo, files_of_logs, new_table, progress


def summarize(paths: Sequence[Path], json_path: Path | None) -> int:
    """Print a summary of a log."""
    log = one_log(paths)
    with progress("reading", files_of_logs([log])):
        info = log_info(log)
    _say(log, info)
    if json_path:
        write_json(json_path, as_json(log, info))
    return DONE


def as_json(log: AnyLog, info: LogInfo) -> dict[str, Any]:
    """Return the output for other programs; times are ns UTC."""
    return {
        "file": str(log),
        "files": [str(path) for path in files_of(log)],
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


def _say(log: AnyLog, info: LogInfo) -> None:
    names = ("Hz", "axes", "scans", "s", "gaps", "missing", "restarts", "°C")
    table = new_table(("device",), names, no_wrap=True, pad_edge=False, title=log.name)
    for name, device in info.devices.items():
        temperature = _mean(device.temperatures)
        figures = [f"{device.rate:g}", str(device.n_axes), str(device.n_scans)]
        figures += [f"{(device.end - device.start) * 1e-9:.1f}", str(device.gaps), str(device.missing)]
        figures += [str(device.restarts), "-" if temperature is None else f"{temperature:.1f}"]
        table.add_row(escape(name), *figures)
    console.print(table)
    if info.start is not None and info.end is not None:
        console.print(f"{_utc(info.start)} to {_utc(info.end)}, {(info.end - info.start) * 1e-9:.2f} s")
    console.print(f"state: {info.state}; {info.size / 1e6:.2f} MB, {info.state.n_messages} messages")
    text = ", ".join(f"{topic} {count}" for topic, count in sorted(info.events.items()))
    console.print(f"events and results: {escape(text) or 'none'}")
    console.print(f"attached: {escape(', '.join(info.attachments)) or 'nothing'}")
    if not info.state.whole:
        for path in files_of(log):
            if not inspect_log(path).whole:
                echo(f"repair it: modalwatch repair {path}")


def _utc(time: int) -> str:
    return datetime.fromtimestamp(time // 10**9, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
