"""Changes since the reference logs, or errors of the structure file."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np

from daq import AnyLog, LogError
from daq.errors import writing
from daq.log import as_logs
from monitor.analysis.excluded_channels import left_out_texts
from monitor.analysis.explanation import Explanation, MassRecord, explain
from monitor.analysis.logs import log_channels
from monitor.analysis.modal_table.table import is_table
from monitor.analysis.modal_table.universal import is_universal
from monitor.analysis.observation import Observation, given_up
from monitor.analysis.selection import Selection
from monitor.analysis.states.record_course import explain_record
from monitor.analysis.states.stationarity import step_text
from monitor.analysis.time_range import WHOLE, TimeRange
from monitor.analysis.trends import trends_beside
from monitor.cli.data.diagnose.basis import calibration_facts, log_facts
from monitor.cli.data.diagnose.diagnosis_output import say_answer, say_evidence
from monitor.cli.data.diagnose.follow_up import earlier_diagnosis, follow_up, measured_since
from monitor.cli.data.diagnose.held_out import check_independent
from monitor.cli.data.log_observation import observe_logs
from monitor.cli.data.structure.parameters_output import changes_table
from monitor.cli.options import DONE, NEEDS_A_PERSON
from monitor.cli.output import STDOUT, write_json
from monitor.cli.terminal import Work, console, echo, progress, warn
from monitor.errors import ArgumentError, ResultsError, State, StateError
from monitor.optional import run_optional
from monitor.results.comparison import DiagnosisAnswer, DiscrepancyResult
from monitor.results.convert import bare_reference
from monitor.results.correlation import discrepancy_result
from monitor.results.state_comparison import StateComparison, compare_states
from monitor.text.cause_list import listed_causes
from monitor.text.causes import (
    alternative_texts,
    cause_text,
    further_changes_text,
    gain_text,
    probability_text,
    uncertain_text,
)
from monitor.text.diagnosis import effective_texts, written_bodies_texts
from monitor.text.sensors import health_result
from monitor.views.report import diagnosis_report, load_typst
from updater import DiagnosisResult, ModelError, Structure, build_model, dump_structure, load_structure, parse_structure
from updater.diagnosis import allowed_causes
from updater.errors import SelectionError
from updater.modal_data import Effort
from updater.quantities import plain
from updater.reference import Calibration
from updater.structure import without_empty_segments

REPORT, RECORDING, NUMBERS = "report.html", "diagnosis.rrd", "discrepancy.json"
_ANSWER, _EXTENDED_MODEL, _RECALIBRATED_MODEL = (
    "diagnosis.json",
    "structure_extended.toml",
    "structure_recalibrated.toml",
)
FOLDER_FILES = (REPORT, RECORDING, NUMBERS, _ANSWER, _EXTENDED_MODEL, _RECALIBRATED_MODEL)  #: that `--out` may write


def draw(
    out: Path | None,
    diagnosis: DiagnosisAnswer,
    found: DiscrepancyResult | None,
    structure: Structure,
    states: StateComparison | None = None,
    pdf: Path | None = None,
    facts: Sequence[tuple[str, str]] = (),
) -> None:
    """Write report, recording and numbers into a folder, and the PDF; failures are logged and left out.

    Parameters
    ----------
    out : the folder; None for the PDF alone
    diagnosis : to draw
    found : comparison of measured with simulated modes of the structure; None: not known, and no recording
    structure : that was diagnosed
    states : shapes and signals before and after, for report and recording
    pdf : of the report as a PDF
    facts : names and values for the head of the report

    Raises
    ------
    ResultsError
        If one of them cannot be written.
    """
    for old in (out / name for name in (REPORT, RECORDING, NUMBERS) if out):  # of an earlier diagnosis
        with writing(old, ResultsError):
            old.unlink(missing_ok=True)
    page = out / REPORT if out else None
    run_optional(
        REPORT if page else str(pdf),
        lambda: diagnosis_report(
            diagnosis, page, title=structure.name, structure=structure, found=found, pdf=pdf, facts=facts, states=states
        ),
    )
    if out and found is not None:
        write_json(out / NUMBERS, found.model_dump(mode="json"))
        run_optional(RECORDING, partial(_record, out / RECORDING, diagnosis, found, structure, states))


def _record(
    path: Path,
    diagnosis: DiagnosisAnswer,
    found: DiscrepancyResult,
    structure: Structure,
    states: StateComparison | None,
) -> None:
    """Write the recording for the viewer."""
    from monitor.views.viewer import write_diagnosis  # loads rerun: not before there is something to draw

    with writing(path, ResultsError):
        write_diagnosis(path, diagnosis, found, bare_reference(structure), states)


def written(out: Path, diagnosis: DiagnosisAnswer) -> list[Path]:
    """Return the files in the folder, the one to be read first in front."""
    names = [REPORT, RECORDING, *([Path(diagnosis.extended_model).name] if diagnosis.extended_model else [])]
    return [out / name for name in (*names, _ANSWER, NUMBERS) if (out / name).exists()]


_LIFTED = "the removed body is not in this file: its stiffness was fitted to the reference logs with the body on"
_EXTENDED = "found by modalwatch diagnose"  # comment of entries added to an extended model


@dataclass(frozen=True)
class MassLog:
    """Log of the present state with a known mass."""

    path: Path
    mass: float  #: [kg]
    position: tuple[float, float, float]  #: [m]

    @classmethod
    def of(cls, text: str) -> "MassLog":
        """Return what is written as `with_mass.mcap=0.1@0.3,0,1.48`.

        Raises
        ------
        ArgumentError
            If the text is not written like that.
        """
        path, _, rest = text.rpartition("=")
        mass, _, place = rest.partition("@")
        try:
            kilograms, (x, y, z) = float(mass), map(float, place.split(","))
        except ValueError:
            kilograms = 0.0
        if not path or not 0 < kilograms < math.inf or not all(map(math.isfinite, (x, y, z))):
            raise ArgumentError(
                "--known-mass", f"expected LOG=KG@X,Y,Z, such as with_mass.mcap=0.1@0.3,0,1.48, found {text!r}"
            )
        return cls(Path(path), kilograms, (x, y, z))

    def check_place(self, structure: Structure) -> None:
        """Refuse a place that is on no member.

        Raises
        ------
        ArgumentError
            Naming the point.
        """
        try:
            build_model(structure).read(np.array(self.position))
        except ModelError as error:
            raise ArgumentError("--known-mass", str(error)) from error


@dataclass(frozen=True, kw_only=True)
class Logs:
    """Logs of a diagnosis, as given on the command line."""

    current: Sequence[Path]
    reference: Sequence[Path] = ()
    heldout: Sequence[Path] = ()
    mass: Sequence[MassLog] = ()
    within: TimeRange = WHOLE  #: range of the current logs
    reference_within: TimeRange = WHOLE
    heldout_within: TimeRange = WHOLE
    exponential_window: float | None = None  #: time constant, of frequency responses [s]

    def of_state(self, state: State) -> Sequence[Path]:
        """Return the logs of a state of the structure."""
        known = {"current": self.current, "reference": self.reference, "heldout": self.heldout}
        return known[state] if state in known else [one.path for one in self.mass]

    def check_window(self) -> None:
        """Refuse an exponential window of no length, or of no frequency responses."""
        window, paths = self.exponential_window, [path for state in get_args(State) for path in self.of_state(state)]
        if window is not None and not window > 0:
            raise ArgumentError("--exponential-window", f"expected a positive time in s, found {window:g}")
        if window is not None and not any(map(is_universal, paths)):
            raise ArgumentError("--exponential-window", f"expected frequency responses (.uff, .unv), found {paths[0]}")


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
    structure = selected_structure(structure_path, selection)
    for known in logs.mass:
        known.check_place(structure)
    earlier = earlier_diagnosis(follows)
    if pdf:
        try:
            load_typst()
        except ImportError as error:
            raise ArgumentError("--pdf", str(error)) from error
    if not (logs.reference or logs.reference_within.whole):
        raise ArgumentError(", ".join(logs.reference_within.options), "expected --reference LOG, found none")
    if not (logs.heldout or logs.heldout_within.whole):
        raise ArgumentError(", ".join(logs.heldout_within.options), "expected --held-out LOG, found none")
    if logs.heldout:
        _check_held_out(logs)
    with progress("reading") as work:
        lowest = math.inf  # frequency of the lowest mode measured so far [Hz]

        def observed(paths: Sequence[Path], what: str, within: TimeRange = WHOLE) -> Observation | None:
            nonlocal lowest
            if not paths:
                return None
            exponential = logs.exponential_window
            found = observe_logs(structure, paths, window, what, work, selection, within, exponential, lowest)
            found = selection.of_observation(found)
            lowest = min(lowest, found.lowest_frequency)
            return found

        before = observed(logs.reference, "reference", logs.reference_within)
        after = observed(logs.current, "logs", logs.within)
        heldout = observed(logs.heldout, "held-out logs", logs.heldout_within)
        with_mass = [
            MassRecord(mass=known.mass, position=known.position, observation=seen)
            for known in logs.mass
            if (seen := observed([known.path], f"log with {known.mass:g} kg"))
        ]
        assert after is not None  # there is at least one log
        work.stage("fitting the model")
        try:
            explained = partial(
                explain,
                on_cause=partial(_show_fit, work),
                only=selection.only,
                without=selection.without,
                with_mass=with_mass,
                effort=effort,
            )
            found = explain_record(explained, structure, before, after, heldout)
        except StateError as error:
            raise LogError(", ".join(map(str, logs.of_state(error.state))), str(error)) from error
    if earlier:
        follow = follow_up(earlier, found.diagnosis, measured_since(before, after, len(with_mass)))
        found = replace(found, diagnosis=found.diagnosis.model_copy(update={"follows": follow}))
    diagnosis = _write(found, structure_path, logs, out, json_path)
    nearer = _write_nearer(found.explained, structure_path, logs, out)
    heavier = [([known.path], one.observation) for known, one in zip(logs.mass, with_mass, strict=True)]
    for paths, one in ((logs.current, after), (logs.reference, before), (logs.heldout, heldout), *heavier):
        for text in left_out_texts({c: str(fault) for c, fault in given_up(one).items()}) if one else ():
            warn(f"warning: {_names(paths)}: {text}")
    for step in diagnosis.reference_steps:
        warn(f"note: {_names(logs.reference)}: {step_text(step)}")
    say_answer(console, diagnosis)
    with progress("comparing measured with simulated"):
        compared = run_optional(
            "the comparison of measured with simulated modes", lambda: _compared(found, after, heldout)
        )
    windows = _windows_text(logs, before, after)
    say_evidence(console, diagnosis, compared, found.reference.structure, windows)
    if diagnosis.extended_model:
        _say_extended(diagnosis.extended_model, fitted=bool(found.reference.calibration.parameters))
        for line in _written_otherwise(found.explained, structure):
            echo(f"  {line}")
        for line in _calibrated_again(found.explained):
            console.print(f"  {line}", style="dim", markup=False)
    _say_parameters(found.explained.calibration or found.reference.calibration)
    if nearer:
        echo(nearer)
    if diagnosis.causes and (hint := _held_out_hint(logs)):
        console.print(hint, style="dim", markup=False)
    for note in _channel_notes(structure, logs):
        warn(f"note: {note}")
    if before and _EXTENDED in structure_path.read_text(encoding="utf-8"):
        console.print(
            f"note: {structure_path} contains the causes of an earlier diagnosis. Older reference logs are of the "
            "structure without them: these causes, or their opposite, are then found again. Give logs recorded since.",
            style="yellow",
        )
    if out or pdf:
        with progress("drawing"):
            states = run_optional("the comparison of both states", lambda: _states(found, before, after))
            facts = run_optional("the list of the logs", lambda: _facts(found, structure_path, logs, windows)) or []
            draw(out, diagnosis, compared, found.reference.structure, states, pdf, facts)
        paths = [*(written(out, diagnosis) if out else ()), *([pdf] if pdf and pdf.exists() else ())]
        echo("written: " + ", ".join(map(str, paths)))
    return DONE if diagnosis.verdict in {"explained", "nothing_to_explain"} else NEEDS_A_PERSON


def _windows_text(logs: Logs, before: Observation | None, after: Observation) -> str:
    """Return the lengths of the windows that frequencies are means over; empty for tables of modes."""
    if any(map(is_table, (*logs.current, *logs.reference))):
        return ""
    ends = (one.estimates[0] for one in (before, after) if one)
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


def _check_held_out(logs: Logs) -> None:
    """Refuse held-out logs that are not independent of the fit."""
    fitted: list[AnyLog] = []
    for paths, within in ((logs.current, logs.within), (logs.reference, logs.reference_within)):
        if within.whole or not any(map(is_table, paths)):  # else refused as it is read
            fitted += within.of_logs(as_logs(paths))
    if logs.heldout_within.whole or not any(map(is_table, logs.heldout)):
        check_independent(logs.heldout_within.of_logs(as_logs(logs.heldout)), fitted)


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


def _compared(found: Explanation, after: Observation, heldout: Observation | None) -> DiscrepancyResult:
    """Return measured modes, sensors and signals compared with simulated ones."""
    health = run_optional("the health of the sensors", lambda: health_result(found.health)) if after.shaped else None
    sample = (heldout or after).sample
    return discrepancy_result(
        found.reference,
        found.measured,
        found.explained,
        sample,
        trends_beside(after),
        health or {},
        shaped=after.shaped,
    )


def _states(found: Explanation, before: Observation | None, after: Observation) -> StateComparison | None:
    """Return shapes and signals before and after; None without measured shapes."""
    if not after.shaped:
        return None
    sample = before.sample if before else None
    return compare_states(found.reference, found.measured, found.explained, sample, after.sample)


def _say_extended(path: str, *, fitted: bool) -> None:
    echo(f"extended model: {path}")
    if fitted:
        console.print(
            "  it also has the parameters fitted to the reference logs: stiffness of materials, feet and joints",
            style="dim",
        )


def _written_otherwise(found: DiagnosisResult, given: Structure) -> list[str]:
    """Return which bodies the extended model has with other numbers than those reported."""
    own = found.extended.body if found.extended else ()
    return written_bodies_texts(found.diagnosis.causes, [body for body in own if body not in given.body])


def _say_parameters(calibration: Calibration) -> None:
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


def _write_nearer(found: DiagnosisResult, structure_path: Path, logs: Logs, out: Path | None) -> str:
    """Write the recalibrated model of a file that is far off, if requested; return a message, if any."""
    if found.nearer is None:
        return ""
    gain, std = found.nearer.gained.gain, found.nearer.gained.std
    before, after = gain_text(gain.frequency_error_percent, std.frequency_error_percent, ".3g")
    what = f"with its own parameters fitted the file's frequencies are off by {after} %, not by {before} %"
    if out is None:
        return f"{what}: --out DIR writes that model"
    path = out / _RECALIBRATED_MODEL
    given = structure_path.read_text(encoding="utf-8")
    text = dump_structure(found.nearer.structure, given, note="fitted by modalwatch diagnose")
    head = (
        f"# {structure_path.name} with its own parameters fitted to {_names(logs.current)}, which it does not explain\n"
    )
    with writing(path, ArgumentError.of_file("--out")):
        path.write_text(head + text, encoding="utf-8")
    return f"recalibrated model: {path}\n  {what}; diagnose again with it"


def selected_structure(path: Path, selection: Selection) -> Structure:
    """Read a structure file and limit the updated parameters.

    Raises
    ------
    ArgumentError
        Naming a parameter that the structure does not have, or an unknown cause.
    """
    try:
        allowed_causes(selection.only, selection.without)
    except SelectionError as error:
        raise ArgumentError("--only, --without", str(error)) from error
    structure = load_structure(path)
    try:
        return selection.of_structure(structure)
    except ValueError as error:
        given = (("--fix", selection.fixed), ("--bound", selection.bounds))
        named = [option for option, values in (*given, ("--without-channel", selection.without_channels)) if values]
        raise ArgumentError(", ".join(named), str(error)) from error


def _channel_notes(structure: Structure, logs: Logs) -> list[str]:
    """Report channels that are in the logs but not in the structure, and those of current or reference logs alone."""
    current, reference = _channels_of(logs.current), _channels_of(logs.reference)
    notes = []
    if strange := [name for name in current if name not in structure.active_channels]:
        notes.append(f"{_names(logs.current)}: no sensor of the structure, left out: {', '.join(strange)}")
    if lacking := [name for name in reference if name in structure.active_channels and name not in current]:
        notes.append(f"{_names(logs.current)}: compared without {', '.join(lacking)}, which the reference has")
    known = [name for name in current if name in structure.active_channels]
    if reference and (new := [name for name in known if name not in reference]):
        notes.append(
            f"{_names(logs.reference)}: no {', '.join(new)}: the shapes before the change are the model's there"
        )
    return notes if current else []


def _channels_of(paths: Sequence[Path]) -> list[str]:
    """Return the channels of logs, each once; none of tables, which are checked as they are read."""
    if any(is_table(path) for path in paths):
        return []
    return list(dict.fromkeys(channel.name for log in as_logs(paths) for channel in log_channels(log)))


def _calibrated_again(found: DiagnosisResult) -> list[str]:
    """Return why an extended model is not of the reference's calibration."""
    springs = f"calibrated to reference and current logs together, as unchanged: {', '.join(found.springs)}"
    return [_LIFTED] * bool(found.removed) + [springs] * bool(found.springs)


