"""The table of commands about files: measurements, structures, logs."""

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
    rate: Annotated[float | None, typer.Option(help="Samples a second [Hz], if DATA has no times.", min=1e-6)] = None,
    unit: Annotated[
        str | None, typer.Option(help="Of the numbers: m/s2, mm/s2, g, mg; as their columns say, or m/s2.")
    ] = None,
    scale: Annotated[float | None, typer.Option(help="Units a number, if not 1.", min=1e-12)] = None,
    start: Annotated[
        str | None, typer.Option(help="Time of the first sample, ISO 8601; as DATA says, else 1970.")
    ] = None,
    time: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Column of times; t or time (t_ms, time [s]) unless given."),
    ] = None,
    time_unit: Annotated[
        str | None, typer.Option(help="Of the times: s, ms, us, ns, min, h, d; as their column's name says, or s.")
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME[=SENSOR]", help="Column to take, and the sensor it is; repeat. All unless given."),
    ] = None,
    velocity: Annotated[
        list[str] | None, typer.Option(metavar="SENSOR", help="Sensor whose numbers are velocities [m/s]; repeat.")
    ] = None,
    temperature: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Column of temperatures; those whose unit says so unless given."),
    ] = None,
    transpose: Annotated[
        bool | None,
        typer.Option("--transpose/--no-transpose", help="Each row of an array is a channel; asked for if in doubt."),
    ] = None,
    structure: Annotated[Path | None, typer.Option(metavar="FILE", help="structure.toml to attach.")] = None,
    site: Annotated[Path | None, typer.Option(metavar="FILE", help="SITE.toml to attach, with its structure.")] = None,
    new_site: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="SITE.toml to write for the channels, and to attach; with --structure."),
    ] = None,
    dbc: Annotated[Path | None, typer.Option(metavar="FILE", help="Of CAN traffic: what the frames say.")] = None,
    counter: Annotated[str | None, typer.Option(metavar="SIGNAL", help="Of CAN traffic: what counts scans.")] = None,
) -> None:
    """Make a log of measurements: one column a channel, named as its sensor."""
    from daq import CAN_LOGS
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
    method: Annotated[str, typer.Option(help="Way of identification.")] = "ssi-data",
    window: Annotated[
        float | None,
        typer.Option(help="Length of a window [s]; that of the log's settings, else the whole log.", min=0.1),
    ] = None,
    band: Annotated[
        tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="Where modes are sought [Hz].")
    ] = None,
    structure: Annotated[
        Path | None, typer.Option(metavar="FILE", help="structure.toml to compare with; the log's own unless given.")
    ] = None,
    reference: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Sensor that stays while others move, each log being a set-up; repeat."),
    ] = None,
    start: From = None,
    stop: To = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="File that gets what was found.")] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="PICTURE.png", help="Spectrum, stabilization diagram and shapes.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder that gets modes.json, modes.unv (UFF 55) and pictures.")
    ] = None,
) -> None:
    """Identify the modes of logs: one estimate, averaged over all windows, with its uncertainty.

    All logs count as one record for --from and --to; with --reference each log separately.
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
        list[Path] | None, typer.Option(metavar="LOG", help="Log of the structure as it was; may be repeated.")
    ] = None,
    holdout: Annotated[
        list[Path] | None, typer.Option(metavar="LOG", help="Held-out log: used only to measure the gain. Repeatable.")
    ] = None,
    start: From = None,
    stop: To = None,
    reference_start: Annotated[
        str | None, typer.Option("--reference-from", metavar="TIME", help="The same of the reference logs.")
    ] = None,
    reference_stop: Annotated[
        str | None, typer.Option("--reference-to", metavar="TIME", help="The same of the reference logs.")
    ] = None,
    window: Annotated[float | None, typer.Option(help="Length of a window [s]; chosen unless given.", min=0.1)] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder that gets report, extended model and diagnosis.json.")
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="File that gets the diagnosis.")] = None,
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
        typer.Option(metavar="NAME=LEAST:GREATEST", help="Bounds of a model parameter, in its unit. Repeatable."),
    ] = None,
) -> None:
    """Name what has changed since the reference logs; without them, what the model gets wrong about the logs.

    --from and --to limit LOG, not the logs of --reference and --holdout. A log that shows both states can be LOG with
    --from and --reference with --reference-to.
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.diagnose import Logs, diagnose_command
    from monitor.cli.data.selection import selection_of

    named = Logs(
        current=logs,
        reference=reference or (),
        heldout=holdout or (),
        within=time_range(start, stop),
        reference_within=time_range(reference_start, reference_stop, ("--reference-from", "--reference-to")),
    )
    selection = selection_of(only, without, without_channel, without_mode, fix, bound)
    raise typer.Exit(diagnose_command(structure, named, window=window, out=out, json_path=json, selection=selection))


