"""Command `fleet`."""

from typing import Annotated

from typer import Argument, Option

from monitor.cli.output import DONE


def fleet(
    target: Annotated[str, Argument(metavar="ADDRESS|FLEET.toml", help="Database or broker, or settings.")],
    port: Annotated[int | None, Option(help="Port of the page. Default: that of FLEET.toml, or 8770.")] = None,
) -> int:
    """Serve a page of all sites of a database or a broker.

    Sites that need a person come first: changed structures, then monitors without data or with problems.

    Example:
    modalwatch fleet postgresql://modalwatch@localhost/modalwatch
    modalwatch fleet mqtt://broker.example.org/modalwatch
    """
    from monitor.cli.operation.fleet_page import serve

    serve(target, port)
    return DONE
