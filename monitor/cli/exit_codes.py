"""The one place where errors become exit codes."""

import typer

DONE, NEEDS_A_PERSON, WRONG_INPUT, COULD_NOT_START, INTERNAL, INTERRUPTED = 0, 1, 2, 3, 70, 130


def explain(error: Exception, *, debug: bool) -> int:
    """Print an error in one line and return the exit code; unforeseen errors are raised again for debugging."""
    from daq import DaqError
    from daq.bounded_text import one_line
    from monitor.errors import MonitorError, StartError
    from oma import OmaError
    from updater import UpdaterError

    if isinstance(error, DaqError | OmaError | MonitorError | UpdaterError):
        typer.echo(f"error: {error}", err=True)
        return COULD_NOT_START if isinstance(error, StartError) else WRONG_INPUT
    typer.echo(f"internal error: {one_line(f'{type(error).__name__}: {error}')}", err=True)
    if debug:
        raise error
    return INTERNAL