@data_app.command()
def bodies(
    file: Annotated[
        Path, typer.Argument(metavar="BODIES.toml", help="Structure, bodies, and per record places and frequencies.")
    ],
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="File that gets the result.")] = None,
) -> None:
    """Identify which bodies at known places were taken off or added, by several records together."""
    from monitor.cli.data.bodies import bodies_command

    raise typer.Exit(bodies_command(file, json_path=json))


@data_app.command()
def structure(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="structure.toml.")],
    modes: Annotated[int, typer.Option(help="How many modes to list.", min=1, max=100)] = 12,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="File that gets the figures.")] = None,
    out: Annotated[Path | None, typer.Option(metavar="PICTURE.png", help="Picture; beside FILE unless given.")] = None,
    channels: Annotated[
        Path | None, typer.Option(metavar="SITE.toml|LOG", help="Channels to set against the sensors.")
    ] = None,
    record: Annotated[float, typer.Option(metavar="S", help="Seconds measured before a change, and after.")] = 600.0,
    damping: Annotated[float, typer.Option(help="Damping ratio of the modes.")] = 0.005,
    highest: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Frequency up to which modes are identified: of --channels, else 400."),
    ] = None,
    target: Annotated[str | None, typer.Option(metavar="MASS", help="A mass to be found, such as 50g.")] = None,
    within: Annotated[str, typer.Option(metavar="LENGTH", help="How near it must be found.")] = "50mm",
    parameters: Annotated[
        bool, typer.Option("--parameters", help="List the model parameters that may be updated, with sensitivities.")
    ] = False,
) -> None:
    """Draw a structure, list its modes, and say what its sensors see of them and of a mass put on it."""
    from monitor.cli.data.structure import Asked, structure_command

    asked = Asked(
        n_modes=modes,
        seconds=record,
        damping=damping,
        highest=highest,
        target=target,
        within=within,
        channels=channels,
        parameters=parameters,
    )
    raise typer.Exit(structure_command(file, asked, json_path=json, picture=out))


@data_app.command()
def report(
    path: Annotated[Path, typer.Argument(metavar="DIR|LOG.mcap")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="The page; beside the log unless given.")] = None,
    diagnosis: Annotated[
        Path | None, typer.Option(help="What `diagnose --json` wrote, to show instead of the log's own.")
    ] = None,
    start: From = None,
    stop: To = None,
) -> None:
    """Write what a log says as one HTML page, the verdict first.

    With a range, only windows entirely inside it are shown. The baseline and an alarm that is active at --from are
    taken from earlier.
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.view import report_command

    raise typer.Exit(report_command(path, out, diagnosis, time_range(start, stop)))


@data_app.command()
def repair(log: Annotated[Path, typer.Argument(metavar="LOG.mcap")]) -> None:
    """Mend a log that was cut or damaged, in place: every whole chunk is kept."""
    from monitor.cli.data.log import repair_command

    raise typer.Exit(repair_command(log))


@data_app.command()
def view(
    target: Annotated[str, typer.Argument(metavar="DIR|LOG.mcap|URL")],
    out: Annotated[Path | None, typer.Option(help="File that gets the recording; a cache unless given.")] = None,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the rerun viewer on it.")] = True,
    start: From = None,
    stop: To = None,
) -> None:
    """Open the rerun viewer on what a log says, or on a monitor that runs.

    A range is shown as by `report`.
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.view import view_command

    raise typer.Exit(view_command(target, out, show=show, within=time_range(start, stop)))
