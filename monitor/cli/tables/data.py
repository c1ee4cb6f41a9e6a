"""Signatures of the commands that work on files: measurements, structures, logs."""

from pathlib import Path
from typing import Annotated

import typer

from monitor.cli.range_options import From, To

data_app = typer.Typer()


@data_app.command("import")
def import_(
    data: Annotated[
        list[Path],
        typer.Argument(
            metavar="DATA",
            help="A table (CSV), .npz, .mat, .uff, .unv, or tables with dates that follow each other; "
            ".log, .blf, .asc, .trc of CAN.",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="LOG.mcap", help="Log to write.")],
    rate: Annotated[float | None, typer.Option(help="Samples per second [Hz], if DATA has no times.", min=1e-6)] = None,
    unit: Annotated[
        str | None,
        typer.Option(help="Unit of the numbers: m/s2, mm/s2, g, mg. Default: that of the column names, else m/s2."),
    ] = None,
    scale: Annotated[float | None, typer.Option(help="Factor from numbers to units. Default: 1.", min=1e-12)] = None,
    start: Annotated[
        str | None, typer.Option(help="Time of the first sample, ISO 8601. Default: that of DATA, else 1970.")
    ] = None,
    time: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Column of times. Default: t or time (t_ms, time [s])."),
    ] = None,
    time_unit: Annotated[
        str | None,
        typer.Option(help="Unit of the times: s, ms, us, ns, min, h, d. Default: that of the column name, else s."),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=SENSOR]", help="Column to import, and its sensor. Repeatable. Default: all columns."
        ),
    ] = None,
    velocity: Annotated[
        list[str] | None, typer.Option(metavar="SENSOR", help="Sensor that measures velocity [m/s]. Repeatable.")
    ] = None,
    temperature: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Column of temperatures. Default: columns with a unit of temperature."),
    ] = None,
    transpose: Annotated[
        bool | None,
        typer.Option(
            "--transpose/--no-transpose",
            help="Rows of an array are channels (or columns are). Required where the shape is ambiguous.",
        ),
    ] = None,
    structure: Annotated[Path | None, typer.Option(metavar="FILE", help="structure.toml to attach.")] = None,
    site: Annotated[Path | None, typer.Option(metavar="FILE", help="SITE.toml to attach, with its structure.")] = None,
    new_site: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="SITE.toml to write for the channels and to attach. Requires --structure."),
    ] = None,
    dbc: Annotated[
        Path | None, typer.Option(metavar="FILE", help="DBC file that describes the frames of CAN traffic.")
    ] = None,
    counter: Annotated[
        str | None, typer.Option(metavar="SIGNAL", help="Signal of CAN traffic that counts scans.")
    ] = None,
) -> None:
    """Convert files of measurements to a log.

    One column per channel, named as its sensor.
    """
    from daq.files import CAN_LOGS
    from monitor.cli.data.import_ import ImportOptions, import_command
    from monitor.cli.data.import_can import import_can_command

    options = ImportOptions(
        rate=rate,
        unit=unit,
        scale=scale,
        start=start,
        time=time,
        time_unit=time_unit,
        columns=tuple(column or ()),
        velocities=tuple(velocity or ()),
        temperature=temperature,
        transposed=transpose,
        structure=structure,
        site=site,
        new_site=new_site,
        dbc=dbc,
        counter=counter,
    )
    can = dbc is not None or any(path.suffix.lower() in CAN_LOGS for path in data)
    raise typer.Exit((import_can_command if can else import_command)(data, out, options))


@data_app.command()
def identify(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG.mcap...|DIR", help="Logs, or folders of them.")],
    method: Annotated[str, typer.Option(help="Identification method.")] = "ssi-data",
    window: Annotated[
        float | None,
        typer.Option(help="Length of a window [s]. Default: that of the log's settings, else the whole log.", min=0.1),
    ] = None,
    band: Annotated[
        tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="Frequency band of the modes [Hz].")
    ] = None,
    structure: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="structure.toml to compare with. Default: the one attached to the log."),
    ] = None,
    reference: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Reference sensor of set-ups: it stays in place, and each log is one set-up. Repeatable.",
        ),
    ] = None,
    start: From = None,
    stop: To = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="JSON file to write.")] = None,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="PICTURE.png", help="Picture to write: spectrum, stabilization diagram, mode shapes."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for modes.json, modes.unv (UFF 55) and pictures.")
    ] = None,
) -> None:
    """Identify the modes of logs.

    One estimate with its uncertainty, averaged over all windows. All logs count as one record for
    --from and --to; with --reference each log separately.
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.identify import Options, identify_command

    options = Options(
        method=method,
        window=window,
        band=band,
        structure=structure,
        references=tuple(reference or ()),
        within=time_range(start, stop),
    )
    raise typer.Exit(identify_command(logs, options, json, picture, out))


@data_app.command()
def diagnose(
    structure: Annotated[Path, typer.Argument(metavar="STRUCTURE.toml")],
    logs: Annotated[list[Path], typer.Argument(metavar="LOG", help="Logs, folders of them, or tables of modes (CSV).")],
    reference: Annotated[
        list[Path] | None, typer.Option(metavar="LOG", help="Log of the structure before the change. Repeatable.")
    ] = None,
    held_out: Annotated[
        list[Path] | None,
        typer.Option(
            "--held-out",
            "--holdout",
            metavar="LOG",
            help="Held-out log: used only to measure the gain. Repeatable.",
        ),
    ] = None,
    start: From = None,
    stop: To = None,
    reference_start: Annotated[
        str | None,
        typer.Option("--reference-from", metavar="TIME", help="Range of the reference logs, like --from and --to."),
    ] = None,
    reference_stop: Annotated[
        str | None,
        typer.Option("--reference-to", metavar="TIME", help="Range of the reference logs, like --from and --to."),
    ] = None,
    window: Annotated[
        float | None, typer.Option(help="Length of a window [s]. Default: chosen from the first mode.", min=0.1)
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the report, the extended model and diagnosis.json.")
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="JSON file to write.")] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="CAUSE", help="Cause to consider, no others. Repeatable.")
    ] = None,
    without: Annotated[list[str] | None, typer.Option(metavar="CAUSE", help="Cause to leave out. Repeatable.")] = None,
    without_channel: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Channel to leave out. Repeatable.")
    ] = None,
    without_mode: Annotated[
        list[float] | None, typer.Option(metavar="HZ", help="Frequency of a mode to leave out, within 2 %. Repeatable.")
    ] = None,
    fix: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Model parameter that keeps the file's value (`structure --parameters`)."),
    ] = None,
    bound: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=MIN:MAX", help="Bounds of a model parameter, in its unit. Repeatable."),
    ] = None,
) -> None:
    """Diagnose a change, or the errors of a model.

    With --reference: what has changed since the reference logs. Without: what the structure file gets wrong.

    --from and --to limit LOG, not the logs of --reference and --held-out. A log that shows both states can be LOG with
    --from and --reference with --reference-to.
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.diagnose import Logs, diagnose_command
    from monitor.cli.data.selection import selection_of

    named = Logs(
        current=logs,
        reference=reference or (),
        heldout=held_out or (),
        within=time_range(start, stop),
        reference_within=time_range(reference_start, reference_stop, ("--reference-from", "--reference-to")),
    )
    selection = selection_of(only, without, without_channel, without_mode, fix, bound)
    raise typer.Exit(diagnose_command(structure, named, window=window, out=out, json_path=json, selection=selection))


