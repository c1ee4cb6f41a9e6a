"""Command `run`."""

from typing import Annotated

from typer import Option

from monitor.cli.options import Overrides, Site


def run(
    site: Site,
    given: Overrides = None,
    json_log: Annotated[bool, Option("--json-log", help="Print events as JSON, one object per line.")] = False,
) -> int:
    """Monitor a site until SIGTERM or Ctrl-C.

    Example:
    modalwatch run site.toml
    modalwatch run site.toml --set analysis.overlap=0.5 --json-log
    """
    from monitor.cli.site.monitoring import monitor_site

    return monitor_site(site, given or (), as_json=json_log)
