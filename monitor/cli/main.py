"""`modalwatch`: its commands, and how it ends."""

import os
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from monitor.cli.exit_codes import DONE, INTERRUPTED, explain
from monitor.cli.tables.data import data_app
from monitor.cli.tables.log import log_app
from monitor.cli.tables.site import site_app

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None)
app.add_typer(site_app)
app.add_typer(data_app)
app.add_typer(log_app, name="log")


def _print_version(asked: bool) -> None:
    if asked:
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


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for what the demo leaves behind.")] = Path("demo-output"),
    seed: Annotated[int | None, typer.Option(help="Seed of the rig and its events. Default: random.")] = None,
    speed: Annotated[float, typer.Option(help="Seconds of data a second.", min=0.1, max=20)] = 10.0,
    short: Annotated[bool, typer.Option("--short", help="A quarter of the length, less sure answers.")] = False,
) -> None:
    """Monitor an emulated rig from baseline to diagnosis."""
    from monitor.cli.demo.demo import FULL, SHORT, demo_command

    raise typer.Exit(demo_command(out, seed, speed=speed, plan=SHORT if short else FULL))


@app.command()
def rig(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO.toml")],
    speed: Annotated[float, typer.Option(help="Seconds of data a second.", min=0.1, max=20)] = 1.0,
    ports: Annotated[Path, typer.Option(help="File that gets the ports, once they can be opened.")] = Path(
        "ports.json"
    ),
    report: Annotated[Path, typer.Option(help="File that gets what happened, at the end.")] = Path("rig.json"),
) -> None:
    """Run a virtual rig with emulated devices."""
    from monitor.rig import run_rig

    done = run_rig(scenario, speed=speed, ports=ports, report=report)
    typer.echo(f"{done.sent} frames sent, {done.dropped} dropped")


def main() -> None:
    """Run the command line; every error becomes one line and an exit code."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # small matrices in parallel to a stream: more threads only take its time
    sys.exit(_run())


def _run() -> int:
    try:
        app(prog_name="modalwatch")
    except SystemExit as end:  # typer has printed the error of the arguments
        return int(end.code or DONE)
    except KeyboardInterrupt:
        return INTERRUPTED
    except Exception as error:  # noqa: BLE001 - the daemon's edge: nothing may leave without an exit code
        return explain(error, debug=any(_debug))
    return DONE
