"""Command `history`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import DONE, Force, Json


def history(
    target: Annotated[str, Argument(metavar="SITE.toml|FILE|URL", help="Site, SQLite file or database.")],
    site: Annotated[
        str, Option("--site-name", metavar="NAME", help="Site in a database of many. Default: that of SITE.toml.")
    ] = "",
    days: Annotated[
        float | None, Option(metavar="DAYS", help="Length of the span, counted back from now. Default: all.", min=0.0)
    ] = None,
    csv: Annotated[Path | None, Option(metavar="FILE", help="CSV file to write: modes over time.")] = None,
    plot: Annotated[
        Path | None, Option(metavar="PICTURE.png", help="Picture to write: novelty and frequency shifts over time.")
    ] = None,
    json: Json = None,
    force: Force = False,
) -> int:
    """List alarms, modes and events of a site over time.

    Example:
    modalwatch history site.toml --days 30 --plot month.png
    """
    from monitor.cli.operation.history_output import as_json, print_history, read_history, write_csv
    from monitor.cli.output import check_outputs, write_json

    check_outputs({"--csv": csv, "--plot": plot, "--json": json}, force=force)
    found = read_history(target, site, days)
    print_history(found)
    if csv:
        write_csv(csv, found)
    if json:
        write_json(json, as_json(found))
    if plot:
        from monitor.views.plots.history import draw_history  # loads matplotlib

        draw_history(plot, found)
    return DONE
