"""`repair`, `log info`, `log export` and `log expand`."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from daq import AnyLog, LogError, export_recording, inspect_log, repair_log
from daq.files import expand_log
from daq.log import DeviceInfo, LogInfo, PartedLog, as_logs, files_of, log_info, newest_log
from monitor.analysis.logs import log_recordings
from monitor.analysis.time_range import WHOLE, TimeRange
from monitor.cli.exit_codes import DONE
from monitor.cli.output import write_json
from monitor.cli.terminal import Terminal, say_range
from monitor.errors import ArgumentError
from monitor.views.run import late_devices

console = Terminal()


def repair_command(path: Path) -> int:
    """Repair a log and print the kept part."""
    state = repair_log(path)
    if state.whole:
        console.print(f"{escape(str(path))}: whole, {state.n_messages} messages; not touched", soft_wrap=True)
    else:
        console.print(
            f"{escape(str(path))}: repaired, {state.n_messages} messages kept; it was {state}", soft_wrap=True
        )
    return DONE


def info_command(paths: Sequence[Path], json_path: Path | None) -> int:
    """Print a summary of a log."""
    log = one_log(paths)
    info = log_info(log)
    _say(log, info)
    if json_path:
        write_json(json_path, as_json(log, info))
    return DONE


def one_log(paths: Sequence[Path]) -> Path | PartedLog:
    """Return the one log that paths mean: a file, files of one run, or of a folder the newest run.

    Raises
    ------
    ArgumentError
        If they are logs of more than one run.
    LogError
        If a folder holds no log.
    """
    if len(paths) == 1:
        return newest_log(paths[0])
    logs = as_logs(paths)
    if len(logs) > 1:
        raise ArgumentError(
            "LOG",
            f"expected the files of one run, found those of {len(logs)}: {logs[0]}, {logs[1]}; "
            "tables that follow each other become one log by `modalwatch import DATA... -o LOG.mcap`",
        )
    return logs[0]


def export_command(paths: Sequence[Path], out: Path, within: TimeRange = WHOLE) -> int:
    """Write the signals of a log, or of a range of it, to a file of measurements."""
    whole = one_log(paths)
    log = within.of_log(whole, say_range)
    late = late_devices(whole)
    recordings = list(log_recordings(log, late=late))
    if not recordings:
        raise LogError(str(log), "holds less than the two seconds that the clocks need")
    export_recording(out, recordings[0])
    found = recordings[0]
    console.print(
        f"{escape(str(out))}: {len(found.channels)} channels, {found.duration:.6g} s at {found.rate:g} Hz, "
        f"{len(found.gaps)} gaps; it starts at {found.start} ns UTC",
        soft_wrap=True,
    )
    _say_late(late)
    return DONE


def expand_command(paths: Sequence[Path], out: Path, within: TimeRange = WHOLE) -> int:
    """Write the signals of a log, or of a range of it, for stock viewers."""
    whole = one_log(paths)
    log = within.of_log(whole, say_range)
    with console.status("writing ..."):
        late = late_devices(whole)
        written = expand_log(log, out, late)
    devices = ", ".join(f"/view/{device} {count}" for device, count in written.items())
    console.print(f"{escape(str(out))}: {sum(written.values())} messages; {escape(devices)}", soft_wrap=True)
    _say_late(late)
    return DONE


def _say_late(late: Mapping[str, float]) -> None:
    """Print the delays that were removed."""
    if late:
        text = ", ".join(f"{device} {1e3 * seconds:+.3f} ms" for device, seconds in late.items())
        console.print(f"removed, as the baseline found devices late: {escape(text)}", soft_wrap=True)


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
    table = Table(title=escape(log.name), box=SIMPLE_HEAD)
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
    text = ", ".join(f"{topic} {count}" for topic, count in sorted(info.events.items()))
    console.print(f"events and results: {escape(text) or 'none'}")
    console.print(f"attached: {escape(', '.join(info.attachments)) or 'nothing'}")
    if not info.state.whole:
        for path in files_of(log):
            if not inspect_log(path).whole:
                console.print(f"repair it: modalwatch repair {escape(str(path))}", soft_wrap=True)


def _utc(time: int) -> str:
    return datetime.fromtimestamp(time // 10**9, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
