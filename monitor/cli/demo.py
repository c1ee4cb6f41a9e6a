"""`demo`: a rig nobody knows, watched as any site is, and the truth beside the answer."""

import json
import secrets
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from monitor.cli.watch import line
from monitor.daemon import RunReport, load_site, run, stop_on_signals
from monitor.errors import StartError
from monitor.results import AlarmResult, MassAnswer, ReferenceResult, WindowResult
from monitor.rig import T_DEVICES, Scenario, draw_t_frame, dump_scenario
from monitor.worker import Result
from updater import t_structure_toml

_READY_SECONDS = 30.0
_END_SECONDS = 20.0
_RIGHT_PLACE, _RIGHT_MASS = 0.10, 0.15  # m, share: what the demo calls found


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Lengths of one demo [s of data]."""

    window: float
    baseline_windows: int
    windows: int
    between: tuple[float, float]  #: when the rig may add the body

    @property
    def duration(self) -> float:
        """Longer than what is watched, so that the monitor ends it, not the rig."""
        return (self.windows + 3) * self.window


FULL = Plan(window=40.0, baseline_windows=12, windows=27, between=(530.0, 640.0))
SHORT = Plan(window=30.0, baseline_windows=8, windows=15, between=(255.0, 290.0))


def demo_command(out: Path, seed: int | None, *, speed: float, short: bool) -> int:
    """Run the demo; 0 if the body was found rightly, 1 if not."""
    console = Console(highlight=False)
    seed = secrets.randbelow(10_000) if seed is None else seed
    plan = SHORT if short else FULL
    console.print(
        f"[bold]modalwatch demo[/], seed {seed}: a virtual T-frame plays {plan.windows * plan.window / speed:.0f} s"
    )
    console.print(
        "Six emulated Epson M-A352 on six ptys. Sometime, somewhere, the rig will add a body; nobody tells the"
    )
    console.print("monitor when, where or how heavy.\n")
    _clear(out)
    scenario = draw_t_frame("t_structure.toml", seed, duration=plan.duration, between=plan.between)
    (out / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    (out / "scenario.toml").write_text(dump_scenario(scenario), encoding="utf-8")
    with stop_on_signals() as stop, RigProcess(out, speed) as rig:
        (out / "site.toml").write_text(_site(rig.wait_until_ready(stop), plan), encoding="utf-8")
        display = Display(console, plan, stop)
        with display:
            report = run(load_site(out / "site.toml"), stop, display.show)
        done = rig.finish()
    if display.n_windows < plan.windows:
        console.print(f"\nstopped after {display.n_windows} windows; the log is whole: {report.log}", soft_wrap=True)
        return 130
    return _reveal(console, out, scenario, display.found, report, done)


def _clear(out: Path) -> None:
    """Make room for this demo where an earlier one was; touch nothing else."""
    out.mkdir(parents=True, exist_ok=True)
    if (out / "scenario.toml").exists():
        shutil.rmtree(out / "log", ignore_errors=True)
    for name in ("ports.json", "rig.json", "answer.json", "overview.rrd"):
        (out / name).unlink(missing_ok=True)


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
            if self._process.poll() is not None or time.monotonic() > end or stop.is_set():
                self._process.kill()
                raise StartError(f"the virtual rig did not start: {self._said() or 'no answer'}")
            time.sleep(0.05)
        found: dict[str, Any] = json.loads(self._ports.read_text(encoding="utf-8"))
        return found

    def finish(self) -> dict[str, Any]:
        """Ask the rig to end and return its report."""
        self._process.terminate()
        try:
            self._process.wait(_END_SECONDS)
        except subprocess.TimeoutExpired as error:
            raise StartError("the virtual rig did not end") from error
        if not self._report.exists():
            raise StartError(f"the virtual rig failed: {self._said()}")
        found: dict[str, Any] = json.loads(self._report.read_text(encoding="utf-8"))
        return found

    def _said(self) -> str:
        return self._process.stderr.read().decode().strip() if self._process.stderr else ""


def _site(ready: dict[str, Any], plan: Plan) -> str:
    """Return the SITE.toml of this demo: what a user would write, and the rig's time scale."""
    lines = [
        'structure = "t_structure.toml"',
        "",
        "[analysis]",
        f"window_seconds = {plan.window}",
        f"baseline_windows = {plan.baseline_windows}",
        "",
        "[clock]",
        *(f"{key} = {value}" for key, value in ready["clock"].items()),
    ]
    for name, (_, axes) in T_DEVICES.items():
        mapped = ", ".join(f'{axis} = "{name}_{axis}"' for axis in axes)
        lines += ["", "[[device]]", f'name = "{name}"', 'driver = "epson-uart"', f'port = "{ready["ports"][name]}"']
        lines += [f"channels = {{{mapped}}}"]
    return "\n".join(lines) + "\n"


