"""Comparison of the answer with the truth."""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from shutil import which
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from daq.notebook import number_text
from monitor.analysis.selection import Selection
from monitor.analysis.time_range import Moment, TimeRange
from monitor.cli.data.diagnose.arguments import Logs
from monitor.cli.data.diagnose.diagnosis import diagnose_logs
from monitor.cli.demo.course_score import score_course
from monitor.cli.demo.scenario_score import ScoredEvent, scenario_summary, scenario_table, score_events
from monitor.cli.options import DONE, NEEDS_A_PERSON
from monitor.results.comparison import DiagnosisAnswer
from monitor.results.windows import AlarmResult, MassAnswer, Result, WindowResult
from monitor.rig import Scenario
from monitor.service.daemon import RunReport
from monitor.text.causes import change_text
from monitor.text.quantities import utc
from updater import Body, load_structure

_RIGHT_PLACE, _RIGHT_MASS = 0.10, 0.15  # m, share: tolerances of a correct answer ..
_SIGMAS = 2.0  # .. or so many of its own deviations: short windows determine a mass to some 12 %


@dataclass(frozen=True, eq=False, kw_only=True)
class Played:
    """A demo that is over."""

    out: Path  #: folder of the results
    scenario: Scenario
    found: list[Result]
    report: RunReport
    rig: dict[str, Any]  #: report of the rig
    window: float  #: length of a window [s]

    @property
    def alarm(self) -> dict[str, Any]:
        """False alarm before the first event, and time from that event to the first alarm."""
        return _alarm(self.found, self.rig)


@dataclass(frozen=True)
class Comparison:
    """An answer compared with the truth."""

    summary: dict[str, Any]
    table: Table
    right: bool
    missing: bool = False  #: whether there is no answer


def reveal(console: Console, played: Played) -> int:
    """Compare the answer that the scenario names with the truth, write the files and print the next steps."""
    compared, alarm = _COMPARISONS[played.scenario.answer](played), played.alarm
    right = compared.right and not alarm["false_alarm"]
    summary = {"seed": played.scenario.seed, **compared.summary, **alarm, **_scans(played.report, played.rig)}
    summary["right"] = right
    (played.out / "answer.json").write_text(json.dumps(summary, indent=1), encoding="utf-8")
    console.print(compared.table)
    wrong = "[bold red]MISSED[/]" if compared.missing else "[bold red]WRONG[/]"
    verdict = "[bold green]found[/]" if right else wrong
    console.print(f"{verdict}; scans dropped between rig and log: {summary['dropped']} of {summary['sent']}\n")
    _write_pictures(played.out, played.report)
    _say_next(console, played.out, played.report)
    return DONE if right else NEEDS_A_PERSON


def _compare_mass(played: Played) -> Comparison:
    """Compare the last mass of the monitor with the body of the only event."""
    windows = [r for r in played.found if isinstance(r, WindowResult)]
    answers = [w.answer for w in windows if w.answer]
    body = played.scenario.event[0].body
    assert body
    answer = answers[-1] if answers else None
    distance = float(np.linalg.norm(np.subtract(answer.position, body.at))) if answer else None
    summary = {
        "truth": {"position": body.at, "mass": body.mass, "time": played.rig["events"][0]},
        "answer": answer.model_dump(mode="json", exclude={"profile"}) if answer else None,
        "distance": distance,
        "mass_error": answer.mass / body.mass - 1 if answer else None,
    }
    texts = [change_text(w.diagnosis) for w in windows if w.diagnosis]
    table = _table(summary | played.alarm, answer, texts[-1] if texts else "no answer")
    return Comparison(summary, table, answer is not None and _is_right(answer, body), missing=answer is None)


def _compare_causes(played: Played) -> Comparison:
    """Compare the last diagnosis of the monitor with all events."""
    structure = load_structure(played.out / played.scenario.structure)
    return _scored(score_events(structure, played.scenario.event, played.found))


def _compare_course(played: Played) -> Comparison:
    """Compare the change within the record, from the start of the only event to its end, with that event."""
    (event,), (start,) = played.scenario.event, played.rig["events"]
    end = start + round(event.over * 1e9)
    log, out = played.report.log, played.out / "diagnosis"
    out.mkdir(exist_ok=True)
    diagnose_logs(
        played.out / played.scenario.structure,
        Logs(
            current=[log],
            within=TimeRange(start=_moment(start), stop=_moment(end)),
            reference=[log],
            reference_within=TimeRange(stop=_moment(start)),
        ),
        Selection(),
        window=played.window,
        out=out,
        json_path=None,
    )
    answer = DiagnosisAnswer.model_validate_json((out / "diagnosis.json").read_text(encoding="utf-8"))
    return _scored([score_course(event, answer.within_record)])


def _moment(time: int) -> Moment:
    return Moment(text=utc(time), time=time, absolute=True)


def _scored(scored: list[ScoredEvent]) -> Comparison:
    right = all(event.right for event in scored)
    return Comparison({"events": scenario_summary(scored)}, scenario_table(scored), right)


_COMPARISONS: dict[str, Callable[[Played], Comparison]] = {
    "mass": _compare_mass,
    "causes": _compare_causes,
    "course": _compare_course,
}


def _alarm(found: list[Result], rig: dict[str, Any]) -> dict[str, Any]:
    """Return whether an alarm was raised before the first event, and how long after it the first one was."""
    raised = next((r.time for r in found if isinstance(r, AlarmResult) and r.state == "alarm"), None)
    first = rig["events"][0] if rig["events"] else None
    false_alarm = raised is not None and (first is None or raised < first)
    after = (raised - first) * 1e-9 if raised is not None and first is not None else None
    return {"false_alarm": false_alarm, "alarm_after_seconds": after}


def _scans(report: RunReport, rig: dict[str, Any]) -> dict[str, Any]:
    return {"dropped": rig["dropped"] + report.dropped, "sent": rig["sent"]}


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
    console.print("Viewer:              ", f"{program_path('rerun')} {quote(f'{out}/overview.rrd')}", soft_wrap=True)
    console.print("Repeat the analysis, with the same modes and alarm:", soft_wrap=True)
    console.print(
        "                     ", f"{program_path('modalwatch')} replay {quote(str(report.log))}", soft_wrap=True
    )
    console.print("All results:         ", f"{out}/answer.json", soft_wrap=True)


def program_path(name: str) -> str:
    """Return a program of this environment as it can be called here: by its name alone, if that finds it."""
    path = Path(sys.executable).parent / name
    if which(name) == str(path) or not path.is_file():
        return name
    near = path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
    return quote(f"./{near}" if near == Path(name) else str(near))