def _provenance(found: DiagnosisResult, structure_path: Path, logs: Logs) -> str:
    """Return comments on the origin of an extended model."""
    since = f" since {_names(logs.reference)}" if logs.reference else ""
    lines = [f"{structure_path.name} as extended: what was found in {_names(logs.current)}{since}"]
    for cause in listed_causes(found.diagnosis.causes):
        lines.append(f"{cause_text(cause)} (probability {probability_text(cause)})")
        lines += [f"  not written, but as compatible with the data: {text}" for text in alternative_texts(cause)]
    lines += effective_texts(found.diagnosis.causes)
    lines += _calibrated_again(found)
    if logs.reference:
        lines.append("and what was fitted to the latter: the stiffness of materials, feet and joints")
    return "".join(f"# {line}\n" for line in lines)


def _names(paths: Sequence[Path]) -> str:
    return ", ".join(path.name for path in paths)


def _write(
    found: Explanation, structure_path: Path, logs: Logs, out: Path | None, json_path: Path | None
) -> DiagnosisAnswer:
    """Write the requested files; return the diagnosis with the path of the extended model."""
    diagnosis, path = found.diagnosis, out / _EXTENDED_MODEL if out else beside_json(json_path)
    with writing(path.parent if path else Path(), ArgumentError.of_file("--out" if out else "--json")):
        if out:
            out.mkdir(parents=True, exist_ok=True)
        if found.explained.extended and path:
            given = structure_path.read_text(encoding="utf-8")
            own = parse_structure(given, structure_path)
            extended = without_empty_segments(found.explained.extended, own)
            extended = extended.model_copy(update={"updating": own.updating})  # not as limited on the command line
            text = dump_structure(extended, given, note=_EXTENDED)
            path.write_text(_provenance(found.explained, structure_path, logs) + text, encoding="utf-8")
            diagnosis = diagnosis.model_copy(update={"extended_model": str(path)})
    for file in filter(None, (json_path, out and out / _ANSWER)):
        write_json(file, diagnosis.model_dump(mode="json"))
    return diagnosis


