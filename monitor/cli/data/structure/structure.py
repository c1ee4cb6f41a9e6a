"""Command `structure`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import DONE, NEEDS_A_PERSON, Force, Json


def structure(
    file: Annotated[Path, Argument(metavar="FILE", help="structure.toml.")],
    modes: Annotated[int, Option(metavar="N", help="Number of modes to list.", min=1, max=100)] = 12,
    json: Json = None,
    out: Annotated[
        Path | None,
        Option(
            "--out",
            "-o",
            metavar="PICTURE.png",
            help="Picture to write. Default: next to FILE; none with --parameters.",
        ),
    ] = None,
    channels: Annotated[
        Path | None,
        Option(metavar="SITE.toml|LOG", help="Log or SITE.toml whose channels are compared with the sensors."),
    ] = None,
    record_seconds: Annotated[
        float | None,
        Option(
            metavar="S",
            help="Length of the records before and after a change [s]. Default: of the log of --channels, else 600.",
        ),
    ] = None,
    damping: Annotated[float, Option(metavar="RATIO", help="Damping ratio of the modes.")] = 0.005,
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
    force: Force = False,
) -> int:
    """Draw a structure, and report what its sensors detect.

    Lists its modes, which of them the sensors measure, and the smallest added mass that raises an alarm.

    Example:
    modalwatch structure structure.toml --channels site.toml
    modalwatch structure structure.toml --target-mass 50g --tolerance 50mm
    """
    from monitor.analysis.channels import check_channels, measured_only
    from monitor.cli.data.structure import detectability as work
    from monitor.cli.data.structure.parameters_output import parameters_json
    from monitor.cli.data.structure.structure_output import as_json
    from monitor.cli.output import check_outputs, write_json
    from monitor.cli.terminal import echo, progress, warn
    from updater import ModelError, StructureError, load_structure
    from updater.planning import look
    from updater.structure import mean_flexibilities, odd_units

    picture = out or (None if parameters else file.with_suffix(".png"))
    drawn = picture is not None and (out is not None or force or not picture.exists())
    check_outputs({"--out": out, "--json": json}, force=force)
    loaded, target = load_structure(file), work.target_of(target_mass, tolerance)
    check = check_channels(loaded, channels) if channels else None
    record = work.planned_record(record_seconds, damping, highest, check)
    if check:
        loaded = measured_only(loaded, check)
    try:
        with progress("computing modes and detectability"):
            sight = look(loaded, modes, record, target.within if target else None)
        planned = work.plan_for(sight, target)
    except ModelError as error:
        raise StructureError(file, "; ".join([*odd_units(loaded), str(error)])) from error
    if picture and drawn:
        with progress("drawing"):
            work.draw(sight, picture, planned)
    work.print_study(sight, planned, check)
    listed = work.list_parameters(loaded, modes) if parameters else None
    for note in (*odd_units(loaded), *mean_flexibilities(loaded)):
        warn(f"note: {note}")
    if highest is None and check is None:
        warn(f"note: {work.USUAL_BAND}")
    if picture:
        echo(f"picture: {picture}{'' if drawn else ' exists and was not drawn again: --force replaces it'}")
    if json:
        write_json(json, as_json(sight, planned) | ({} if listed is None else {"parameters": parameters_json(listed)}))
    return DONE if check is None or check.good else NEEDS_A_PERSON
