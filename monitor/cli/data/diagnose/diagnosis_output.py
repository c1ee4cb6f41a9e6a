"""Output of a diagnosis in the terminal: verdict, then evidence."""

from collections.abc import Iterator
from functools import partial

from rich.console import Console, RenderableType
from rich.markup import escape

from daq.notebook import rounded_text
from monitor.cli.data.structure.parameters_output import changes_table
from monitor.cli.terminal import console, echo, new_table
from monitor.results.comparison import DiagnosisAnswer, DiscrepancyResult, ModeComparison
from monitor.results.convert import bare_reference
from monitor.text.cause_list import listed_causes
from monitor.text.causes import (
    MARK,
    NOT_COMPARED,
    alternative_texts,
    breathing_text,
    calibration_text,
    cause_text,
    failed_text,
    further_changes,
    further_changes_text,
    gain_texts,
    left_over_text,
    lost_modes_text,
    missed_text,
    other_texts,
    probability_text,
    uncertain_text,
    unmeasured_text,
)
from monitor.text.diagnosis import (
    follow_text,
    mass_test_text,
    note_texts,
    plan_rows,
    record_change_texts,
    smallest_changes_text,
    within_record_text,
)
from monitor.text.quantities import optional
from monitor.text.sensors import health_text, worst_sensor_text
from monitor.text.verdicts import has_only_fitted_parameters, verdict_text
from updater import Cause, Gain, Structure
from updater.quantities import plain
from updater.reference import Calibration
from updater.structure import place_name

_STYLE = {"explained": "bold red", "nothing_to_explain": "bold green"}
_NO_BASELINE = "none: the reference logs have no such mode in their band"
_FAR = 3.0  # standard deviations from which a frequency is off
_MAX = 6  # refused causes that are listed individually


def say_answer(console: Console, diagnosis: DiagnosisAnswer) -> None:
    """Print verdict, causes and the next step; a change within the logs first."""
    if within := diagnosis.within_record:
        console.print(f"[bold yellow]{escape(within_record_text(within))}[/]")
        for line in record_change_texts(within):
            console.print(f"  {escape(line)}")
    style = "bold green" if has_only_fitted_parameters(diagnosis) else _STYLE.get(diagnosis.verdict, "bold yellow")
    console.print(f"[{style}]{escape(verdict_text(diagnosis))}[/]")
    for cause in listed_causes(diagnosis.causes):
        for line in _cause_lines(cause, checks=diagnosis.verdict == "ambiguous", known=diagnosis.next_measurement):
            console.print(line)
    if diagnosis.next_measurement and diagnosis.verdict != "nothing_to_explain":
        console.print(f"[bold]next:[/] {escape(diagnosis.next_measurement)}")
    for text in note_texts(diagnosis):
        console.print(f"[yellow]note:[/] {escape(text)}")
    if diagnosis.follows:
        console.print(follow_text(diagnosis.follows))
    if rows := plan_rows(diagnosis.separation):
        table = new_table(("further measurement",), ("leaves open", "effort"), pad_edge=False)
        for row in rows:
            table.add_row(*map(escape, row))
        console.print(table)
    if unseen := smallest_changes_text(diagnosis.smallest_changes, unchanged=diagnosis.verdict == "nothing_to_explain"):
        console.print(escape(unseen))


def say_evidence(
    console: Console,
    diagnosis: DiagnosisAnswer,
    found: DiscrepancyResult | None,
    structure: Structure,
    windows: str = "",
) -> None:
    """Print the basis of a diagnosis: residual forces, modes, sensors, gain and refused causes.

    Parameters
    ----------
    found : comparison of measured with simulated modes; None: not known
    structure : that was diagnosed
    windows : text on the windows that frequencies are means of
    """
    if lost := lost_modes_text(found) if found else "":
        console.print(f"[yellow]note:[/] {escape(lost)}")
    if diagnosis.calibration is not None:
        console.print(calibration_text(diagnosis.calibration), markup=False)
    if found is not None:
        _compared(console, diagnosis, found, structure, windows)
    for test in diagnosis.mass_tests:
        console.print(escape(mass_test_text(test)))
    for line in _gain(diagnosis, found.gain_std if found else None):
        console.print(escape(line))
    _refused(console, diagnosis)


def _compared(
    console: Console, diagnosis: DiagnosisAnswer, found: DiscrepancyResult, structure: Structure, windows: str
) -> None:
    """Print measured modes and sensors compared with simulated ones."""
    known = diagnosis.verdict != "unexplained"
    if not known and found.balance:
        nodes = bare_reference(structure).nodes
        if where := left_over_text(found.balance, nodes, partial(place_name, structure)):
            console.print(escape(where))
    console.print(_modes(found))
    if not all(mode.compared for mode in found.listed):
        console.print(f"{MARK} {NOT_COMPARED}", style="dim", markup=False)
    for line in (unmeasured_text(found), windows and f"frequencies are {windows}"):
        if line:
            console.print(line, style="dim", markup=False)
    health = health_text({s.channel: s.health for s in found.sensors if s.health}, explained=known)
    for line in (worst_sensor_text(found.sensors), health, missed_text(found.sensors)):
        if line:
            console.print(escape(line))