@data_app.command()
def bodies(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="BODIES.toml",
            help="TOML file with the structure, the bodies, and places and frequencies per record.",
        ),
    ],
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="JSON file to write.")] = None,
) -> None:
    """Identify bodies removed or added at known places.

    Several records are used together.
    """
    from monitor.cli.data.bodies import bodies_command

    raise typer.Exit(bodies_command(file, json_path=json))


@data_app.command()
def structure(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="structure.toml.")],
    modes: Annotated[int, typer.Option(help="Number of modes to list.", min=1, max=100)] = 12,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="JSON file to write.")] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="PICTURE.png", help="Picture to write. Default: next to FILE.")
    ] = None,
    channels: Annotated[
        Path | None,
        typer.Option(metavar="SITE.toml|LOG", help="Log or SITE.toml whose channels are compared with the sensors."),
    ] = None,
    record_seconds: Annotated[
        float, typer.Option(metavar="S", help="Length of the records before and after a change [s].")
    ] = 600.0,
    damping: Annotated[float, typer.Option(help="Damping ratio of the modes.")] = 0.005,
    highest: Annotated[
        float | None,
        typer.Option(
            metavar="HZ", help="Frequency up to which modes are identified [Hz]. Default: from --channels, else 400."
        ),
    ] = None,
    target_mass: Annotated[
        str | None, typer.Option(metavar="MASS", help="Mass that must be located, such as 50g.")
    ] = None,
    tolerance: Annotated[
        str, typer.Option(metavar="LENGTH", help="Largest error of its position, such as 50mm.")
    ] = "50mm",
    parameters: Annotated[
        bool, typer.Option("--parameters", help="List the model parameters that may be updated, with sensitivities.")
    ] = False,
) -> None:
    """Draw a structure, and report what its sensors detect.

    Lists its modes, which of them the sensors measure, and the smallest added mass that raises an alarm.
    """
    from monitor.cli.data.structure import Asked, structure_command

    asked = Asked(
        n_modes=modes,
        seconds=record_seconds,
        damping=damping,
        highest=highest,
        target=target_mass,
        within=tolerance,
        channels=channels,
        parameters=parameters,
    )
    raise typer.Exit(structure_command(file, asked, json_path=json, picture=out))


@data_app.command()
def report(
    path: Annotated[Path, typer.Argument(metavar="DIR|LOG.mcap")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Page to write. Default: next to the log.")] = None,
    diagnosis: Annotated[
        Path | None, typer.Option(help="JSON file of `diagnose`, to show instead of the log's own diagnosis.")
    ] = None,
    start: From = None,
    stop: To = None,
) -> None:
    """Write a report of a log as one HTML page.

    With a range, only windows entirely inside it are shown. The baseline and an alarm that is active at --from are
    taken from earlier.
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.view import report_command

    raise typer.Exit(report_command(path, out, diagnosis, time_range(start, stop)))


@data_app.command()
def repair(log: Annotated[Path, typer.Argument(metavar="LOG.mcap")]) -> None:
    """Repair a truncated or damaged log in place. Every complete chunk is kept."""
    from monitor.cli.data.log import repair_command

    raise typer.Exit(repair_command(log))


@data_app.command()
def view(
    target: Annotated[str, typer.Argument(metavar="DIR|LOG.mcap|URL")],
    out: Annotated[Path | None, typer.Option(help="Recording to write. Default: in a cache folder.")] = None,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the rerun viewer on the recording.")] = True,
    start: From = None,
    stop: To = None,
) -> None:
    """Open the rerun viewer on a log or a running monitor.

    A range is shown as by `report`.
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.view import view_command

    raise typer.Exit(view_command(target, out, show=show, within=time_range(start, stop)))
