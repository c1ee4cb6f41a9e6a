"""Signatures of the commands that work on a site."""

from pathlib import Path
from typing import Annotated

import typer

from monitor.cli.range_options import From, To

site_app = typer.Typer()

_Given = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a setting, e.g. analysis.overlap=0.5. Repeatable."),
]


@site_app.command()
def run(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml")],
    given: _Given = None,
    json_log: Annotated[bool, typer.Option("--json-log", help="Print events as JSON, one object per line.")] = False,
) -> None:
    """Monitor a site until SIGTERM or Ctrl-C."""
    from monitor.cli.site.run import run_command

    raise typer.Exit(run_command(site, given or (), as_json=json_log))


@site_app.command()
def settings(
    site: Annotated[
        Path | None, typer.Argument(metavar="SITE.toml", help="SITE.toml. Default: the default settings.")
    ] = None,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON Schema of the settings, for editors.")
    ] = False,
    given: _Given = None,
) -> None:
    """Print all settings as TOML, each with its meaning."""
    from monitor.cli.site.settings import settings_command

    raise typer.Exit(settings_command(site, given or (), schema=schema))


@site_app.command("install-service")
def install_service(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml")],
    user: Annotated[
        bool, typer.Option("--user", help="Unit for the user's service manager instead of the system's.")
    ] = False,
    only_print: Annotated[bool, typer.Option("--print", help="Print the unit instead of writing it.")] = False,
    run_as: Annotated[
        str | None,
        typer.Option("--as", metavar="USER", help="User that runs the service. Default: the owner of the folder."),
    ] = None,
) -> None:
    """Write a systemd unit for a site.

    The service starts at boot, is supervised by systemd, and has minimal rights.
    """
    from monitor.cli.site.service import install_command

    raise typer.Exit(install_command(site, of_user=user, only_print=only_print, run_as=run_as))


@site_app.command()
def health(site: Annotated[Path, typer.Argument(metavar="SITE.toml")]) -> None:
    """Check the health of a running monitor.

    Uses its [web] section. Prints the problems, with exit code 1, if it is not healthy.
    """
    from monitor.cli.site.service import health_command

    raise typer.Exit(health_command(site))


@site_app.command()
def history(
    target: Annotated[str, typer.Argument(metavar="SITE.toml|FILE|URL", help="Site, SQLite file or database.")],
    days: Annotated[
        float | None, typer.Option(help="Number of days, counted back from now. Default: all.", min=0.0)
    ] = None,
    csv: Annotated[Path | None, typer.Option(metavar="FILE", help="CSV file to write: modes over time.")] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="PICTURE.png", help="Picture to write: novelty and frequency shifts over time."),
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="JSON file to write.")] = None,
) -> None:
    """List alarms, modes and events of a site over time."""
    from monitor.cli.site.history import Outputs, history_command

    raise typer.Exit(history_command(target, days, Outputs(csv=csv, plot=plot, json=json)))


@site_app.command()
def acknowledge(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml")],
    by: Annotated[str, typer.Option(help="Name of the person.")] = "",
    note: Annotated[str, typer.Option(help="Comment.")] = "",
) -> None:
    """Acknowledge the alarm of a running monitor."""
    from monitor.cli.site.run import acknowledge_command

    raise typer.Exit(acknowledge_command(site, by, note))


@site_app.command()
def accept(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml")],
    alarm: Annotated[
        str | None,
        typer.Argument(
            metavar="ALARM", help="Time at which the alarm was raised, as in `history`. Default: the active alarm."
        ),
    ] = None,
    cause: Annotated[str, typer.Option("--reason", help="Cause of the change, such as 'pump, 150 g'.")] = "",
    by: Annotated[str, typer.Option(help="Name of the person.")] = "",
    undo: Annotated[bool, typer.Option("--undo", help="Undo the last acceptance.")] = False,
    note: Annotated[str, typer.Option(help="Reason for the undo.")] = "",
) -> None:
    """Accept an alarmed change as the new reference."""
    from monitor.cli.site.accept import accept_command, undo_command

    raise typer.Exit(undo_command(site, by, note) if undo else accept_command(site, alarm, cause, by))


