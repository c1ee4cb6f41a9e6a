"""Command `bodies`."""

from pathlib import Path
from typing import Annotated

from typer import Argument

from monitor.cli.options import Json


def bodies(
    file: Annotated[
        Path,
        Argument(
            metavar="BODIES.toml",
            help="TOML file with the structure, the bodies, and places and frequencies per record.",
        ),
    ],
    json: Json = None,
) -> int:
    """Identify bodies removed or added at known places.

    Several records are used together.

    Example:
    modalwatch bodies bodies.toml --json bodies.json
    """
    from monitor.cli.data.body_selection import identify_bodies

    return identify_bodies(file, json)
