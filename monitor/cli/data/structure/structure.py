"""Command `structure`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import Json


def structure(
    file: Annotated[Path, Argument(metavar="FILE", help="structure.toml.")],
    modes: Annotated[int, Option(help="Number of modes to list.", min=1, max=100)] = 12,
    json: Json = None,
    out: Annotated[Path | None, Option(metavar="PICTURE.png", help="Picture to write. Default: next to FILE.")] = None,
    channels: Annotated[
        Path | None,
        Option(metavar="SITE.toml|LOG", help="Log or SITE.toml whose channels are compared with the sensors."),
    ] = None,
    record_seconds: Annotated[
        float, Option(metavar="S", help="Length of the records before and after a change [s].")
    ] = 600.0,
    damping: Annotated[float, Option(help="Damping ratio of the modes.")] = 0.005,
    highest: Annotated[
        float | None,
        Option(
            metavar="HZ", help="Frequency up to which modes are identified [Hz]. Default: from --channels, else 400."
        ),
    ] = None,
    target_mass: Annotated[str | None, Option(metavar="MASS", help="Mass that must be located, such as 50g.")] = None,
    tolerance: Annotated[str, Option(metavar="LENGTH", help="Largest error of its position, such as 50mm.")] = "50mm",
    parameters: Annotated[
        bool, Option("--parameters", help="List the model parameters that may be updated, with sensitivities.")
    ] = False,
) -> int:
    """Draw a structure, and report what its sensors detect.

    Lists its modes, which of them the sensors measure, and the smallest added mass that raises an alarm.

    Example:
    modalwatch structure structure.toml --channels site.toml
    modalwatch structure structure.toml --target-mass 50g --tolerance 50mm
    """
    from monitor.cli.data.structure.detectability import study_structure

    return study_structure(
        file,
        n_modes=modes,
        seconds=record_seconds,
        damping=damping,
        highest=highest,
        target_mass=target_mass,
        tolerance=tolerance,
        channels=channels,
        parameters=parameters,
        json_path=json,
        picture=out,
    )
