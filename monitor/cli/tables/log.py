"""Signatures of the commands of `modalwatch log`."""

from pathlib import Path
from typing import Annotated

import typer

from monitor.cli.range_options import From, To

log_app = typer.Typer(no_args_is_help=True, help="Inspect and export logs.")

_Logs = Annotated[list[Path], typer.Argument(metavar="LOG.mcap...|DIR", help="Logs, or the folder of a run.")]


@log_app.command("info")
def log_info(
    log: _Logs,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="JSON file to write.")] = None,
) -> None:
    """Summarize a log.

    Devices, scans, gaps, events, attachments, completeness.
    """
    from monitor.cli.data.log import info_command

    raise typer.Exit(info_command(log, json))


@log_app.command("export")
def log_export(
    log: _Logs,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DATA", help="File to write: .csv, .npz, .mat or .uff.")],
    start: From = None,
    stop: To = None,
) -> None:
    """Export the signals of a log on one time grid.

    Device delays found by the newest baseline of the log are removed. `import` restores devices and start time.
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.log import export_command

    raise typer.Exit(export_command(log, out, time_range(start, stop)))


@log_app.command("expand")
def log_expand(
    log: _Logs,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="VIEW.mcap", help="MCAP file to write, with ROS 2 messages.")
    ],
    start: From = None,
    stop: To = None,
) -> None:
    """Export a log as one message per scan.

    Stock rerun and Foxglove plot it.
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.log import expand_command

    raise typer.Exit(expand_command(log, out, time_range(start, stop)))
