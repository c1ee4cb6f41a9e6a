"""Command `rig`."""

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from monitor.cli.exit_codes import DONE


def rig(
    scenario: Annotated[Path, Argument(metavar="SCENARIO.toml")],
    speed: Annotated[float, Option(help="Seconds of data per second.", min=0.1, max=20)] = 1.0,
    ports: Annotated[Path, Option(help="File for the ports, written once they can be opened.")] = Path("ports.json"),
    report: Annotated[Path, Option(help="File for the report, written at the end.")] = Path("rig.json"),
) -> int:
    """Run a virtual rig with emulated devices.

    Example:
    modalwatch rig scenario.toml --speed 10 --ports ports.json
    """
    from monitor.rig import run_rig

    done = run_rig(scenario, speed=speed, ports=ports, report=report)
    typer.echo(f"{done.sent} frames sent, {done.dropped} dropped")
    return DONE
