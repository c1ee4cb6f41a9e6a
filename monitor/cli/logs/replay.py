"""Command `replay`."""

from pathlib import Path
from typing import Annotated

from typer import Option

from monitor.cli.options import Force, From, Json, Overrides, Run, To


def replay(
    log: Run,
    site: Annotated[
        Path | None, Option(metavar="SITE.toml", help="Settings to use instead of the settings attached to the log.")
    ] = None,
    out: Annotated[
        Path | None, Option("-o", "--out", metavar="WATCHED.mcap", help="Log to write, with signals and results.")
    ] = None,
    json: Json = None,
    start: From = None,
    stop: To = None,
    given: Overrides = None,
    force: Force = False,
) -> int:
    r"""Repeat the analysis of a log at full speed.

    Results are compared with the live ones. With --from the baseline is learned from that time on, and
    nothing is compared. A table of modes of another program (CSV, MAT; one row per window) is monitored too.

    Example:
    modalwatch replay run.mcap
    modalwatch replay days.mcap --site site.toml -o watched.mcap \
        --set alarm.hold_windows=3
    modalwatch replay modes.csv -o watched.mcap
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.logs.repetition import replay_log
    from monitor.cli.output import check_outputs, replacing

    check_outputs({"--json": json}, force=force)
    with replacing(out, force=force):
        return replay_log(log, site, given or (), time_range(start, stop), json_path=json, watched=out)
