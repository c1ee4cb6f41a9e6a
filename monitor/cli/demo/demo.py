"""Command `demo`."""

from pathlib import Path
from typing import Annotated

from typer import Option

from monitor.cli.demo.rig import SCENARIOS
from monitor.cli.options import Force


def demo(
    out: Annotated[Path, Option("--out", "-o", metavar="DIR", help="Folder for the results.")] = Path("demo-output"),
    seed: Annotated[int | None, Option(metavar="N", help="Seed of the rig and its events. Default: random.")] = None,
    speed: Annotated[
        float,
        Option(
            metavar="FACTOR",
            help="Seconds of data per second, at most: the rig waits for the analysis.",
            min=0.1,
            max=20,
        ),
    ] = 20.0,
    scenario: Annotated[
        str | None,
        Option(metavar="|".join(SCENARIOS), help="Shipped scenario. Default: a body is added, drawn."),
    ] = None,
    short: Annotated[bool, Option("--short", help="Quarter of the length, less accurate answers.")] = False,
    force: Force = False,
) -> int:
    """Monitor an emulated rig from baseline to diagnosis.

    Example:
    modalwatch demo --out demo-output --seed 7
    modalwatch demo --short
    modalwatch demo --scenario breathing-crack
    """
    from monitor.cli.demo.demonstration import FOLDER_FILES, FULL, SHORT, demonstrate
    from monitor.cli.output import check_outputs, existing_in

    check_outputs({"--out": existing_in(out, FOLDER_FILES)}, force=force)
    return demonstrate(out, seed, speed=speed, plan=SHORT if short else FULL, name=scenario)
