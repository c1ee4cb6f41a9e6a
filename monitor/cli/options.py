"""Arguments and options that several commands have, and exit codes."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option
from typer.models import OptionInfo

from monitor.cli.lines import echo_error

DONE, NEEDS_A_PERSON, WRONG_INPUT, COULD_NOT_START, INTERNAL, INTERRUPTED = 0, 1, 2, 3, 70, 130  #: exit codes
METHODS = ("ssi-data", "ssi-cov", "plscf", "fdd", "efdd", "fsdd")  #: names of `oma.METHODS`, without importing it
ANIMATIONS = (".html", ".gif")  #: those of `monitor.views.animation`, without importing it
DATE_ORDERS = ("dmy", "mdy")  #: those of `DataOptions.date_order`
TIME_UNITS = ("s", "ms", "us", "ns", "min", "h", "d")  #: those of `daq.files.TIME_UNITS`


def _json(path: Path | None) -> Path | None:
    if path == Path("-"):
        from monitor.cli.terminal import keep_stdout_free  # imports rich

        keep_stdout_free()
    return path


Site = Annotated[Path, Argument(metavar="SITE.toml", help="Settings of the site.")]
Run = Annotated[list[Path], Argument(metavar="LOG.mcap...|DIR", help="Logs, or the folder of a run.")]
Json = Annotated[
    Path | None,
    Option(
        metavar="FILE",
        help="JSON file to write; - is the standard output, without other texts.",
        callback=_json,
    ),
]
Pdf = Annotated[Path | None, Option(metavar="FILE", help="PDF of the report. Needs `pip install 'modalwatch[pdf]'`.")]
Force = Annotated[bool, Option("--force", help="Replace files that exist.")]
Person = Annotated[str, Option(metavar="NAME", help="Name of the person.")]
Overrides = Annotated[
    list[str] | None,
    Option("--set", metavar="KEY=VALUE", help="Override a setting, e.g. analysis.overlap=0.5. Repeatable."),
]
From = Annotated[
    str | None,
    Option(
        "--from",
        metavar="TIME",
        help="Where to begin: seconds from the start of the log (90, 1h30m; -10m is from its end), or a time "
        "(2026-01-31T12:00:00Z; UTC unless it has a zone).",
    ),
]
ExponentialWindow = Annotated[
    float | None,
    Option(
        metavar="SECONDS",
        help="Time constant of the exponential window of frequency responses: its damping is removed.",
    ),
]
To = Annotated[str | None, Option("--to", metavar="TIME", help="End of the range (exclusive). Format as --from.")]


def one_of(option: str, values: tuple[str, ...], text: str) -> OptionInfo:
    """Return an option that lists its values in the help, completes them in the shell, and refuses others."""

    def checked(value: str | None) -> str | None:
        if value is not None and value not in values:
            from monitor.errors import ArgumentError

            raise ArgumentError(option, f"expected one of {', '.join(values)}, found {value!r}")
        return value

    found: OptionInfo = Option(
        option, metavar="|".join(values), help=text, callback=checked, autocompletion=lambda: values
    )
    return found


KINDS = ("cantilever", "beam", "portal", "storeys", "t-frame")
MATERIALS = ("steel", "aluminium", "concrete", "timber")


def explain(error: Exception, *, debug: bool) -> int:
    """Print an error in one line and return the exit code; unforeseen errors are raised again for debugging."""
    from daq import DaqError
    from daq.bounded_text import one_line
    from monitor.errors import MonitorError, StartError
    from oma import OmaError
    from updater import UpdaterError

    if isinstance(error, DaqError | OmaError | MonitorError | UpdaterError):
        echo_error(f"error: {error}")
        return COULD_NOT_START if isinstance(error, StartError) else WRONG_INPUT
    echo_error(f"internal error: {one_line(f'{type(error).__name__}: {error}')}")
    if debug:
        raise error
    return INTERNAL
