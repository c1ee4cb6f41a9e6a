"""Options for a range of time."""

from typing import Annotated

import typer

From = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="TIME",
        help="Where to begin: seconds from the start of the log (90, 1h30m; -10m is from its end), or a time "
        "(2026-01-31T12:00:00Z; UTC unless it has a zone).",
    ),
]
To = Annotated[str | None, typer.Option("--to", metavar="TIME", help="End of the range (exclusive). Format as --from.")]
