"""`accept`: what raised an alarm is the new normal."""

from pathlib import Path

from rich.console import Console
from rich.markup import escape

from monitor.errors import ArgumentError
from monitor.history import AlarmRow, HistoryError, Reader, Span
from monitor.inbox import Acceptance, Undoing, leave
from monitor.site import Site, load_site
from monitor.words import utc

console = Console(highlight=False)
_EVER = Span(start=0, end=2**62)


def accept_command(path: Path, alarm: str | None, cause: str, by: str) -> int:
    """Leave word for the monitor of a site that the alarm that stands is the new normal.

    Parameters
    ----------
    path : of SITE.toml
    alarm : when it was raised, as `history` shows it or the beginning of that; the one that stands
    cause : what the change is
    by : who accepts it
    """
    site = load_site(path)
    if not cause.strip():
        raise ArgumentError("--as", "expected what the change is, such as 'pump, 150 g'")
    standing = _standing(site, alarm)
    leave(site.state, Acceptance(cause=cause, by=by, alarm=standing.raised))
    console.print(escape(f"the alarm of {utc(standing.raised)}: {standing.text}"), soft_wrap=True)
    console.print(escape(f"is to be accepted as {cause!r}; the monitor does so within a second, or when it starts"))
    return 0


def undo_command(path: Path, by: str, note: str) -> int:
    """Leave word for the monitor of a site that the last acceptance was wrong."""
    leave(load_site(path).state, Undoing(by=by, note=note))
    console.print("left for the monitor; it takes it within a second, or when it starts")
    return 0


def _standing(site: Site, alarm: str | None) -> AlarmRow:
    """Return the alarm that stands, if it is the one that is meant.

    Raises
    ------
    ArgumentError
        If none stands, or another one.
    """
    try:
        with Reader(site.source.url) as reader:
            found = [row for row in reader.alarms(_EVER) if row.cleared is None]
    except HistoryError as error:
        raise ArgumentError("ALARM", f"no alarm is known: {error}") from error
    if not found:
        raise ArgumentError("ALARM", "no alarm stands")
    last = found[-1]
    if alarm is not None and not utc(last.raised).startswith(alarm):
        raise ArgumentError("ALARM", f"expected the one that stands, {utc(last.raised)}, found {alarm!r}")
    return last
