"""Command `health`."""

from monitor.cli.options import Site


def health(site: Site) -> int:
    """Check the health of a running monitor.

    Uses its [web] section. Prints the problems, with exit code 1, if it is not healthy.

    Example:
    modalwatch health site.toml
    """
    from monitor.cli.operation.service_unit import check_health

    return check_health(site)
