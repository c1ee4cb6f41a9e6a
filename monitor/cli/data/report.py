"""Command `report`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import Force, From, Pdf, To


def report(
    path: Annotated[Path, Argument(metavar="DIR|LOG.mcap", help="Log, or the folder of a run.")],
    out: Annotated[
        Path | None, Option("--out", "-o", metavar="PAGE.html", help="Page to write. Default: next to the log.")
    ] = None,
    pdf: Pdf = None,
    diagnosis: Annotated[
        Path | None, Option(metavar="FILE", help="JSON file of `diagnose`, to show instead of the log's own diagnosis.")
    ] = None,
    start: From = None,
    stop: To = None,
    force: Force = False,
) -> int:
    """Write a report of a log as one HTML page, or also as a PDF.

    With a range, only windows entirely inside it are shown. The baseline and an alarm that is active at --from are
    taken from earlier.

    Example:
    modalwatch report run.mcap -o page.html --from 1h --to 2h
    modalwatch report run.mcap --pdf report.pdf
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.log_views import write_report

    return write_report(path, out, diagnosis, time_range(start, stop), pdf, force=force)
