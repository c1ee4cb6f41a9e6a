"""Command `view`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import Force, From, To


def view(
    target: Annotated[
        str, Argument(metavar="DIR|LOG.mcap|URL", help="Log, folder of a run, or address of a live view.")
    ],
    out: Annotated[
        Path | None, Option("--out", "-o", metavar="FILE.rrd", help="Recording to write. Default: in a cache folder.")
    ] = None,
    show: Annotated[bool, Option("--open/--no-open", help="Open the rerun viewer on the recording.")] = True,
    start: From = None,
    stop: To = None,
    force: Force = False,
) -> int:
    """Open the rerun viewer on a log or a running monitor.

    A range is shown as by `report`.

    Example:
    modalwatch view run.mcap
    modalwatch view rerun+http://127.0.0.1:9876/proxy
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.log_views import open_view

    return open_view(target, out, show=show, within=time_range(start, stop), force=force)
