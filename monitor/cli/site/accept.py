"""`accept`: acceptance of an alarmed change as the new reference."""

from pathlib import Path

from rich.markup import escape

from monitor.cli.exit_codes import DONE
from monitor.cli.site.send import send_command, standing
from monitor.cli.terminal import Terminal
from monitor.errors import ArgumentError
from monitor.outputs.history import AlarmRow, HistoryError
from monitor.service.operator_commands import Acceptance, UndoAcceptance
from monitor.service.site import Site, load_site
from monitor.text.quantities import utc

console = Terminal()


def accept_command(path: Path, alarm: str | None, cause: str, by: str) -> int:
    """Send the acceptance of the active alarm to the monitor of a site.

    Parameters
    ----------
    path : of SITE.toml
    alarm : time at which it was raised, as in `history`, or the beginning of it. Default: the active one
    cause : of the change
    by : who accepts it
    """
    site = load_site(path)
    if not cause.strip():
        raise ArgumentError("--reason", "expected what the change is, such as 'pump, 150 g'")
    found = _standing(site, alarm)
    console.print(escape(f"the alarm of {utc(found.raised)}: {found.text}"), soft_wrap=True)
    console.print(escape(f"is to be accepted as {cause!r}"), soft_wrap=True)
    send_command(site, Acceptance(cause=cause, by=by, alarm=found.raised))
    return DONE


def undo_command(path: Path, by: str, note: str) -> int:
    """Leave word for the monitor of a site that the last acceptance was wrong."""
    send_command(load_site(path), UndoAcceptance(by=by, note=note))
    return DONE


def _standing(site: Site, alarm: str | None) -> AlarmRow:
    """Return the active alarm, if it is the given one.

    Raises
    ------
    ArgumentError
        If none is active, or another one.
    """
    try:
        found = standing(site)
    except HistoryError as error:
        raise ArgumentError("ALARM", f"no alarm is known: {error}") from error
    if found is None:
        raise ArgumentError("ALARM", "no alarm is active")
    if alarm is not None and not utc(found.raised).startswith(alarm):
        raise ArgumentError("ALARM", f"expected the active one, {utc(found.raised)}, found {alarm!r}")
    return found
