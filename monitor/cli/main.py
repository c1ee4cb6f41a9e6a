"""`modalwatch`: the table of commands."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from monitor.cli.exits import DONE, INTERRUPTED, explain
from monitor.cli.log_table import log_app

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None)


app.add_typer(log_app, name="log")


@app.callback()
def _options(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an internal error.")] = False,
) -> None:
    """Watch a structure with accelerometers: has it changed, where, by how much, how sure."""
    _debug.append(debug)


_debug: list[bool] = []


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for what the demo leaves behind.")] = Path("demo-output"),
    seed: Annotated[
        int | None, typer.Option(help="Draws the rig and what happens to it; drawn itself unless given.")
    ] = None,
    speed: Annotated[float, typer.Option(help="Seconds of data a second.", min=0.1, max=20)] = 10.0,
    short: Annotated[bool, typer.Option("--short", help="A quarter of the length, less sure answers.")] = False,
) -> None:
    """Tell the whole story on an emulated rig: run, alarm, viewer file, answer."""
    from monitor.cli.demo import FULL, SHORT, demo_command

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
    """Play a virtual rig: real protocols on ptys, and a timeline of what happens to the structure."""
    from monitor.rig import run_rig

    done = run_rig(scenario, speed=speed, ports=ports, report=report)
    typer.echo(f"{done.sent} frames sent, {done.dropped} dropped")


_Given = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Setting instead of the file's: analysis.overlap=0.5; repeat."),
]


@app.command()
def run(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml")],
    given: _Given = None,
    json_log: Annotated[bool, typer.Option("--json-log", help="Say what happens as one JSON object a line.")] = False,
) -> None:
    """Watch a site until SIGTERM or Ctrl-C."""
    from monitor.cli.watch import run_command

    raise typer.Exit(run_command(site, given or (), as_json=json_log))


@app.command()
def settings(
    site: Annotated[Path | None, typer.Argument(metavar="SITE.toml", help="Site; the defaults unless given.")] = None,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON Schema that editors use.")] = False,
    given: _Given = None,
) -> None:
    """Print all settings as TOML, each with what it means."""
    from monitor.cli.settings_shown import settings_command

    raise typer.Exit(settings_command(site, given or (), schema=schema))


@app.command("install-service")
def install_service(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml")],
    user: Annotated[bool, typer.Option("--user", help="For your own service manager, not the system's.")] = False,
    only_print: Annotated[bool, typer.Option("--print", help="Print the unit, write nothing.")] = False,
) -> None:
    """Write the systemd unit that runs a site: from boot, watched, with no more rights than it needs."""
    from monitor.cli.service import install_command

    raise typer.Exit(install_command(site, of_user=user, only_print=only_print))


@app.command()
def health(site: Annotated[Path, typer.Argument(metavar="SITE.toml")]) -> None:
    """Ask a site's running monitor, by its [web] section, whether it is well; 1 with what is stale if not."""
    from monitor.cli.service import health_command

    raise typer.Exit(health_command(site))


@app.command()
def history(
    target: Annotated[str, typer.Argument(metavar="SITE.toml|FILE|URL", help="Site, SQLite file or database.")],
    days: Annotated[
        float | None, typer.Option(help="Only the last days, counted from now; all of them unless given.", min=0.0)
    ] = None,
    csv: Annotated[Path | None, typer.Option(metavar="FILE", help="File that gets the modes' courses.")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="PICTURE.png", help="Novelty and shifts over time.")] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="File that gets all of it.")] = None,
) -> None:
    """Say what has been found over the years: alarms, courses of the modes, events."""
    from monitor.cli.history import Outputs, history_command

    raise typer.Exit(history_command(target, days, Outputs(csv=csv, plot=plot, json=json)))


@app.command()
def acknowledge(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml")],
    by: Annotated[str, typer.Option(help="Who knows of the alarm.")] = "",
    note: Annotated[str, typer.Option(help="What they know.")] = "",
) -> None:
    """Tell a running monitor that a person knows of its alarm."""
    from monitor.cli.watch import acknowledge_command

    raise typer.Exit(acknowledge_command(site, by, note))


@app.command()
def accept(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml")],
    alarm: Annotated[
        str | None,
        typer.Argument(metavar="ALARM", help="When it was raised, as `history` shows it; the one that stands."),
    ] = None,
    cause: Annotated[str, typer.Option("--as", help="What the change is, such as 'pump, 150 g'.")] = "",
    by: Annotated[str, typer.Option(help="Who accepts it.")] = "",
    undo: Annotated[bool, typer.Option("--undo", help="Take the last acceptance back.")] = False,
    note: Annotated[str, typer.Option(help="Why it is taken back.")] = "",
) -> None:
    """Make the change that raised the alarm the new normal: an intended or explained one."""
    from monitor.cli.accepting import accept_command, undo_command

    raise typer.Exit(undo_command(site, by, note) if undo else accept_command(site, alarm, cause, by))


