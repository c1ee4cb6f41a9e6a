"""Command `log expand`."""

from pathlib import Path
from typing import Annotated

from typer import Option

from monitor.cli.options import Force, From, Run, To


def expand(
    log: Run,
    out: Annotated[Path, Option("--out", "-o", metavar="VIEW.mcap", help="MCAP file to write, with ROS 2 messages.")],
    start: From = None,
    stop: To = None,
    force: Force = False,
) -> int:
    """Export a log as one message per scan.

    Stock rerun and Foxglove plot it.

    Example:
    modalwatch log expand run.mcap -o view.mcap
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.logs.conversion import expand_signals
    from monitor.cli.output import replacing

    with replacing(out, force=force):
        return expand_signals(log, out, time_range(start, stop))
