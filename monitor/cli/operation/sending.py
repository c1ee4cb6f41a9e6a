"""Commands sent to a running monitor, and their execution."""

import time

from monitor.cli.terminal import echo
from monitor.errors import ArgumentError
from monitor.outputs.history import AlarmRow, HistoryError, Reader, Span
from monitor.service.operator_commands import Command, write_command
from monitor.service.site import Site
from monitor.text.quantities import utc

_EVER = Span(start=0, end=2**62)
_FRESH = 10.0  # s: age of a monitor's last sign of life
_WAIT, _LOOK = 3.0, 0.1  # s: until it has taken a word; between looks


def send_command(site: Site, command: Command) -> None:
    """Send a command, and print whether the monitor of a site has executed it.

    Raises
    ------
    ArgumentError
        If this user may not write to the state folder.
    """
    try:
        path = write_command(site.state, command)
    except OSError as error:
        why = error.strerror or str(error)
        raise ArgumentError("state", f"{site.state}: {why}: expected a user who may write there") from error
    status = site.source.status()
    if status is None or abs(time.time() - status.time) >= _FRESH:
        echo("no monitor is running: the command is executed at the next start")
        return
    end = time.monotonic() + _WAIT
    while path.exists() and time.monotonic() < end:
        time.sleep(_LOOK)
    left = f"the monitor has not received it within {_WAIT:g} s: {path}"
    echo(left if path.exists() else "the monitor has received it")


def active_alarm(site: Site, given: str | None) -> AlarmRow:
    """Return the active alarm of the history, if it is the given one.

    Parameters
    ----------
    given : time at which it was raised, as in `history`, or the beginning of it. Default: the active one

    Raises
    ------
    ArgumentError
        If none is active, or another one.
    """
    try:
        found = _active_alarm(site)
    except HistoryError as error:
        raise ArgumentError("ALARM", f"no alarm is known: {error}") from error
    if found is None:
        raise ArgumentError("ALARM", "no alarm is active")
    if given is not None and not utc(found.raised).startswith(given):
        raise ArgumentError("ALARM", f"expected the active one, {utc(found.raised)}, found {given!r}")
    return found


def active_alarm_if_known(site: Site) -> AlarmRow | None:
    """Return the active alarm, None also if the history is not available."""
    try:
        return _active_alarm(site)
    except HistoryError:
        return None


def _active_alarm(site: Site) -> AlarmRow | None:
    with Reader(site.source.url, site.source.history_site) as reader:
        found = [row for row in reader.alarms(_EVER) if row.cleared is None]
    return found[-1] if found else None