@app.command()
def prove(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml")],
    mass: Annotated[float, typer.Option(help="That hangs on now [kg].", min=1e-6)],
    at: Annotated[str, typer.Option(metavar="X,Z|X,Y,Z", help="Where, on a member [m].")],
    log: Annotated[
        list[Path] | None,
        typer.Option(metavar="LOG.mcap|DIR", help="Look at this log instead of what the monitor remembers; repeat."),
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="File that gets it all.")] = None,
) -> None:
    """Commission a site: hang a known mass on, wait for the alarm, see whether the answer holds."""
    from monitor.cli.proving import prove_command

    raise typer.Exit(prove_command(site, mass, at, log or [], json))


@app.command()
def replay(
    log: Annotated[list[Path], typer.Argument(metavar="LOG.mcap...|DIR", help="A log, files of a run, or its folder.")],
    site: Annotated[Path | None, typer.Option(help="Settings to use instead of those attached to the log.")] = None,
    json: Annotated[Path | None, typer.Option(help="File that gets what was found.")] = None,
) -> None:
    """Run the same loop over a log, as fast as it goes."""
    from monitor.cli.watch import replay_command

    raise typer.Exit(replay_command(log, site, json))


@app.command()
def check(site: Annotated[Path, typer.Argument(metavar="SITE.toml")], given: _Given = None) -> None:
    """Validate settings, ask each device who it is and how fast it sends, say what would run."""
    from monitor.cli.check import check_command

    raise typer.Exit(check_command(site, given or ()))


@app.command()
def devices(
    port: Annotated[
        list[str] | None, typer.Option(metavar="PORT", help="Look at this port only; repeat. All unless given.")
    ] = None,
    probe: Annotated[bool, typer.Option("--probe/--no-probe", help="Ask who answers.")] = True,
    every: Annotated[bool, typer.Option("--all", help="Ask at ports too that are not USB.")] = False,
    bitrate: Annotated[int, typer.Option(help="Of a bus behind an SLCAN adapter [bit/s].", min=10_000)] = 1_000_000,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="File that gets what was found.")] = None,
) -> None:
    """List serial ports and CAN adapters, ask who answers there, and print settings to paste."""
    from monitor.cli.devices import Asked, devices_command

    asked = Asked(ports=tuple(port or ()), probe=probe, every=every, bitrate=bitrate)
    raise typer.Exit(devices_command(asked, json))


@app.command("import")
def import_(
    data: Annotated[
        Path,
        typer.Argument(metavar="DATA", help="A table (CSV), .npz, .mat, .uff, .unv; .log, .blf, .asc, .trc of CAN."),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="LOG.mcap", help="Log to write.")],
    rate: Annotated[float | None, typer.Option(help="Samples a second [Hz], if DATA has no times.", min=1e-6)] = None,
    unit: Annotated[str, typer.Option(help="Of the numbers: m/s2 or g.")] = "m/s2",
    scale: Annotated[float, typer.Option(help="Units a number, if not 1.", min=1e-12)] = 1.0,
    start: Annotated[str | None, typer.Option(help="Time of the first sample, ISO 8601; 1970 unless given.")] = None,
    time: Annotated[
        str | None, typer.Option(metavar="NAME", help="Column of times [s]; t or time unless given.")
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME[=SENSOR]", help="Column to take, and the sensor it is; repeat. All unless given."),
    ] = None,
    velocity: Annotated[
        list[str] | None, typer.Option(metavar="SENSOR", help="Sensor whose numbers are velocities [m/s]; repeat.")
    ] = None,
    structure: Annotated[Path | None, typer.Option(metavar="FILE", help="structure.toml to attach.")] = None,
    site: Annotated[Path | None, typer.Option(metavar="FILE", help="SITE.toml to attach, with its structure.")] = None,
    dbc: Annotated[Path | None, typer.Option(metavar="FILE", help="Of CAN traffic: what the frames say.")] = None,
    counter: Annotated[str | None, typer.Option(metavar="SIGNAL", help="Of CAN traffic: what counts scans.")] = None,
) -> None:
    """Make a log of a file of measurements: one column a channel, named as its sensor."""
    from daq import CAN_LOGS
    from monitor.cli.importing import ImportOptions, import_command
    from monitor.cli.importing_can import import_can_command

    options = ImportOptions(
        rate=rate,
        unit=unit,
        scale=scale,
        start=start,
        time=time,
        columns=tuple(column or ()),
        velocities=tuple(velocity or ()),
        structure=structure,
        site=site,
        dbc=dbc,
        counter=counter,
    )
    command = import_can_command if dbc or data.suffix.lower() in CAN_LOGS else import_command
    raise typer.Exit(command(data, out, options))


