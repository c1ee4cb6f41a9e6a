"""Command `reanalyse`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import Overrides


def reanalyse(
    archive: Annotated[
        list[str], Argument(metavar="ARCHIVE", help="Logs, folders (searched to any depth), or URLs (s3://, gs://).")
    ],
    out: Annotated[Path, Option("--out", "-o", metavar="RESULTS", help="Folder for the results.")],
    site: Annotated[
        Path | None, Option(metavar="SITE.toml", help="Settings. Default: those attached to each log.")
    ] = None,
    scheduler: Annotated[
        str | None, Option(metavar="ADDRESS", help="Scheduler of Dask. Default: processes of this machine.")
    ] = None,
    workers: Annotated[int | None, Option(metavar="N", help="Processes. Default: one per core.", min=1)] = None,
    limit: Annotated[
        float | None,
        Option(metavar="S", help="Longest time for one log or piece [s]; the rest is left out.", min=0.1),
    ] = None,
    dry_run: Annotated[bool, Option("--dry-run", help="List the logs and what would be computed.")] = False,
    given: Overrides = None,
) -> int:
    """Analyse an archive of logs again, in parallel.

    Windows are identified in parallel, and evaluated per site in order of time. A repeated run computes only
    what is new.

    Example:
    modalwatch reanalyse archive -o results --workers 4
    """
    from monitor.cli.logs.reanalysis import reanalyse_archive

    return reanalyse_archive(archive, out, site, given or (), scheduler, workers, limit=limit, dry_run=dry_run)
