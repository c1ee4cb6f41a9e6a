"""A virtual rig and its monitor; the answer is compared with the truth."""

import secrets
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from daq.signals import STOP_SIGNALS, signal_event
from monitor.cli.demo.display import Display
from monitor.cli.demo.pace import Pace
from monitor.cli.demo.rig_process import RigProcess
from monitor.cli.demo.rig_site import rig_site
from monitor.cli.demo.score import reveal
from monitor.cli.exit_codes import INTERRUPTED
from monitor.cli.site.monitoring import tell_live
from monitor.cli.terminal import console
from monitor.results.windows import Result
from monitor.rig import Scenario, draw_t_frame, dump_scenario
from monitor.service.daemon import run
from monitor.service.servers.live_view import live_view
from monitor.service.site import load_site
from updater import parse_structure, t_structure_toml


@dataclass(frozen=True, kw_only=True)
class Plan:
    """One demo; times in seconds of data."""

    window: float
    baseline_windows: int
    windows: int
    between: tuple[float, float]  #: when the rig may add the body
    rate: float = 1000.0  #: rate of the devices [Hz]

    @property
    def duration(self) -> float:
        """Longer than the monitored time, so that the monitor ends first, also on a busy machine."""
        return 4 * self.windows * self.window


FULL = Plan(window=40.0, baseline_windows=12, windows=27, between=(530.0, 640.0))
SHORT = Plan(window=15.0, baseline_windows=8, windows=13, between=(124.0, 146.0))


def demonstrate(out: Path, seed: int | None, *, speed: float, plan: Plan) -> int:
    """Run the demo; 0 if the body was found rightly, 1 if not, 130 if it was stopped."""
    seed = secrets.randbelow(10_000) if seed is None else seed
    minutes, limit = plan.windows * plan.window / 60, "at most " if speed > 1 else ""
    console.print(
        f"[bold]modalwatch demo[/], seed {seed}: {minutes:.0f} minutes of a virtual T-frame, {limit}{speed:g}x speed"
    )
    console.print(
        "Six emulated Epson accelerometers: four serial, two CAN. Sometime, somewhere, the rig will add a body;"
    )
    console.print("the monitor has no information on time, place or mass.\n")
    _clear(out)
    scenario = draw_t_frame("t_structure.toml", seed, duration=plan.duration, between=plan.between, rate=plan.rate)
    (out / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    (out / "scenario.toml").write_text(dump_scenario(scenario), encoding="utf-8")
    with signal_event(*STOP_SIGNALS) as stop, RigProcess(out, speed) as rig:
        ready = rig.wait_until_ready(stop)
        (out / "site.toml").write_text(_site(ready, scenario, plan), encoding="utf-8")
        rig.stop_at_its_end(stop)
        display = Display(console, plan.windows, stop)
        pace = Pace(ready["clock"], plan.window)

        def show(result: Result) -> None:
            display.show(result)
            pace.keep(result)

        site = load_site(out / "site.toml")
        with live_view(site.settings, site.structure_text, site.site_text) as live, display:
            tell_live(live)
            report = run(site, stop, show, live)
        interrupted = display.n_windows < plan.windows and not rig.over  # a busy machine leaves windows out
        done = rig.finish()
    if interrupted:
        console.print(f"\nstopped after {display.n_windows} windows; the log is whole: {report.log}", soft_wrap=True)
        return INTERRUPTED
    return reveal(console, out, scenario, display.found, report, done)


def _clear(out: Path) -> None:
    """Make room for this demo where an earlier one was; touch nothing else."""
    out.mkdir(parents=True, exist_ok=True)
    if (out / "scenario.toml").exists():
        shutil.rmtree(out / "log", ignore_errors=True)
        shutil.rmtree(out / "state", ignore_errors=True)
    for name in ("ports.json", "rig.json", "answer.json", "overview.rrd", "report.html"):
        (out / name).unlink(missing_ok=True)


def _site(ready: dict[str, Any], scenario: Scenario, plan: Plan) -> str:
    structure = parse_structure(t_structure_toml())
    return rig_site(
        "t_structure.toml", structure, scenario, ready, window=plan.window, baseline_windows=plan.baseline_windows
    )