class Display:
    """What the terminal shows while the monitor watches."""

    def __init__(self, console: Console, plan: Plan, stop: threading.Event) -> None:
        self._plan, self._stop, self._console = plan, stop, console
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("window {task.completed} of {task.total}"),
            TimeElapsedColumn(),
        )
        self._task = self._bar.add_task("learning ", total=plan.windows)
        self._live = Live(self._bar, console=console, refresh_per_second=4)
        self.found: list[Result] = []
        self.n_windows = 0

    def __enter__(self) -> None:
        self._live.start()

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def show(self, result: Result) -> None:
        """Take one result; ends the watch after the last planned window."""
        self.found.append(result)
        if isinstance(result, AlarmResult | ReferenceResult):
            style = "bold red" if isinstance(result, AlarmResult) and result.state == "alarm" else "cyan"
            self._console.print(f"[{style}]{escape(line(result))}[/]")
            return
        self.n_windows = result.index + 1
        self._bar.update(self._task, completed=self.n_windows, description=result.phase.ljust(9))
        latest = Table.grid(padding=(0, 2))
        for mode in result.modes:
            shift = f"{mode.shift_percent:+.2f} %" if mode.shift_percent is not None else ""
            latest.add_row(
                f"mode {mode.id}",
                f"{mode.frequency:8.3f} ± {mode.frequency_std:.3f} Hz",
                f"{100 * mode.damping:.2f} %",
                shift,
            )
        self._live.update(Group(latest, self._bar))
        if result.answer:
            self._console.print(escape(line(result)))
        if self.n_windows >= self._plan.windows:
            self._stop.set()


def _reveal(
    console: Console, out: Path, scenario: Scenario, found: list[Result], report: RunReport, rig: dict[str, Any]
) -> int:
    """Lay the truth beside the answer, write the files and say what to look at next."""
    windows = [r for r in found if isinstance(r, WindowResult)]
    answers = [w.answer for w in windows if w.answer]
    alarms = [r for r in found if isinstance(r, AlarmResult) and r.state == "alarm"]
    event = scenario.event[0]
    false_alarm = bool(alarms) and alarms[0].time < rig["events"][0]
    answer = answers[-1] if answers else None
    centre = _centre(scenario)
    distance = float(np.linalg.norm(np.subtract(answer.position, centre))) if answer else None
    error = answer.mass / event.body.mass - 1 if answer else None
    right = (
        distance is not None
        and error is not None
        and distance <= _RIGHT_PLACE
        and abs(error) <= _RIGHT_MASS
        and not false_alarm
    )
    summary = {
        "seed": scenario.seed,
        "truth": {"position": centre, "mass": event.body.mass, "time": rig["events"][0]},
        "answer": answer.model_dump(mode="json", exclude={"profile"}) if answer else None,
        "distance": distance,
        "mass_error": error,
        "false_alarm": false_alarm,
        "alarm_after_seconds": (alarms[0].time - rig["events"][0]) * 1e-9 if alarms else None,
        "right": right,
        "dropped": rig["dropped"] + report.dropped,
        "sent": rig["sent"],
    }
    (out / "answer.json").write_text(json.dumps(summary, indent=1), encoding="utf-8")
    console.print(_table(summary, answer))
    verdict = "[bold green]found[/]" if right else "[bold red]MISSED[/]" if answer is None else "[bold red]WRONG[/]"
    console.print(f"{verdict}; scans dropped between rig and log: {summary['dropped']} of {rig['sent']}\n")
    _write_viewer_file(out, found, report)
    _say_next(console, out, report)
    return 0 if right else 1


def _centre(scenario: Scenario) -> tuple[float, float, float]:
    """Return where the body's centre of mass is along the member: its offset beside the axis is not asked for."""
    body = scenario.event[0].body
    x, y, z = body.at
    return (x, y, z)


def _table(summary: dict[str, Any], answer: MassAnswer | None) -> Table:
    table = Table("", "truth", "the monitor's answer", "off by", title="What the rig did, and what the monitor said")
    truth = summary["truth"]
    if answer is None:
        table.add_row("body added", f"{1000 * truth['mass']:.0f} g", "nothing said", "")
        return table
    place = ", ".join(f"{v:.3f}" for v in truth["position"])
    said = ", ".join(f"{v:.3f}" for v in answer.position)
    table.add_row(
        "where [m]",
        place,
        f"{said} ± {answer.position_std:.3f} ({answer.member})",
        f"{1000 * summary['distance']:.0f} mm",
    )
    table.add_row(
        "how much [g]",
        f"{1000 * truth['mass']:.0f}",
        f"{1000 * answer.mass:.0f} ± {1000 * answer.mass_std:.0f}",
        f"{100 * summary['mass_error']:+.1f} %",
    )
    table.add_row("alarm", "", f"{summary['alarm_after_seconds']:.0f} s after it happened", "")
    return table


def _write_viewer_file(out: Path, found: list[Result], report: RunReport) -> None:
    from monitor.viewer import write_recording

    write_recording(
        out / "overview.rrd",
        reference=next((r for r in found if isinstance(r, ReferenceResult)), None),
        windows=[r for r in found if isinstance(r, WindowResult)],
        alarms=[r for r in found if isinstance(r, AlarmResult)],
        name="T-frame",
    )


def _say_next(console: Console, out: Path, report: RunReport) -> None:
    console.print("Look at it:      ", f".venv/bin/rerun {out}/overview.rrd", soft_wrap=True)
    console.print(
        "Run it again:    ",
        f".venv/bin/modalwatch replay {report.log}",
        "   (the same modes and alarm, to the last digit)",
        soft_wrap=True,
    )
    console.print("The whole answer:", f"{out}/answer.json", soft_wrap=True)
