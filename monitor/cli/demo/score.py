"""Comparison of the answer with the truth."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from daq.notebook import number_text
from monitor.cli.demo.scenario_score import scenario_summary, scenario_table, score_events
from monitor.cli.options import DONE, NEEDS_A_PERSON
from monitor.results.windows import AlarmResult, MassAnswer, Result, WindowResult
from monitor.rig import Scenario
from monitor.service.daemon import RunReport
from monitor.text.causes import change_text
from updater import Body, Structure

_RIGHT_PLACE, _RIGHT_MASS = 0.10, 0.15  # m, share: tolerances of a correct answer ..
_SIGMAS = 2.0  # .. or so many of its own deviations: short windows determine a mass to some 12 %


def reveal(
    console: Console, out: Path, scenario: Scenario, found: list[Result], report: RunReport, rig: dict[str, Any]
) -> int:
    """Compare the answer with the truth, write the files and print the next steps."""
    windows = [r for r in found if isinstance(r, WindowResult)]
    answers = [w.answer for w in windows if w.answer]
    body = scenario.event[0].body
    assert body
    alarm = _alarm(found, rig)
    answer = answers[-1] if answers else None
    distance = float(np.linalg.norm(np.subtract(answer.position, body.at))) if answer else None
    error = answer.mass / body.mass - 1 if answer else None
    right = answer is not None and _is_right(answer, body) and not alarm["false_alarm"]
    summary = (
        {
            "seed": scenario.seed,
            "truth": {"position": body.at, "mass": body.mass, "time": rig["events"][0]},
            "answer": answer.model_dump(mode="json", exclude={"profile"}) if answer else None,
            "distance": distance,
            "mass_error": error,
        }
        | alarm
        | _scans(report, rig)
    )
    summary["right"] = right
    _write(out, summary)
    texts = [change_text(w.diagnosis) for w in windows if w.diagnosis]
    console.print(_table(summary, answer, texts[-1] if texts else "no answer"))
    verdict = "[bold green]found[/]" if right else "[bold red]MISSED[/]" if answer is None else "[bold red]WRONG[/]"
    return _end(console, out, report, summary, verdict)


def reveal_scenario(
    console: Console,
    out: Path,
    structure: Structure,
    scenario: Scenario,
    found: list[Result],
    report: RunReport,
    rig: dict[str, Any],
) -> int:
    """Compare the last diagnosis with all events of a shipped scenario; otherwise as `reveal`."""
    scored, alarm = score_events(structure, scenario.event, found), _alarm(found, rig)
    summary = {"seed": scenario.seed, "events": scenario_summary(scored)} | alarm | _scans(report, rig)
    summary["right"] = all(event.right for event in scored) and not alarm["false_alarm"]
    _write(out, summary)
    console.print(scenario_table(scored))
    verdict = "[bold green]found[/]" if summary["right"] else "[bold red]WRONG[/]"
    return _end(console, out, report, summary, verdict)


def _alarm(found: list[Result], rig: dict[str, Any]) -> dict[str, Any]:
    """Return whether an alarm was raised before the first event, and how long after it the first one was."""
    raised = next((r.time for r in found if isinstance(r, AlarmResult) and r.state == "alarm"), None)
    first = rig["events"][0] if rig["events"] else None
    false_alarm = raised is not None and (first is None or raised < first)
    after = (raised - first) * 1e-9 if raised is not None and first is not None else None
    return {"false_alarm": false_alarm, "alarm_after_seconds": after}


def _scans(report: RunReport, rig: dict[str, Any]) -> dict[str, Any]:
    return {"dropped": rig["dropped"] + report.dropped, "sent": rig["sent"]}


def _write(out: Path, summary: dict[str, Any]) -> None:
    (out / "answer.json").write_text(json.dumps(summary, indent=1), encoding="utf-8")


def _end(console: Console, out: Path, report: RunReport, summary: dict[str, Any], verdict: str) -> int:
    """Print the verdict, write the pictures and print the next steps; return the exit code."""
    console.print(f"{verdict}; scans dropped between rig and log: {summary['dropped']} of {summary['sent']}\n")
    _write_pictures(out, report)
    _say_next(console, out, report)
    return DONE if summary["right"] else NEEDS_A_PERSON


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
        r"position \[m]",
        place,
        f"{located} ± {answer.position_std:.3f} ({answer.member})",
        f"{1000 * summary['distance']:.0f} mm",
    )
    table.add_row(
        r"mass \[g]",
        f"{1000 * truth['mass']:.0f}",
        number_text(1000 * answer.mass, 1000 * answer.mass_std),
        f"{round(100 * summary['mass_error'], 1) + 0.0:+.1f} %",
    )
    table.add_row("alarm", "", f"{summary['alarm_after_seconds']:.0f} s after the change", "")
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
    console.print("Report:              ", f"{out}/report.html", soft_wrap=True)
    console.print("Viewer:              ", f".venv/bin/rerun {out}/overview.rrd", soft_wrap=True)
    console.print(
        "Repeat the analysis: ",
        f".venv/bin/modalwatch replay {report.log}",
        "   (the same modes and alarm, to the last digit)",
        soft_wrap=True,
    )
    console.print("All results:         ", f"{out}/answer.json", soft_wrap=True)
