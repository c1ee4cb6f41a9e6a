"""Command `install-service`."""

from typing import Annotated

from typer import Option

from monitor.cli.options import Site


def install_service(
    site: Site,
    user: Annotated[
        bool, Option("--user", help="Unit for the user's service manager instead of the system's.")
    ] = False,
    only_print: Annotated[bool, Option("--print", help="Print the unit instead of writing it.")] = False,
    run_as: Annotated[
        str | None, Option("--as", metavar="USER", help="User that runs the service. Default: the owner of the folder.")
    ] = None,
) -> int:
    """Write a systemd unit for a site.

    The service starts at boot, is supervised by systemd, and has minimal rights.

    Example:
    modalwatch install-service site.toml --print
    sudo modalwatch install-service site.toml --as monitor
    """
    from monitor.cli.operation.service_unit import install_unit

    return install_unit(site, of_user=user, only_print=only_print, run_as=run_as)
