"""Command `rig`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import Force

SCENARIOS = (
    "added-mass",
    "breathing-crack",
    "filling-tank",
    "play-in-foot",
    "quiet",
    "two-bodies",
)  #: those that come with the program


def rig(
    scenario: Annotated[
        str, Argument(metavar=f"SCENARIO.toml|{'|'.join(SCENARIOS)}", help="Scenario, or the name of a shipped one.")
    ],
    speed: Annotated[float, Option(metavar="FACTOR", help="Seconds of data per second.", min=0.1, max=20)] = 1.0,
    ports: Annotated[Path, Option(metavar="FILE", help="File for the ports, written once they can be opened.")] = Path(
        "ports.json"
    ),
    report: Annotated[Path, Option(metavar="FILE", help="File for the report, written at the end.")] = Path("rig.json"),
    site: Annotated[
        Path | None,
        Option("--new-site", metavar="FILE", help="SITE.toml to write for the emulated devices; `run` monitors it."),
    ] = None,
    force: Force = False,
) -> int:
    """Run a virtual rig with emulated devices.

    Prints the devices with their ports and the timeline, and each event as it happens.

    Example:
    modalwatch rig added-mass --new-site site.toml
    modalwatch rig scenario.toml --speed 10 --ports ports.json
    """
    from monitor.cli.demo.rig_output import play_rig

    return play_rig(scenario, speed=speed, ports=ports, report=report, site=site, force=force)
