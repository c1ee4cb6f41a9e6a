"""Command `diagnose`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import ExponentialWindow, Force, From, Json, Pdf, To

_ReferenceTime = Annotated[
    str | None, Option(metavar="TIME", help="Range of the reference logs, like --from and --to.")
]
_HeldOutTime = Annotated[str | None, Option(metavar="TIME", help="Range of the held-out logs, like --from and --to.")]


def diagnose(
    structure: Annotated[Path, Argument(metavar="STRUCTURE.toml")],
    logs: Annotated[
        list[Path],
        Argument(metavar="LOG", help="Logs, folders of them, tables of modes (CSV), or frequency responses (UFF)."),
    ],
    reference: Annotated[
        list[Path] | None, Option(metavar="LOG", help="Log of the structure before the change. Repeatable.")
    ] = None,
    held_out: Annotated[
        list[Path] | None,
        Option(
            "--held-out", "--holdout", metavar="LOG", help="Held-out log: used only to measure the gain. Repeatable."
        ),
    ] = None,
    known_mass: Annotated[
        list[str] | None,
        Option(
            metavar="LOG=KG@X,Y,Z", help="Log of the present state with a known mass on it, at a place [m]. Repeatable."
        ),
    ] = None,
    start: From = None,
    stop: To = None,
    reference_from: _ReferenceTime = None,
    reference_to: _ReferenceTime = None,
    held_out_from: _HeldOutTime = None,
    held_out_to: _HeldOutTime = None,
    window: Annotated[
        float | None,
        Option(
            metavar="S",
            help="Length of a window [s]. Default: by the first mode, of the file or, if far lower, measured.",
            min=0.1,
        ),
    ] = None,
    exponential_window: ExponentialWindow = None,
    out: Annotated[
        Path | None,
        Option("--out", "-o", metavar="DIR", help="Folder for the report, the extended model and diagnosis.json."),
    ] = None,
    pdf: Pdf = None,
    json: Json = None,
    only: Annotated[
        list[str] | None, Option(metavar="CAUSE", help="Cause to consider, no others (names above). Repeatable.")
    ] = None,
    without: Annotated[
        list[str] | None, Option(metavar="CAUSE", help="Cause to leave out (names above). Repeatable.")
    ] = None,
    without_channel: Annotated[
        list[str] | None, Option(metavar="NAME", help="Channel to leave out. Repeatable.")
    ] = None,
    without_mode: Annotated[
        list[float] | None, Option(metavar="HZ", help="Frequency of a mode to leave out, within 2 %. Repeatable.")
    ] = None,
    fix: Annotated[
        list[str] | None,
        Option(
            metavar="NAME", help="Model parameter that keeps the file's value (`structure --parameters`). Repeatable."
        ),
    ] = None,
    bound: Annotated[
        list[str] | None, Option(metavar="NAME=MIN:MAX", help="Bounds of a model parameter, in its unit. Repeatable.")
    ] = None,
    effort: Annotated[
        list[str] | None,
        Option(
            metavar="KIND=HOURS",
            help="Hours of work. Default: sensor=2, known_mass=0.5, instrument=1. Repeatable.",
        ),
    ] = None,
    follows: Annotated[
        Path | None,
        Option(metavar="FILE", help="JSON of an earlier diagnosis whose advice was followed: what it left open."),
    ] = None,
    force: Force = False,
) -> int:
    """Diagnose a change, or the errors of a model.

    With --reference: what has changed since the reference logs. Without: what the structure file gets wrong.

    --from and --to limit LOG, not the logs of --reference and --held-out. A log that shows both states can be LOG with
    --from and --reference with --reference-to. A part of a log can be held out: --to 400 --held-out LOG
    --held-out-from 400.

    Names of causes for --only and --without: added_mass, global_stiffness, global_density, temperature,
    sampling_clock, local_stiffness, distributed_mass, axial_force, member_temperature, support_spring,
    attached_oscillator, ground_mode, mesh_error, model_parameters, damping_change, amplitude_softening,
    support_stiffness, joint_stiffness, sensor_gain, sensor_polarity, sensor_swap, sensor_orientation, sensor_position,
    sensor_delay, sensor_dead. The words of an answer, such as 'dead sensor', are accepted too.

    Example:
    modalwatch diagnose structure.toml now.mcap --reference before.mcap --out out
    """
    from monitor.analysis.selection import Selection
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.diagnose.arguments import Logs, MassLog, bound_of, effort_of
    from monitor.cli.data.diagnose.diagnosis import diagnose_logs
    from monitor.cli.data.diagnose.written_files import FOLDER_FILES, beside_json
    from monitor.cli.output import check_outputs, existing_in
    from monitor.errors import ArgumentError
    from updater.quantities import cause_name

    check_outputs({"--out": existing_in(out, FOLDER_FILES), "--pdf": pdf, "--json": json}, force=force)
    if not out:
        check_outputs({"--json": beside_json(json)}, force=force)
    named = Logs(
        current=logs,
        reference=reference or (),
        heldout=held_out or (),
        mass=tuple(map(MassLog.of, known_mass or ())),
        within=time_range(start, stop),
        reference_within=time_range(reference_from, reference_to, ("--reference-from", "--reference-to")),
        heldout_within=time_range(held_out_from, held_out_to, ("--held-out-from", "--held-out-to")),
        exponential_window=exponential_window,
    )
    for hertz in without_mode or ():
        if not hertz > 0:
            raise ArgumentError("--without-mode", f"expected a positive frequency in Hz, found {hertz:g}")
    selection = Selection(
        only=tuple(map(cause_name, only or ())),
        without=tuple(map(cause_name, without or ())),
        without_channels=tuple(without_channel or ()),
        without_modes=tuple(without_mode or ()),
        fixed=tuple(fix or ()),
        bounds=dict(map(bound_of, bound or ())),
    )
    work = effort_of(effort or ())
    return diagnose_logs(
        structure, named, selection, window=window, out=out, json_path=json, pdf=pdf, effort=work, follows=follows
    )
