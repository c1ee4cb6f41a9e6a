"""Command `response`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import Force, From, Json, To


def response(
    structure: Annotated[Path, Argument(metavar="STRUCTURE.toml", help="Structure file.")],
    logs: Annotated[list[Path], Argument(metavar="LOG...", help="Logs whose response is estimated.")],
    reference: Annotated[
        list[Path],
        Option(metavar="LOG", help="Log of the same structure, from which the model is learned. Repeatable."),
    ],
    at: Annotated[
        list[str] | None,
        Option(
            metavar="MEMBER:DISTANCE:AXIS[:QUANTITY]",
            help="Motion at a distance [m] from the member's start along x, y or z: acceleration (default), velocity "
            "or displacement. Repeatable.",
        ),
    ] = None,
    stress: Annotated[
        list[str] | None,
        Option(
            metavar="MEMBER:DISTANCE",
            help="Normal stress and fatigue of the section at a distance [m] from the member's start. Repeatable.",
        ),
    ] = None,
    detail: Annotated[
        float, Option(metavar="MPA", help="Detail category of the sections: range at 2 million cycles (EN 1993-1-9).")
    ] = 71.0,
    sensors: Annotated[
        bool,
        Option(
            "--predict-sensors",
            help="Predict the sensors of each place from the others, and state the errors.",
        ),
    ] = False,
    window: Annotated[
        float | None,
        Option(metavar="S", help="Length of a window of the reference [s]. Default: as for `diagnose`.", min=0.1),
    ] = None,
    start: From = None,
    stop: To = None,
    out: Annotated[
        Path | None,
        Option("--out", "-o", metavar="DATA", help="File of the signals: .csv, .npz, .mat, .parquet, .arrow or .h5."),
    ] = None,
    force: Force = False,
    json: Json = None,
) -> int:
    r"""Estimate motion and stresses where there is no sensor.

    Of the vibration in the band of the measured modes; static parts and slow motion are not contained. Each value has a
    standard deviation. Fatigue: rainflow counts of the nominal stress, and the life if the vibration stays as recorded.

    Example:
    modalwatch response structure.toml now.mcap --reference before.mcap \
        --at beam:0.1:z:displacement
    modalwatch response structure.toml now.mcap --reference before.mcap \
        --stress column:0.05 --detail 80
    modalwatch response structure.toml now.mcap --reference before.mcap \
        --predict-sensors
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.response.estimation import Request, estimate_response
    from monitor.cli.output import check_outputs, replacing
    from monitor.errors import ArgumentError

    if not (at or stress or sensors):
        raise ArgumentError("--at, --stress, --predict-sensors", "expected a place, a section or sensors, found none")
    if not detail > 0:
        raise ArgumentError("--detail", f"expected a positive range in MPa, found {detail:g}")
    check_outputs({"--json": json}, force=force)
    request = Request(
        structure=structure,
        logs=logs,
        reference=reference,
        points=at or (),
        sections=stress or (),
        sensors=sensors,
        category=1e6 * detail,
        window=window,
        within=time_range(start, stop),
    )
    with replacing(out, force=force):
        return estimate_response(request, out, json)
