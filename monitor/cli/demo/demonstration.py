"""A virtual rig, in a process of its own, and its monitor on the terminal; the answer is compared with the truth."""

import json
import math
import secrets
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console, Group
from rich.live import Live
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

from daq.notebook import rounded_text
from daq.signals import STOP_SIGNALS, signal_event
from daq.timing import SharedTime
from monitor.cli.demo.rig_site import rig_site
from monitor.cli.demo.score import Played, reveal
from monitor.cli.options import INTERRUPTED
from monitor.cli.site.console_log import line
from monitor.cli.site.monitoring import tell_live
from monitor.cli.terminal import SPEED_SECONDS, TimeColumn, console
from monitor.errors import ArgumentError, StartError
from monitor.results.windows import AlarmResult, Result, WindowResult
from monitor.rig import Scenario, draw_t_frame, dump_scenario, load_scenario, shipped_scenarios
from monitor.service.daemon import run
from monitor.service.servers.live_view import live_view
from monitor.service.site import load_site
from monitor.text.quantities import aligned_numbers
from updater import parse_structure, t_structure_toml

FOLDER_FILES = (
    *("scenario.toml", "t_structure.toml", "site.toml", "ports.json", "rig.json"),
    *("answer.json", "overview.rrd", "report.html"),
)  #: that a demo writes
_READY_SECONDS = 30.0
_END_SECONDS = 20.0


class Display:
    """Terminal display while the monitor runs."""

    def __init__(self, console: Console, n_windows: int, stop: threading.Event) -> None:
        self._planned, self._stop, self._console = n_windows, stop, console
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=20),
            TextColumn("window {task.completed} of {task.total}"),
            TimeColumn(),
            speed_estimate_period=SPEED_SECONDS,
        )
        self._task = self._bar.add_task("learning ", total=n_windows)
        self._live = Live(self._bar, console=console, refresh_per_second=4)
        self.found: list[Result] = []
        self.n_windows = 0

    def __enter__(self) -> None:
        self._live.start()

    def __exit__(self, *_: object) -> None:
        self._live.stop()
        if not self._console.is_terminal:
            self._console.line()  # on a terminal it ends its last line itself

    def show(self, result: Result) -> None:
        """Take one result; ends the watch after the last planned window."""
        self.found.append(result)
        if not isinstance(result, WindowResult):
            style = "bold red" if isinstance(result, AlarmResult) and result.state == "alarm" else "cyan"
            self._console.print(f"[{style}]{escape(line(result))}[/]")
            return
        self.n_windows = result.index + 1
        total = max(self._planned, self.n_windows)  # one may be in progress at the end
        self._bar.update(self._task, completed=self.n_windows, total=total, description=result.phase.ljust(9))
        latest = Table.grid(padding=(0, 2))
        frequencies = aligned_numbers((mode.frequency, mode.frequency_std) for mode in result.modes)
        for mode, frequency in zip(result.modes, frequencies, strict=True):
            shift = mode.shift_percent
            latest.add_row(
                f"mode {mode.id}",
                f"{frequency} Hz",
                f"{rounded_text(100 * mode.damping, 100 * mode.damping_std)} %",
                "" if shift is None else f"{rounded_text(shift, mode.shift_std_percent or 0.0, sign=True)} %",
            )
        self._live.update(Group(latest, self._bar))
        if result.answer:
            self._console.print(escape(line(result)))
        if self.n_windows >= self._planned:
            self._stop.set()


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


def demonstrate(out: Path, seed: int | None, *, speed: float, plan: Plan, name: str | None = None) -> int:
    """Run the demo; 0 if the events were found rightly, 1 if not, 130 if it was stopped.

    Parameters
    ----------
    out : folder for the results
    seed : of the rig; None: random, or that of the scenario
    speed : seconds of data per second
    plan : windows and times
    name : of a shipped scenario; None: a body is added to a drawn T-frame

    Raises
    ------
    ArgumentError
        If there is no such scenario.
    """
    scenario, plan, hidden = _drawn(seed, plan) if name is None else _shipped(name, seed, plan)
    minutes, limit = plan.windows * plan.window / 60, "at most " if speed > 1 else ""
    console.print(
        f"[bold]modalwatch demo[/], seed {scenario.seed}: {minutes:.0f} minutes of a virtual T-frame, "
        f"{limit}{speed:g}x speed"
    )
    console.print(f"Six emulated Epson accelerometers: four serial, two CAN. {hidden}\n")
    _clear(out)
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
        console.print(f"\nstopped after {display.n_windows} windows; the log is complete: {report.log}", soft_wrap=True)
        return INTERRUPTED
    played = Played(out=out, scenario=scenario, found=display.found, report=report, rig=done, window=plan.window)
    return reveal(console, played)


def _drawn(seed: int | None, plan: Plan) -> tuple[Scenario, Plan, str]:
    """Return a drawn scenario, its plan, and a sentence about it."""
    seed = secrets.randbelow(10_000) if seed is None else seed
    scenario = draw_t_frame("t_structure.toml", seed, duration=plan.duration, between=plan.between, rate=plan.rate)
    hidden = (
        "At a random time and position, the rig will add a body;\n"
        "the monitor has no information on time, place or mass."
    )
    return scenario, plan, hidden


