"""A virtual rig on the terminal: its devices, its timeline, and what happens."""

from pathlib import Path

from rich.markup import escape
from rich.table import Table

from daq.notebook import utc_text
from monitor.cli.demo.rig_site import rig_site
from monitor.cli.options import DONE
from monitor.cli.output import check_outputs, write_new
from monitor.cli.terminal import console, echo, new_table
from monitor.errors import SettingsError
from monitor.rig import RigEvent, Scenario, load_scenario, run_rig, shipped_scenarios
from monitor.rig.process import SHIPPED, load_rig_structure
from updater import t_structure_toml
from updater.quantities import Opens

_STRUCTURE = "t_structure.toml"  # copy of the shipped structure, next to the site
_WINDOW, _BASELINE = 40.0, 12  # s; a baseline within 8 minutes
_OPENS: dict[Opens, str] = {
    "above": "has a crack that opens above {}",
    "below": "has a crack that opens below {}",
    "within": "has play within {} on both sides",
    "beyond": "opens beyond {} on both sides",
    "slips": "slips with dry friction beyond {}",
}


def play_rig(scenario: str, *, speed: float, ports: Path, report: Path, site: Path | None, force: bool) -> int:
    """Run a rig until it is over or stopped; print what it does.

    Raises
    ------
    ArgumentError
        If a file to be written exists.
    SettingsError, StructureError
        If the scenario or its structure cannot be used.
    """
    shipped = shipped_scenarios()
    path = shipped.get(scenario, Path(scenario))
    if scenario not in shipped and not path.exists():
        raise SettingsError(path, f"cannot be read: No such file; shipped with the program: {', '.join(shipped)}")
    loaded = load_scenario(path)
    structure = load_rig_structure(path, loaded)
    check_outputs({"--new-site": site, "--ports": ports, "--report": report}, force=force)
    copied = site.with_name(_STRUCTURE) if site and loaded.structure == SHIPPED else None
    check_outputs({"--new-site": copied}, force=force)

    def ready(found: dict[str, object]) -> None:
        console.print(_devices(loaded, found))
        for event in sorted(loaded.event, key=lambda event: event.at):
            echo(f"{event.at:g} s after all devices sample: {_event_text(event)}")
        if not loaded.event:
            echo("no change of the structure")
        echo(f"ports: {ports}; stop with Ctrl-C")
        if site is None:
            return
        file = str((path.parent / loaded.structure).resolve())
        if copied:
            file = _STRUCTURE
            write_new(copied, t_structure_toml(), force=force, option="--new-site")
        text = rig_site(file, structure, loaded, found, window=_WINDOW, baseline_windows=_BASELINE)
        write_new(site, text, force=force, option="--new-site")
        echo(f"monitor it in another terminal: modalwatch run {site}")

    def happened(event: RigEvent, time: int) -> None:
        echo(f"{utc_text(time)}: {_event_text(event)}")

    done = run_rig(path, speed=speed, ports=ports, report=report, ready=ready, happened=happened)
    echo(f"{done.sent} scans sent, {done.dropped} dropped; report: {report}")
    return DONE


def _devices(scenario: Scenario, found: dict[str, object]) -> Table:
    title = f"virtual rig: {scenario.structure}, {scenario.rate:g} Hz"
    table = new_table(("device", "at [m]", "port"), overflow="fold", title=title)
    places = found["ports"]
    assert isinstance(places, dict)
    for device in scenario.device:
        place = places[device.name]
        port = place if isinstance(place, str) else f"{place['interface']} {place['channel']}, node {place['node']}"
        table.add_row(escape(device.name), ", ".join(f"{x:g}" for x in device.at), escape(port))
    return table


def _event_text(event: RigEvent) -> str:
    if event.crack:
        crack = event.crack
        at = f"{crack.distance:g} m from its start, about local {crack.axis}"
        return f"the {crack.member} {_OPENS[crack.opens].format(f'{crack.moment:g} N m')}, {at}"
    assert event.body
    at = ", ".join(f"{x:g}" for x in event.body.at)
    return f"a body of {1000 * event.body.mass:.0f} g is added at ({at}) m"