@app.command()
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
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="File that gets what was found.")] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="PICTURE.png", help="Spectrum, stabilization diagram and shapes.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder that gets modes.json, modes.unv (UFF 55) and pictures.")
    ] = None,
) -> None:
    """Identify the modes of logs: one estimate, averaged over all windows, with its uncertainty."""
    from monitor.cli.identifying import Options, identify_command

    options = Options(method=method, window=window, band=band, structure=structure, references=tuple(reference or ()))
    raise typer.Exit(identify_command(logs, options, json, picture, out))


@app.command()
def diagnose(
    structure: Annotated[Path, typer.Argument(metavar="STRUCTURE.toml")],
    logs: Annotated[list[Path], typer.Argument(metavar="LOG", help="Logs, folders of them, or tables of modes (CSV).")],
    reference: Annotated[
        list[Path] | None, typer.Option(metavar="LOG", help="Log of the structure as it was; may be repeated.")
    ] = None,
    holdout: Annotated[
        list[Path] | None, typer.Option(metavar="LOG", help="Log to measure the gain on, not used else; repeatable.")
    ] = None,
    window: Annotated[float | None, typer.Option(help="Length of a window [s]; chosen unless given.", min=0.1)] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder that gets report, extended model and diagnosis.json.")
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="File that gets the diagnosis.")] = None,
) -> None:
    """Name what has changed since the reference logs; without them, what the model gets wrong about the logs."""
    from monitor.cli.diagnosing import Logs, diagnose_command

    named = Logs(current=logs, reference=reference or (), heldout=holdout or ())
    raise typer.Exit(diagnose_command(structure, named, window=window, out=out, json_path=json))


@app.command()
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
    highest: Annotated[float, typer.Option(metavar="HZ", help="Frequency up to which modes are identified.")] = 400.0,
    target: Annotated[str | None, typer.Option(metavar="MASS", help="A mass to be found, such as 50g.")] = None,
    within: Annotated[str, typer.Option(metavar="LENGTH", help="How near it must be found.")] = "50mm",
) -> None:
    """Draw a structure, list its modes, and say what its sensors see of them and of a mass put on it."""
    from monitor.cli.structure import Asked, structure_command

    asked = Asked(
        n_modes=modes,
        seconds=record,
        damping=damping,
        highest=highest,
        target=target,
        within=within,
        channels=channels,
    )
    raise typer.Exit(structure_command(file, asked, json_path=json, picture=out))


@app.command()
def report(
    path: Annotated[Path, typer.Argument(metavar="DIR|LOG.mcap")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="The page; beside the log unless given.")] = None,
    diagnosis: Annotated[
        Path | None, typer.Option(help="What `diagnose --json` wrote, to show instead of the log's own.")
    ] = None,
) -> None:
    """Write what a log says as one HTML page, the verdict first."""
    from monitor.cli.view import report_command

    raise typer.Exit(report_command(path, out, diagnosis))


@app.command()
def repair(log: Annotated[Path, typer.Argument(metavar="LOG.mcap")]) -> None:
    """Mend a log that was cut or damaged, in place: every whole chunk is kept."""
    from monitor.cli.logs import repair_command

    raise typer.Exit(repair_command(log))


@app.command()
def view(
    target: Annotated[str, typer.Argument(metavar="DIR|LOG.mcap|URL")],
    out: Annotated[Path | None, typer.Option(help="File that gets the recording; a cache unless given.")] = None,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the rerun viewer on it.")] = True,
) -> None:
    """Open the rerun viewer on what a log says, or on a monitor that runs."""
    from monitor.cli.view import view_command

    raise typer.Exit(view_command(target, out, show=show))


def main() -> None:
    """Run the command line; every error becomes one line and an exit code."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # small matrices beside a stream: more threads only take its time
    sys.exit(_run())


def _run() -> int:
    try:
        app(prog_name="modalwatch")
    except SystemExit as end:  # typer has said what was wrong with the arguments
        return int(end.code or DONE)
    except KeyboardInterrupt:
        return INTERRUPTED
    except Exception as error:  # noqa: BLE001 - the daemon's edge: nothing may leave without an exit code
        return explain(error, debug=any(_debug))
    return DONE
