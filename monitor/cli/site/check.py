"""Command `check`."""

from monitor.cli.options import Overrides, Site


def check(site: Site, given: Overrides = None) -> int:
    """Check settings, devices and rates before a run.

    Example:
    modalwatch check site.toml
    """
    from monitor.cli.site.site_check import check_site

    return check_site(site, given or ())
