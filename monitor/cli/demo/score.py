"""Comparison of the answer with the truth."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from daq.notebook import number_text
from monitor.cli.options import DONE, NEEDS_A_PERSON
from monitor.results.windows import AlarmResult, MassAnswer, Result, WindowResult
from monitor.rig import Scenario
from monitor.service.daemon import RunReport
from monitor.text.causes import change_text
from updater import Body

_RIGHT_PLACE, _RIGHT_MASS = 0.10, 0.15  # m, share: tolerances of a correct answer ..
_SIGMAS = 2.0  # .. or so many of its own deviations: short windows determine a mass to some 12 %


def reveal(
    console: Console, out: Path, scenario: Scenario, found: list[Result], report: RunReport, rig: dict[str, Any]
) -> int:
    """Compare the answer with the truth, write the files and print the next steps."""
    windows = [r for r in found if isinstance(r, WindowResult)]
    answers = [w.answer for w in windows if w.answer]
    alarms = [r for r in found if isinstance(r, AlarmResult) and r.state == "alarm"]
    body = scenario.event[0].body
    assert body
    false_alarm = bool(alarms) and alarms[0].time < rig["events"][0]
    answer = answers[-1] if answers else None
    distance = float(np.linalg.norm(np.subtract(answer.position, body.at))) if answer else None
    error = answer.mass / body.mass - 1 if answer else None
    right = answer is not None and _is_right(answer, body) and not false_alarm
    summary = {
        "seed": scenario.seed,
        "truth": {"position": body.at, "mass": body.mass, "time": rig["events"][0]},
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
    texts = [change_text(w.diagnosis) for w in windows if w.diagnosis]
    console.print(_table(summary, answer, texts[-1] if texts else "no answer"))
    verdict = "[bold green]found[/]" if right else "[bold red]MISSED[/]" if answer is None else "[bold red]WRONG[/]"
    console.print(f"{verdict}; scans dropped between rig and log: {summary['dropped']} of {rig['sent']}\n")
    _write_pictures(out, report)
    _say_next(console, out, report)
    return DONE if right else NEEDS_A_PERSON


def _is_right(answer: MassAnswer, body: Body) -> bool:
    """Return whether an answer is within the tolerances, or within its own deviations."""
    distance = float(np.linalg.norm(np.subtract(answer.position, body.at)))
    place = max(_RIGHT_PLACE, _SIGMAS * answer.position_std)
    return distance <= place and abs(answer.mass - body.mass) <= max(_RIGHT_MASS * body.mass, _SIGMAS * answer.mass_std)


def _table(summary: dict[str, Any], answer: MassAnswer | None, found: str) -> Table:
    table = Table("", "truth", "the monitor's answer", "off by", title="Truth of the rig, and answer of the monitor")
    truth = summary["truth"]
    if answer is None:
        table.add_row("body added", f"{1000 * truth['mass']:.0f} g", found, "")
        return table
    place = ", ".join(f"{v:.3f}" for v in truth["position"])
    located = ", ".join(f"{v:.3f}" for v in answer.position)
    table.add_row(
        r"where \[m]",
        place,
        f"{located} ± {answer.position_std:.3f} ({answer.member})",
        f"{1000 * summary['distance']:.0f} mm",
    )
    table.add_row(
        r"how much \[g]",
        f"{1000 * truth['mass']:.0f}",
        number_text(1000 * answer.mass, 1000 * answer.mass_std),
        f"{100 * summary['mass_error']:+.1f} %",
    )
    table.add_row("alarm", "", f"{summary['alarm_after_seconds']:.0f} s after it happened", "")
    return table


def _write_pictures(out: Path, report: RunReport) -> None:
    """Write the report and the viewer's file, both from the log alone."""
    from monitor.views.report import run_report
    from monitor.views.run import load_run
    from monitor.views.viewer import write_recording

    run = load_run(report.log)
    run_report(run, out / "report.html")
    write_recording(out / "overview.rrd", run.results)


def _say_next(console: Console, out: Path, report: RunReport) -> None:
    console.print("Read the report: ", f"{out}/report.html", soft_wrap=True)
    console.print("Look at it:      ", f".venv/bin/rerun {out}/overview.rrd", soft_wrap=True)
    console.print(
        "Run it again:    ",
        f".venv/bin/modalwatch replay {report.log}",
        "   (the same modes and alarm, to the last digit)",
        soft_wrap=True,
    )
    console.print("The whole answer:", f"{out}/answer.json", soft_wrap=True)
