"""Settings, devices and rates checked before a run."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.markup import escape
from rich.table import Table

from daq.drivers import low_grade
from monitor.cli.options import DONE, NEEDS_A_PERSON
from monitor.cli.terminal import console, echo, new_table, progress, start_error, warn
from monitor.service.acquisition.probe import Probe, probe_devices
from monitor.service.site import Site, load_site
from monitor.service.startup.preflight import disk_plan, look_around
from monitor.settings import AXES, DeviceSettings, Settings
from monitor.text.detection import NO_THERMOMETER
from monitor.text.quantities import counted

_DAY_HOURS = 24.0


def check_site(path: Path, given: Sequence[str]) -> int:
    """Print the plan of a run; return 1 if a device or another requirement is not met.

    Raises
    ------
    SettingsError, StructureError
        If the settings cannot be used.
    StartError
        If a device does not answer.
    """
    site = load_site(path, given)
    _say_plan(site)
    with progress(f"querying {len(site.settings.device)} devices"):
        found = probe_devices(site.settings)
    console.print(_table(site, found))
    silent = [f"device {name}: {what}" for name, what in found.items() if isinstance(what, str)]
    if silent:
        raise start_error(silent)
    problems = [problem for device in site.settings.device for problem in _problems(device, found[device.name])]
    for device in site.settings.device:
        if why := low_grade(device.driver, device.place):
            warn(f"device {device.name} is of low grade: {why}")
    if not site.settings.temperature and not any(_has_thermometer(probe) for probe in found.values()):
        warn(NO_THERMOMETER)
    for problem in problems:
        warn(problem)
    console.print("all devices answer" if not problems else "the devices answer; see the problems above")
    well = _say_around(site)
    return DONE if well and not problems else NEEDS_A_PERSON


def _has_thermometer(found: Probe | str) -> bool:
    return not isinstance(found, str) and bool(np.isfinite(found.temperature))


def _say_around(site: Site) -> bool:
    """Print the requirements of a run other than devices; return whether all are met."""
    well = True
    for found in look_around(site):
        (echo if found.well else warn)(f"{found.what + ':':<13}{found.text}")
        well &= found.well
    return well


def _say_plan(site: Site) -> None:
    settings, analysis = site.settings, site.settings.analysis
    folder = site.folder / settings.recorder.folder
    free = shutil.disk_usage(next(p for p in (folder, *folder.absolute().parents) if p.exists())).free
    structure = (
        "none: changed modes are stated, without a cause"
        if settings.structure is None
        else str(site.folder / settings.structure)
    )
    echo(f"structure: {structure}")
    echo(f"channels:  {len(settings.channels)}, on {len(settings.device)} devices")
    console.print(f"windows:   {analysis.window_seconds:g} s, one every {settings.step_seconds:g} s")
    console.print(f"baseline:  {_baseline_text(settings)}")
    alarm = settings.alarm
    acknowledged = ", once acknowledged" if alarm.latched else ""
    console.print(
        f"alarm:     {alarm.false_alarms_per_year:g} false alarm{'s' * (alarm.false_alarms_per_year != 1)} per year, "
        f"after {counted(alarm.hold_windows, 'window')} over the limit; "
        f"it ends after {counted(alarm.clear_windows, 'calm window')}{acknowledged}"
    )
    echo(f"log:       {folder}, {free / 1e9:.1f} GB free")
    console.print(f"disk:      {disk_plan(settings, free)}")


def _table(site: Site, found: dict[str, Probe | str]) -> Table:
    table = new_table(
        ("device", "who"), ("Hz", "lost", "°C", "mean", "rms"), overflow="fold", title="mean and rms per axis [m/s²]"
    )
    for device in site.settings.device:
        what = found[device.name]
        if isinstance(what, str):
            table.add_row(escape(device.name), "[red]no answer[/]")
            continue
        who = " ".join(value for value in what.identity.payload().values() if isinstance(value, str))
        temperature = f"{what.temperature:.1f}" if np.isfinite(what.temperature) else "-"
        axes = [AXES.index(axis) for axis in device.channels]
        mean, rms = ("\n".join(f"{values[axis]:.3g}" for axis in axes) for values in (what.mean, what.rms))
        table.add_row(escape(device.name), escape(who), f"{what.rate:.0f}", str(what.lost), temperature, mean, rms)
    return table


def _problems(device: DeviceSettings, found: Probe | str) -> list[str]:
    """Return problems of a device that answers."""
    if isinstance(found, str):
        return []
    problems = []
    if not found.rate_is(device.rate):
        problems.append(f"device {device.name}: expected {device.rate:g} scans per second, found {found.rate:.0f}")
    if found.lost or found.bad_bytes:
        problems.append(f"device {device.name}: {found.lost} scans lost, {found.bad_bytes} damaged bytes in a second")
    still = [name for axis, name in device.channels.items() if found.rms[AXES.index(axis)] == 0]
    problems += [f"device {device.name}: channel {name} is constant" for name in still]
    return problems


def _baseline_text(settings: Settings) -> str:
    """Return how many windows are learned from, and for how long."""
    analysis, hours = settings.analysis, settings.learning_seconds / 3600
    text = f"{analysis.first_windows} windows, {hours:.2g} h"
    if analysis.most_windows > analysis.first_windows:
        most = hours + (analysis.most_windows - analysis.first_windows) * settings.step_seconds / 3600
        return (
            f"{text}; extended automatically up to {analysis.most_windows}, {most:.2g} h, if the baseline is too short"
        )
    return text if hours >= _DAY_HOURS else f"{text}, less than a day's cycle"
