"""`modalwatch`: its entry point, and its exit codes."""

import gc
import os
import sys
from typing import TYPE_CHECKING, Annotated

import typer

from monitor.cli.commands import CommandGroup
from monitor.cli.lines import echo_error
from monitor.cli.options import DONE, INTERRUPTED, WRONG_INPUT, explain

if TYPE_CHECKING:
    from typer._click.exceptions import UsageError
else:
    UsageError = typer.BadParameter.__bases__[0]  # in click or inside typer, by its version

_NEW_OBJECTS = 200_000  # before a garbage collection: twice as many as modules make; of the default, 700, they make 150


def _exit(code: int, **_options: bool) -> None:
    raise typer.Exit(code)


app = typer.Typer(
    cls=CommandGroup,
    result_callback=_exit,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"max_content_width": 200},
)


def _print_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version  # slow to import

        typer.echo(f"modalwatch {version('modalwatch')}")
        raise typer.Exit


@app.callback()
def _options(
    _version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an internal error.")] = False,
) -> None:
    """Watch a structure with accelerometers: has it changed, where, by how much, how sure."""
    _debug.append(debug)


_debug: list[bool] = []


def main() -> None:
    """Run the command line; every error becomes one line and an exit code."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # small matrices in parallel to a stream: more threads only take its time
    gc.set_threshold(_NEW_OBJECTS)
    code = _run()
    gc.freeze()  # collections at the end of the process, whose memory is freed as a whole, would visit all objects
    sys.exit(code)


def _run() -> int:
    try:
        return int(app(prog_name="modalwatch", standalone_mode=False) or DONE)
    except SystemExit as end:
        return int(end.code or DONE)
    except UsageError as error:
        _show(error)
        return WRONG_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED
    except typer.Abort:
        typer.echo(err=True)  # ends the line of the prompt
        return INTERRUPTED
    except Exception as error:  # noqa: BLE001 - the daemon's edge: nothing may leave without an exit code
        return explain(error, debug=any(_debug))


def _show(error: UsageError) -> None:
    """Print an error of the arguments, and the command that prints the help."""
    if type(error).show is not UsageError.show:  # the help itself, of a group without a command
        error.show()
        return
    echo_error(f"error: {error.format_message()}")
    if error.ctx:
        typer.echo(f"see {error.ctx.command_path} --help", err=True)
