"""The table of commands about a site that is watched."""

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
    json_log: Annotated[bool, typer.Option("--json-log", help="Say what happens as one JSON object a line.")] = False,
) -> None:
    """Watch a site until SIGTERM or Ctrl-C."""
    from monitor.cli.site.run import run_command

    raise typer.Exit(run_command(site, given or (), as_json=json_log))


@site_app.command()
def settings(
    site: Annotated[Path | None, typer.Argument(metavar="SITE.toml", help="Site; the defaults unless given.")] = None,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON Schema that editors use.")] = False,
    given: _Given = None,
) -> None:
    """Print all settings as TOML, each with what it means."""
    from monitor.cli.site.settings import settings_command

    raise typer.Exit(settings_command(site, given or (), schema=schema))


@site_app.command("install-service")
def install_service(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml")],
    user: Annotated[bool, typer.Option("--user", help="For your own service manager, not the system's.")] = False,
    only_print: Annotated[bool, typer.Option("--print", help="Print the unit, write nothing.")] = False,
    run_as: Annotated[
        str | None, typer.Option("--as", metavar="USER", help="Run as this user; the owner of the folder unless given.")
    ] = None,
) -> None:
    """Write the systemd unit that runs a site: from boot, watched, with no more rights than it needs."""
    from monitor.cli.site.service import install_command

    raise typer.Exit(install_command(site, of_user=user, only_print=only_print, run_as=run_as))


@site_app.command()
def health(site: Annotated[Path, typer.Argument(metavar="SITE.toml")]) -> None:
    """Ask a site's running monitor, by its [web] section, whether it is well; 1 with what is stale if not."""
    from monitor.cli.site.service import health_command

    raise typer.Exit(health_command(site))


@site_app.command()
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
    from monitor.cli.site.history import Outputs, history_command

    raise typer.Exit(history_command(target, days, Outputs(csv=csv, plot=plot, json=json)))


@site_app.command()
def acknowledge(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml")],
    by: Annotated[str, typer.Option(help="Who knows of the alarm.")] = "",
    note: Annotated[str, typer.Option(help="What they know.")] = "",
) -> None:
    """Tell a running monitor that a person knows of its alarm."""
    from monitor.cli.site.run import acknowledge_command

    raise typer.Exit(acknowledge_command(site, by, note))


@site_app.command()
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
    from monitor.cli.site.accept import accept_command, undo_command

    raise typer.Exit(undo_command(site, by, note) if undo else accept_command(site, alarm, cause, by))


@site_app.command()
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
    from monitor.cli.site.prove import prove_command

    raise typer.Exit(prove_command(site, mass, at, log or [], json))


@site_app.command()
def replay(
    log: Annotated[list[Path], typer.Argument(metavar="LOG.mcap...|DIR", help="A log, files of a run, or its folder.")],
    site: Annotated[Path | None, typer.Option(help="Settings to use instead of those attached to the log.")] = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="WATCHED.mcap", help="Log that gets it all, for `report` and `view`."),
    ] = None,
    json: Annotated[Path | None, typer.Option(help="File that gets what was found.")] = None,
    start: From = None,
    stop: To = None,
    given: _Given = None,
) -> None:
    """Run the same loop over a log, as fast as it goes.

    With --from the baseline is learnt from there on, so that nothing can be compared with what was found live.
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.site.run import replay_command

    raise typer.Exit(replay_command(log, site, json, out, given or (), time_range(start, stop)))


@site_app.command()
def check(site: Annotated[Path, typer.Argument(metavar="SITE.toml")], given: _Given = None) -> None:
    """Validate settings, ask each device who it is and how fast it sends, say what would run."""
    from monitor.cli.site.check import check_command

    raise typer.Exit(check_command(site, given or ()))


@site_app.command()
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
    from monitor.cli.site.devices import Asked, devices_command

    asked = Asked(ports=tuple(port or ()), probe=probe, every=every, bitrate=bitrate)
    raise typer.Exit(devices_command(asked, json))
