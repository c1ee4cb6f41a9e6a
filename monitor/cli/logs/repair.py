"""Command `repair`."""

from pathlib import Path
from typing import Annotated

from typer import Argument

from monitor.cli.options import DONE


def repair(log: Annotated[Path, Argument(metavar="LOG.mcap", help="Log; it is replaced.")]) -> int:
    """Repair a truncated or damaged log in place.

    Every complete chunk is kept.

    Example:
    modalwatch repair run.mcap
    """
    from daq import repair_log
    from monitor.cli.terminal import echo, progress

    with progress("reading", [log]):
        state = repair_log(log)
    if state.whole:
        echo(f"{log}: complete, {state.n_messages} messages; not changed")
    else:
        echo(f"{log}: repaired, {state.n_messages} messages kept; it was {state}")
    return DONE