def _shipped(name: str, seed: int | None, plan: Plan) -> tuple[Scenario, Plan, str]:
    """Return a shipped scenario, its plan, and a sentence about it; an ArgumentError if there is no such scenario."""
    shipped = shipped_scenarios()
    if name not in shipped:
        raise ArgumentError("--scenario", f"expected one of {', '.join(shipped)}, found {name!r}")
    hidden = f"The rig plays the scenario {name};\nthe monitor has no information on it."
    return *_planned(load_scenario(shipped[name]), seed, plan), hidden


def _planned(scenario: Scenario, seed: int | None, plan: Plan) -> tuple[Scenario, Plan]:
    """Return a shipped scenario and the plan with it: its first event in the middle of the plan's range of times.

    The time between events is that of the scenario, in windows; the record is longer by the windows until their end.
    """
    scale = plan.window / FULL.window
    at = [scale * event.at for event in scenario.event] or [0.0]
    ends = [scale * (event.at + event.over) for event in scenario.event] or [0.0]
    shift = sum(plan.between) / 2 - at[0]
    more = math.ceil((max(ends) - at[0]) / plan.window)
    plan = replace(plan, windows=plan.windows + more)
    moved = {
        "structure": "t_structure.toml",
        "seed": scenario.seed if seed is None else seed,
        "rate": plan.rate,
        "duration": plan.duration,
        "event": tuple(
            event.model_copy(update={"at": scale * event.at + shift, "over": scale * event.over})
            for event in scenario.event
        ),
    }
    return scenario.model_copy(update=moved), plan


def _clear(out: Path) -> None:
    """Make room for this demo where an earlier one was; touch nothing else."""
    out.mkdir(parents=True, exist_ok=True)
    if (out / "scenario.toml").exists():
        for folder in ("log", "state", "diagnosis"):
            shutil.rmtree(out / folder, ignore_errors=True)
    for name in FOLDER_FILES:
        (out / name).unlink(missing_ok=True)


def _site(ready: dict[str, Any], scenario: Scenario, plan: Plan) -> str:
    structure = parse_structure(t_structure_toml())
    return rig_site(
        "t_structure.toml", structure, scenario, ready, window=plan.window, baseline_windows=plan.baseline_windows
    )


class RigProcess:
    """The virtual rig, in a process of its own that Ctrl-C does not reach."""

    def __init__(self, folder: Path, speed: float) -> None:
        self._ports, self._report = folder / "ports.json", folder / "rig.json"
        self._command = [sys.executable, "-c", "from monitor.cli.main import main; main()", "rig"]
        self._command += [str(folder / "scenario.toml"), "--speed", str(speed)]
        self._command += ["--ports", str(self._ports), "--report", str(self._report)]

    def __enter__(self) -> "RigProcess":
        quiet = subprocess.DEVNULL
        self._process = subprocess.Popen(
            self._command, stdin=quiet, stdout=quiet, stderr=subprocess.PIPE, start_new_session=True
        )
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self._process.kill()
        self._process.communicate()

    def wait_until_ready(self, stop: threading.Event) -> dict[str, Any]:
        """Return {"clock": .., "ports": ..}."""
        end = time.monotonic() + _READY_SECONDS
        while not self._ports.exists():
            if stop.is_set():
                raise KeyboardInterrupt
            if self._process.poll() is not None or time.monotonic() > end:
                self._process.kill()
                raise StartError(f"the virtual rig did not start: {self._errors() or 'no answer'}")
            time.sleep(0.05)
        found: dict[str, Any] = json.loads(self._ports.read_text(encoding="utf-8"))
        return found

    def stop_at_its_end(self, stop: threading.Event) -> None:
        """Set `stop` when the rig ends, however that comes."""

        def watch() -> None:
            self._process.wait()
            stop.set()

        threading.Thread(target=watch, name="rig watch", daemon=True).start()

    @property
    def over(self) -> bool:
        """True once the rig has ended by itself."""
        return self._process.poll() == 0

    def finish(self) -> dict[str, Any]:
        """End the rig and return its report."""
        self._process.terminate()
        try:
            self._process.wait(_END_SECONDS)
        except subprocess.TimeoutExpired as error:
            raise StartError("the virtual rig did not end") from error
        if not self._report.exists():
            raise StartError(f"the virtual rig failed: {self._errors()}")
        found: dict[str, Any] = json.loads(self._report.read_text(encoding="utf-8"))
        return found

    def _errors(self) -> str:
        return self._process.stderr.read().decode().strip() if self._process.stderr else ""


_AHEAD = 2.0  # windows that the rig may be ahead of the analysis
_LONGEST = 60.0  # s of wall time that it waits for one result


class Pace:
    """Holds the world of a rig while the analysis is behind: no window is left out, whatever the machine.

    Parameters
    ----------
    clock : fields of the rig's clock, as it reports them
    window : length of a window [s]
    """

    def __init__(self, clock: Mapping[str, Any], window: float) -> None:
        self._most = round(_AHEAD * window * 1e9)
        self._world = SharedTime(Path(clock["shared"])) if clock["shared"] else None  # none in real time

    def keep(self, result: Result) -> None:
        """Let the world go on to some windows after a result, and hold it there until the next one."""
        if self._world is not None and isinstance(result, WindowResult):
            self._world.hold(_LONGEST, at=result.end + self._most)
