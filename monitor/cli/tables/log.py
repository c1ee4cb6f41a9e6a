"""`modalwatch log`: its table of commands."""

from pathlib import Path
from typing import Annotated

import typer

from monitor.cli.range_options import From, To

log_app = typer.Typer(no_args_is_help=True, help="Look into logs.")

_Logs = Annotated[list[Path], typer.Argument(metavar="LOG.mcap...|DIR", help="A log, files of a run, or its folder.")]


@log_app.command("info")
def log_info(
    log: _Logs,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="File that gets the figures.")] = None,
) -> None:
    """Say what is in a log: devices, scans, gaps, events, attachments, cut or whole."""
    from monitor.cli.data.log import info_command

    raise typer.Exit(info_command(log, json))


@log_app.command("export")
def log_export(
    log: _Logs,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DATA", help="New .csv, .npz, .mat or .uff.")],
    start: From = None,
    stop: To = None,
) -> None:
    """Write the signals of a log, on one time grid, to a file that other programs and `import` read.

    Delays of devices that the log's newest baseline has found are removed; `import` restores devices and start.
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.log import export_command

    raise typer.Exit(export_command(log, out, time_range(start, stop)))


@log_app.command("expand")
def log_expand(
    log: _Logs,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="VIEW.mcap", help="New MCAP file of ROS 2 messages.")],
    start: From = None,
    stop: To = None,
) -> None:
    """Write the signals of a log, a message a scan, to a file that stock rerun and Foxglove plot."""
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.log import expand_command

    raise typer.Exit(expand_command(log, out, time_range(start, stop)))
