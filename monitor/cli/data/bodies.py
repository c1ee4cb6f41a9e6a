"""Command `bodies`."""

from pathlib import Path
from typing import Annotated

from typer import Argument

from monitor.cli.options import Force, Json


def bodies(
    file: Annotated[
        Path,
        Argument(
            metavar="BODIES.toml",
            help="TOML file with the structure, the bodies, and places and frequencies per record.",
        ),
    ],
    json: Json = None,
    force: Force = False,
) -> int:
    """Identify bodies removed or added at known places.

    Several records are used together.

    Example:
    modalwatch bodies bodies.toml --json bodies.json
    """
    from monitor.cli.data.body_selection import identify_bodies
    from monitor.cli.output import check_outputs

    check_outputs({"--json": json}, force=force)
    return identify_bodies(file, json)
