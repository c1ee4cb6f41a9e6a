"""Changes since the reference logs, or errors of the structure file."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from daq import LogError
from daq.log import as_logs
from monitor.analysis.excluded_channels import left_out_texts
from monitor.analysis.explanation import Explanation, MassRecord, explain
from monitor.analysis.logs import log_channels
from monitor.analysis.modal_table.table import is_table
from monitor.analysis.observation import Observation, given_up
from monitor.analysis.selection import Selection
from monitor.analysis.states.record_course import explain_record
from monitor.analysis.states.stationarity import step_text
from monitor.analysis.time_range import WHOLE, TimeRange
from monitor.analysis.trends import trends_beside
from monitor.cli.data.diagnose.arguments import Logs, names_of, selected_structure
from monitor.cli.data.diagnose.basis import calibration_facts, log_facts
from monitor.cli.data.diagnose.diagnosis_output import say_answer, say_evidence, say_extended, say_parameters
from monitor.cli.data.diagnose.follow_up import earlier_diagnosis, follow_up, measured_since
from monitor.cli.data.diagnose.written_files import (
    WRITTEN,
    calibrated_again,
    draw,
    write_answer,
    write_nearer,
    written,
)
from monitor.cli.data.log_observation import check_structure_first, observe_logs
from monitor.cli.options import DONE, NEEDS_A_PERSON
from monitor.cli.terminal import Work, console, echo, progress, warn
from monitor.errors import ArgumentError, StateError
from monitor.optional import run_optional
from monitor.results.comparison import DiagnosisAnswer, DiscrepancyResult
from monitor.results.correlation import discrepancy_result
from monitor.results.state_comparison import StateComparison, compare_states
from monitor.text.diagnosis import written_bodies_texts
from monitor.text.sensors import health_result
from monitor.views.report import load_typst
from updater import DiagnosisResult, Structure
from updater.modal_data import Effort
from updater.quantities import plain


@dataclass(frozen=True)
class Observations:
    """Modes measured in the logs of each state."""

    current: Observation
    reference: Observation | None
    heldout: Observation | None
    with_mass: Sequence[MassRecord]

    def of_logs(self, logs: Logs) -> Iterator[tuple[Sequence[Path], Observation]]:
        """Return each observation with its logs."""
        states = ((logs.current, self.current), (logs.reference, self.reference), (logs.heldout, self.heldout))
        yield from ((paths, seen) for paths, seen in states if seen)
        yield from (([known.path], one.observation) for known, one in zip(logs.mass, self.with_mass, strict=True))


def diagnose_logs(
    structure_path: Path,
    logs: Logs,
    selection: Selection,
    *,
    window: float | None,
    out: Path | None,
    json_path: Path | None,
    pdf: Path | None = None,
    effort: Effort | None = None,
    follows: Path | None = None,
) -> int:
    """Diagnose; 0 if it is clear, 1 if a person must decide."""
    logs.check_window()
    check_structure_first(structure_path, logs.current)
    structure = selected_structure(structure_path, selection)
    logs.check(structure)
    earlier = earlier_diagnosis(follows)
    if pdf:
        _check_typst()
    with progress("reading") as work:
        seen = _observed(structure, logs, selection, window, work)
        work.stage("fitting the model")
        found = _explained(structure, logs, seen, selection, effort, work)
    if earlier:
        since = measured_since(seen.reference, seen.current, len(seen.with_mass))
        follow = follow_up(earlier, found.diagnosis, since)
        found = replace(found, diagnosis=found.diagnosis.model_copy(update={"follows": follow}))
    diagnosis = write_answer(found, structure_path, logs, out, json_path)
    nearer = write_nearer(found.explained, structure_path, logs, out)
    _warn_of_data(diagnosis, logs, seen)
    say_answer(console, diagnosis)
    with progress("comparing measured with simulated"):
        compared = run_optional("the comparison of measured with simulated modes", lambda: _compared(found, seen))
    windows = _windows_text(logs, seen)
    say_evidence(console, diagnosis, compared, found.reference.structure, windows)
    _say_model(found, diagnosis, structure)
    if nearer:
        echo(nearer)
    if diagnosis.causes and (hint := _held_out_hint(logs)):
        console.print(hint, style="dim", markup=False)
    for note in _notes(structure, structure_path, logs, seen):
        warn(f"note: {note}")
    if out or pdf:
        with progress("drawing"):
            states = run_optional("the comparison of both states", lambda: _states(found, seen))
            facts = run_optional("the list of the logs", lambda: _facts(found, structure_path, logs, windows)) or []
            draw(out, diagnosis, compared, found.reference.structure, states, pdf, facts)
        paths = [*(written(out, diagnosis) if out else ()), *([pdf] if pdf and pdf.exists() else ())]
        echo("written: " + ", ".join(map(str, paths)))
    return DONE if diagnosis.verdict in {"explained", "nothing_to_explain"} else NEEDS_A_PERSON


def _check_typst() -> None:
    """Refuse a PDF that cannot be made."""
    try:
        load_typst()
    except ImportError as error:
        raise ArgumentError("--pdf", str(error)) from error


def _observed(structure: Structure, logs: Logs, selection: Selection, window: float | None, work: Work) -> Observations:
    """Return the modes of the logs of each state; bands begin no higher than the lowest mode before."""
    lowest = math.inf  # frequency of the lowest mode measured so far [Hz]

    def observed(paths: Sequence[Path], what: str, within: TimeRange = WHOLE) -> Observation:
        nonlocal lowest
        exponential = logs.exponential_window
        found = observe_logs(structure, paths, window, what, work, selection, within, exponential, lowest)
        found = selection.of_observation(found)
        lowest = min(lowest, found.lowest_frequency)
        return found

    before = observed(logs.reference, "reference", logs.reference_within) if logs.reference else None
    after = observed(logs.current, "logs", logs.within)
    heldout = observed(logs.heldout, "held-out logs", logs.heldout_within) if logs.heldout else None
    with_mass = [
        MassRecord(
            mass=known.mass,
            position=known.position,
            observation=observed([known.path], f"log with {known.mass:g} kg"),
        )
        for known in logs.mass
    ]
    return Observations(after, before, heldout, with_mass)


def _explained(
    structure: Structure, logs: Logs, seen: Observations, selection: Selection, effort: Effort | None, work: Work
) -> Explanation:
    """Return the explanation of what was measured.

    Raises
    ------
    LogError
        Naming the logs in which too little was measured.
    """
    explained = partial(
        explain,
        on_cause=partial(_show_fit, work),
        only=selection.only,
        without=selection.without,
        with_mass=seen.with_mass,
        effort=effort,
    )
    try:
        return explain_record(explained, structure, seen.reference, seen.current, seen.heldout)
    except StateError as error:
        raise LogError(", ".join(map(str, logs.of_state(error.state))), str(error)) from error


def _warn_of_data(diagnosis: DiagnosisAnswer, logs: Logs, seen: Observations) -> None:
    """Print channels that are left out, and steps within the reference logs."""
    for paths, one in seen.of_logs(logs):
        for text in left_out_texts({channel: str(fault) for channel, fault in given_up(one).items()}):
            warn(f"warning: {names_of(paths)}: {text}")
    for step in diagnosis.reference_steps:
        warn(f"note: {names_of(logs.reference)}: {step_text(step)}")


def _say_model(found: Explanation, diagnosis: DiagnosisAnswer, given: Structure) -> None:
    """Print where the extended model is, what it holds otherwise than reported, and the fitted parameters."""
    if diagnosis.extended_model:
        say_extended(diagnosis.extended_model, fitted=bool(found.reference.calibration.parameters))
        for line in _written_otherwise(found.explained, given):
            echo(f"  {line}")
        for line in calibrated_again(found.explained):
            console.print(f"  {line}", style="dim", markup=False)
    say_parameters(found.explained.calibration or found.reference.calibration)


def _notes(structure: Structure, structure_path: Path, logs: Logs, seen: Observations) -> list[str]:
    """Return notes on channels, and on a file that has the causes of an earlier diagnosis."""
    notes = _channel_notes(structure, logs)
    if seen.reference and WRITTEN in structure_path.read_text(encoding="utf-8"):
        notes.append(
            f"{structure_path} contains the causes of an earlier diagnosis. Older reference logs are of the "
            "structure without them: these causes, or their opposite, are then found again. Give logs recorded since."
        )
    return notes


def _windows_text(logs: Logs, seen: Observations) -> str:
    """Return the lengths of the windows that frequencies are means over; empty for tables of modes."""
    if any(map(is_table, (*logs.current, *logs.reference))):
        return ""
    ends = (one.estimates[0] for one in (seen.reference, seen.current) if one)
    lengths = dict.fromkeys(f"{1e-9 * (first.end - first.start):.3g} s" for first in ends)
    return (
        f"means over windows of {' (before) and '.join(lengths)}; without --window, `identify` evaluates each "
        "log as one window: its frequencies differ from these by up to about a standard deviation"
    )


def _facts(found: Explanation, structure_path: Path, logs: Logs, windows: str) -> list[tuple[str, str]]:
    """Return names and values for the head of the report: what was diagnosed."""
    return [
        ("Structure", structure_path.name),
        *log_facts("Logs", logs.current, logs.within),
        *log_facts("Reference", logs.reference, logs.reference_within),
        *log_facts("Held-out", logs.heldout, logs.heldout_within),
        *(fact for one in logs.mass for fact in log_facts(f"With {one.mass:g} kg", [one.path])),
        *([("Frequencies", windows)] if windows else []),
        *calibration_facts(found.explained.calibration or found.reference.calibration),
    ]


def _held_out_hint(logs: Logs) -> str:
    """Return how to measure the gain on a part of a log; empty if logs are held out, or a reference tests the model."""
    if logs.heldout or logs.reference or any(map(is_table, logs.current)):
        return ""
    within = "--to TIME --held-out LOG --held-out-from TIME"
    return f"gain on data not used: hold out a part of the record, {within}, such as its last third"


def _show_fit(work: Work, causes: Sequence[str], done: int, planned: int) -> None:
    """Show which causes are fitted next."""
    if not done:
        work.stage("fitting causes")
    work.note(" and ".join(map(plain, causes)))
    work.advance(done, planned)


def _compared(found: Explanation, seen: Observations) -> DiscrepancyResult:
    """Return measured modes, sensors and signals compared with simulated ones."""
    shaped = seen.current.shaped
    health = run_optional("the health of the sensors", lambda: health_result(found.health)) if shaped else None
    return discrepancy_result(
        found.reference,
        found.measured,
        found.explained,
        (seen.heldout or seen.current).sample,
        trends_beside(seen.current),
        health or {},
        shaped=shaped,
    )


def _states(found: Explanation, seen: Observations) -> StateComparison | None:
    """Return shapes and signals before and after; None without measured shapes."""
    if not seen.current.shaped:
        return None
    sample = seen.reference.sample if seen.reference else None
    return compare_states(found.reference, found.measured, found.explained, sample, seen.current.sample)


def _written_otherwise(found: DiagnosisResult, given: Structure) -> list[str]:
    """Return which bodies the extended model has with other numbers than those reported."""
    own = found.extended.body if found.extended else ()
    return written_bodies_texts(found.diagnosis.causes, [body for body in own if body not in given.body])


def _channel_notes(structure: Structure, logs: Logs) -> list[str]:
    """Report channels that are in the logs but not in the structure, and those of current or reference logs alone."""
    current, reference = _channels_of(logs.current), _channels_of(logs.reference)
    notes = []
    if strange := [name for name in current if name not in structure.active_channels]:
        notes.append(f"{names_of(logs.current)}: no sensor of the structure, left out: {', '.join(strange)}")
    if lacking := [name for name in reference if name in structure.active_channels and name not in current]:
        notes.append(f"{names_of(logs.current)}: compared without {', '.join(lacking)}, which the reference has")
    known = [name for name in current if name in structure.active_channels]
    if reference and (new := [name for name in known if name not in reference]):
        notes.append(
            f"{names_of(logs.reference)}: no {', '.join(new)}: the shapes before the change are the model's there"
        )
    return notes if current else []


def _channels_of(paths: Sequence[Path]) -> list[str]:
    """Return the channels of logs, each once; none of tables, which are checked as they are read."""
    if any(is_table(path) for path in paths):
        return []
    return list(dict.fromkeys(channel.name for log in as_logs(paths) for channel in log_channels(log)))