@site_app.command()
def prove(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml")],
    mass: Annotated[float, typer.Option(help="Known mass that is attached now [kg].", min=1e-6)],
    position: Annotated[str, typer.Option(metavar="X,Y,Z", help="Its position on a member [m]; X,Z of a plane frame.")],
    log: Annotated[
        list[Path] | None,
        typer.Option(metavar="LOG.mcap|DIR", help="Log to use instead of the saved state of the monitor. Repeatable."),
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="JSON file to write.")] = None,
) -> None:
    """Commission a site with a known mass.

    Attach the mass and wait for the alarm. The answer is compared with mass and position.
    """
    from monitor.cli.site.prove import prove_command

    raise typer.Exit(prove_command(site, mass, position, log or [], json))


@site_app.command()
def replay(
    log: Annotated[list[Path], typer.Argument(metavar="LOG.mcap...|DIR", help="Logs, or the folder of a run.")],
    site: Annotated[
        Path | None, typer.Option(help="SITE.toml to use instead of the settings attached to the log.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="WATCHED.mcap", help="Log to write, with signals and results."),
    ] = None,
    json: Annotated[Path | None, typer.Option(help="JSON file to write.")] = None,
    start: From = None,
    stop: To = None,
    given: _Given = None,
) -> None:
    """Repeat the analysis of a log at full speed.

    Results are compared with the live ones. With --from the baseline is learned from that time on, and
    nothing is compared.
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.site.run import replay_command

    raise typer.Exit(replay_command(log, site, json, out, given or (), time_range(start, stop)))


@site_app.command()
def check(site: Annotated[Path, typer.Argument(metavar="SITE.toml")], given: _Given = None) -> None:
    """Check the settings, the devices and their rates before a run."""
    from monitor.cli.site.check import check_command

    raise typer.Exit(check_command(site, given or ()))


@site_app.command()
def devices(
    port: Annotated[
        list[str] | None, typer.Option(metavar="PORT", help="Port to search. Repeatable. Default: all ports.")
    ] = None,
    probe: Annotated[bool, typer.Option("--probe/--no-probe", help="Query devices at the ports.")] = True,
    every: Annotated[bool, typer.Option("--all", help="Also query ports that are not USB.")] = False,
    bitrate: Annotated[
        int, typer.Option(help="Bit rate of the bus behind an SLCAN adapter [bit/s].", min=10_000)
    ] = 1_000_000,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="JSON file to write.")] = None,
) -> None:
    """List ports and devices, with settings to paste."""
    from monitor.cli.site.devices import Asked, devices_command

    asked = Asked(ports=tuple(port or ()), probe=probe, every=every, bitrate=bitrate)
    raise typer.Exit(devices_command(asked, json))


@site_app.command()
def reanalyse(
    archive: Annotated[
        list[str],
        typer.Argument(metavar="ARCHIVE", help="Logs, folders (searched to any depth), or URLs (s3://, gs://)."),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="RESULTS", help="Folder for the results.")],
    site: Annotated[
        Path | None, typer.Option(metavar="SITE.toml", help="Settings. Default: those attached to each log.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Scheduler of Dask. Default: processes of this machine.")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Processes. Default: one per core.", min=1)] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="List the logs and what would be computed.")] = False,
    given: _Given = None,
) -> None:
    """Analyse an archive of logs again, in parallel.

    Windows are identified in parallel, and evaluated per site in order of time. A repeated run computes only
    what is new.
    """
    from monitor.cli.site.reanalyse import reanalyse_command

    raise typer.Exit(reanalyse_command(archive, out, site, scheduler, workers, dry_run=dry_run, given=given or ()))
