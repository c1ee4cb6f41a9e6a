"""Command `prove`."""

from pathlib import Path
from typing import Annotated

from typer import Option

from monitor.cli.options import Force, Json, Site


def prove(
    site: Site,
    mass: Annotated[float, Option(metavar="KG", help="Known mass that is attached now [kg].", min=1e-6)],
    position: Annotated[str, Option(metavar="X,Y,Z", help="Its position on a member [m]; X,Z of a plane frame.")],
    log: Annotated[
        list[Path] | None,
        Option(metavar="LOG.mcap|DIR", help="Log to use instead of the saved state of the monitor. Repeatable."),
    ] = None,
    json: Json = None,
    force: Force = False,
) -> int:
    """Commission a site with a known mass.

    Attach the mass and wait for the alarm. The answer is compared with mass and position.

    Example:
    modalwatch prove site.toml --mass 0.1 --position 0.2,1.0
    """
    from monitor.cli.output import check_outputs
    from monitor.cli.site.commissioning import commission

    check_outputs({"--json": json}, force=force)
    return commission(site, mass, position, log or (), json)
