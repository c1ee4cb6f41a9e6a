"""Command `accept`."""

from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import DONE, Person, Site


def accept(
    site: Site,
    alarm: Annotated[
        str | None,
        Argument(
            metavar="ALARM", help="Time at which the alarm was raised, as in `history`. Default: the active alarm."
        ),
    ] = None,
    cause: Annotated[str, Option("--reason", metavar="TEXT", help="Cause of the change, such as 'pump, 150 g'.")] = "",
    by: Person = "",
    undo: Annotated[bool, Option("--undo", help="Undo the last acceptance.")] = False,
    note: Annotated[str, Option(metavar="TEXT", help="Reason for the undo.")] = "",
) -> int:
    """Accept an alarmed change as the new reference.

    Example:
    modalwatch accept site.toml --reason 'pump, 150 g' --by Ann
    modalwatch accept site.toml --undo --note 'wrong alarm'
    """
    from monitor.cli.operation.sending import active_alarm, send_command
    from monitor.cli.terminal import echo
    from monitor.errors import ArgumentError
    from monitor.service.operator_commands import Acceptance, UndoAcceptance
    from monitor.service.site import load_site
    from monitor.text.quantities import utc

    loaded = load_site(site)
    if undo:
        send_command(loaded, UndoAcceptance(by=by, note=note))
        return DONE
    if not cause.strip():
        raise ArgumentError("--reason", "expected what the change is, such as 'pump, 150 g'")
    found = active_alarm(loaded, alarm)
    echo(f"the alarm of {utc(found.raised)}: {found.text}", divide=True)
    echo(f"is to be accepted as {cause!r}")
    send_command(loaded, Acceptance(cause=cause, by=by, alarm=found.raised))
    return DONE
