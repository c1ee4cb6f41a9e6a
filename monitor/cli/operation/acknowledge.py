"""Command `acknowledge`."""

from typing import Annotated

from typer import Option

from monitor.cli.options import DONE, Person, Site


def acknowledge(site: Site, by: Person = "", note: Annotated[str, Option(metavar="TEXT", help="Comment.")] = "") -> int:
    """Acknowledge the alarm of a running monitor.

    Example:
    modalwatch acknowledge site.toml --by Ann --note 'inspected, no damage'
    """
    from monitor.cli.operation.sending import active_alarm_if_known, send_command
    from monitor.cli.terminal import echo
    from monitor.service.operator_commands import Acknowledgement
    from monitor.service.site import load_site
    from monitor.text.quantities import utc

    loaded = load_site(site)
    found = active_alarm_if_known(loaded)
    echo(f"the alarm of {utc(found.raised)}: {found.text}" if found else "the history has no active alarm", divide=True)
    send_command(loaded, Acknowledgement(by=by, note=note))
    return DONE
