"""Command `install-service`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option


def install_service(
    settings: Annotated[Path, Argument(metavar="SITE.toml", help="Settings; with --fleet: FLEET.toml.")],
    user: Annotated[
        bool, Option("--user", help="Unit for the user's service manager instead of the system's.")
    ] = False,
    fleet: Annotated[bool, Option("--fleet", help="Unit of the page of many sites.")] = False,
    only_print: Annotated[bool, Option("--print", help="Print the unit instead of writing it.")] = False,
    run_as: Annotated[
        str | None, Option("--as", metavar="USER", help="User that runs the service. Default: the owner of the folder.")
    ] = None,
) -> int:
    """Write a systemd unit for a site or a fleet.

    The service starts at boot, is supervised by systemd, and has minimal rights.

    Example:
    modalwatch install-service site.toml --print
    sudo modalwatch install-service site.toml --as monitor
    sudo modalwatch install-service fleet.toml --fleet --as monitor
    """
    from monitor.cli.operation.service_unit import install_fleet_unit, install_unit

    install = install_fleet_unit if fleet else install_unit
    return install(settings, of_user=user, only_print=only_print, run_as=run_as)
