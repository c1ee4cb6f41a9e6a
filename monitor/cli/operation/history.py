"""Command `history`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import Json


def history(
    target: Annotated[str, Argument(metavar="SITE.toml|FILE|URL", help="Site, SQLite file or database.")],
    days: Annotated[float | None, Option(help="Number of days, counted back from now. Default: all.", min=0.0)] = None,
    csv: Annotated[Path | None, Option(metavar="FILE", help="CSV file to write: modes over time.")] = None,
    plot: Annotated[
        Path | None, Option(metavar="PICTURE.png", help="Picture to write: novelty and frequency shifts over time.")
    ] = None,
    json: Json = None,
) -> int:
    """List alarms, modes and events of a site over time.

    Example:
    modalwatch history site.toml --days 30 --plot month.png
    """
    from monitor.cli.operation.history_output import list_history

    return list_history(target, days, csv_path=csv, json_path=json, picture=plot)