def beside_json(path: Path | None) -> Path | None:
    """Return where the extended model is written if --json alone names a place; None if nowhere."""
    return path.with_name(f"{path.stem}_structure.toml") if path and path != STDOUT else None


def bound_of(text: str) -> tuple[str, tuple[float, float]]:
    """Return name and bounds of a parameter, written as `steel.E=200e9:215e9`.

    Raises
    ------
    ArgumentError
        If the text is not written like that.
    """
    name, _, limits = text.rpartition("=")
    least, _, greatest = limits.partition(":")
    try:
        values = float(least), float(greatest)
    except ValueError:
        values = 1.0, 0.0
    if not name or not 0 < values[0] < values[1]:
        raise ArgumentError("--bound", f"expected NAME=MIN:MAX, such as steel.E=200e9:215e9, found {text!r}")
    return name, values


def effort_of(texts: Sequence[str]) -> Effort:
    """Return the effort of further measurements, written as `sensor=2` in hours.

    Raises
    ------
    ArgumentError
        If a text is not written like that.
    """
    kinds = tuple(field.name for field in fields(Effort) if field.name != "record")
    given: dict[str, float] = {}
    for text in texts:
        name, _, hours = text.partition("=")
        kind = name.strip().replace("-", "_").replace(" ", "_")
        try:
            given[kind] = float(hours)
        except ValueError:
            given[kind] = -1.0
        if kind not in kinds or not 0 <= given[kind] < math.inf:
            raise ArgumentError("--effort", f"expected KIND=HOURS with one of {', '.join(kinds)}, found {text!r}")
    return Effort(**given)