def _cause_lines(cause: Cause, *, checks: bool, known: str) -> Iterator[str]:
    """Yield a cause and its alternatives, each with its own check where several are left open.

    Parameters
    ----------
    checks : whether they are wanted
    known : text printed anyway, whose checks are not repeated
    """
    others, advice = alternative_texts(cause), {other.cause: other.advice for other in (cause, *cause.alternatives)}
    probability = f" (probability {probability_text(cause)})"
    for name, text in zip((cause.cause, *cause.cannot_be_told_from), (cause_text(cause), *others), strict=True):
        first = name == cause.cause
        yield f"  {'' if first else 'or '}[bold]{escape(text)}[/]{probability if first else ''}"
        for further in (further_changes_text(further_changes(cause)), breathing_text(cause), *other_texts(cause)):
            if first and further:
                yield f"    {escape(further)}"
        check = advice.get(name, "")
        if checks and check and check not in known:
            yield f"    [dim]check:[/] {escape(check)}"


def _modes(found: DiscrepancyResult) -> RenderableType:
    """Return the table of modes; frequencies off by more than three standard deviations are highlighted.

    Modes not used for the answer are marked and dimmed.
    """
    after = any(m.off_percent_after is not None for m in found.listed)
    first = ["before Hz", "now Hz", "change %"] if found.measured_before else ["model Hz", "measured Hz", "off by %"]
    names = first + ["σ", "MAC"] + ["with\ncauses %", "MAC"] * after
    table = new_table(right=names, no_wrap=True, pad_edge=False)
    for mode in found.listed:
        mark = "" if mode.compared else f"{MARK} "
        cells = [mark + _hertz(mode, mode.simulated, "none"), _hertz(mode, mode.measured, "not found"), *_off(mode)]
        cells += [_percent(mode, mode.off_percent_after), optional(mode.mac_after, ".4f", "-")] * after
        table.add_row(*cells, style=None if mode.compared else "dim")
    if found.measured_before and any(mode.simulated is None for mode in found.listed):
        table.caption, table.caption_justify = _NO_BASELINE, "left"
    return table


def _off(mode: ModeComparison) -> list[str]:
    if mode.off_percent is None or not mode.std_percent:
        return ["-", "-", "-"]
    sigmas = mode.off_percent / mode.std_percent
    style = ("[red]", "[/]") if abs(sigmas) > _FAR and mode.compared else ("", "")
    return [_percent(mode, mode.off_percent), f"{style[0]}{sigmas:+.1f}{style[1]}", optional(mode.mac, ".4f", "-")]


def _hertz(mode: ModeComparison, value: float | None, missing: str) -> str:
    """Return a frequency with the digits of the measured one."""
    if value is None:
        return missing
    return rounded_text(value, 0.01 * (mode.std_percent or 0.0) * (mode.measured or 0.0))


def _percent(mode: ModeComparison, value: float | None) -> str:
    return "-" if value is None else rounded_text(value, mode.std_percent or 0.0, sign=True)


def _gain(diagnosis: DiagnosisAnswer, std: Gain | None) -> list[str]:
    """Return the gain of the written model with standard deviations; or that it may be chance."""
    if diagnosis.gain is None:
        none = "the causes do not improve the fit significantly on data that were not used to find them"
        return [none] if diagnosis.causes else []
    return ["frequency error of the extended model", *(f"  {text}" for text in gain_texts(diagnosis.gain, std))]


def _refused(console: Console, diagnosis: DiagnosisAnswer) -> None:
    """Print the causes that were refused, the nearest first; the hopeless ones only by name, and those that failed."""
    nearest = sorted(diagnosis.rejected, key=lambda r: -r.log_evidence)
    if nearest:
        console.print("other causes, the most probable first:", style="dim")
    for rejected in nearest[:_MAX]:
        console.print(f"  {plain(rejected.cause)}: {escape(rejected.why)}", style="dim")
    if len(nearest) > _MAX:
        console.print(f"  less probable than these: {', '.join(plain(r.cause) for r in nearest[_MAX:])}", style="dim")
    for failed in diagnosis.failed:
        console.print(escape(failed_text(failed)), style="yellow")


def say_extended(path: str, *, fitted: bool) -> None:
    """Print where the extended model is, and whether it has fitted parameters."""
    echo(f"extended model: {path}")
    if fitted:
        console.print(
            "  it also has the parameters fitted to the reference logs: stiffness of materials, feet and joints",
            style="dim",
        )


def say_parameters(calibration: Calibration) -> None:
    """Print the model parameters that were fitted to the reference logs: changed ones with values, others by name."""
    changes = calibration.changes()
    if moved := [change for change in changes if change.listed]:
        console.print(changes_table(moved, "model parameters fitted to the reference logs"))
    if uncertain := uncertain_text(moved):
        console.print(uncertain, style="dim", markup=False)
    if others := further_changes_text([change for change in changes if not change.listed]):
        spring = "; a connection that is rigid in the file is a stiff spring in the extended model"
        rigid = any(change.before is None for change in changes if not change.listed)
        console.print(f"also fitted to the reference logs, {others}{spring * rigid}", style="dim", markup=False)
