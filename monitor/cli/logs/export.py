"""Command `log export`."""

from pathlib import Path
from typing import Annotated

from typer import Option

from monitor.cli.options import Force, From, Run, To


def export(
    log: Run,
    out: Annotated[
        Path,
        Option("--out", "-o", metavar="DATA", help="File to write: .csv, .npz, .mat, .uff, .parquet, .arrow or .h5."),
    ],
    start: From = None,
    stop: To = None,
    force: Force = False,
) -> int:
    """Export the signals of a log on one time grid.

    Device delays found by the newest baseline of the log are removed. `import` restores devices and start time.

    Example:
    modalwatch log export run.mcap -o signals.csv --from -10m
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.logs.conversion import export_signals
    from monitor.cli.output import replacing

    with replacing(out, force=force):
        return export_signals(log, out, time_range(start, stop))
