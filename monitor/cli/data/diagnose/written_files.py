"""Files that `diagnose` writes: answer, report, recording, numbers, extended and recalibrated model."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from daq.errors import writing
from monitor.analysis.explanation import Explanation
from monitor.cli.data.diagnose.arguments import Logs, names_of
from monitor.cli.output import STDOUT, write_json
from monitor.errors import ArgumentError, ResultsError
from monitor.optional import run_optional
from monitor.results.comparison import DiagnosisAnswer, DiscrepancyResult
from monitor.results.convert import bare_reference
from monitor.results.state_comparison import StateComparison
from monitor.text.cause_list import listed_causes
from monitor.text.causes import alternative_texts, cause_text, gain_text, probability_text
from monitor.text.diagnosis import effective_texts
from monitor.views.report import diagnosis_report
from updater import DiagnosisResult, Structure, dump_structure, parse_structure
from updater.structure import without_empty_segments

REPORT, RECORDING, NUMBERS = "report.html", "diagnosis.rrd", "discrepancy.json"
_ANSWER, _EXTENDED_MODEL, _RECALIBRATED_MODEL = (
    "diagnosis.json",
    "structure_extended.toml",
    "structure_recalibrated.toml",
)
FOLDER_FILES = (REPORT, RECORDING, NUMBERS, _ANSWER, _EXTENDED_MODEL, _RECALIBRATED_MODEL)  #: that `--out` may write
_LIFTED = "the removed body is not in this file: its stiffness was fitted to the reference logs with the body on"
WRITTEN = "found by modalwatch diagnose"  #: comment of entries added to an extended model


def write_answer(
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
            text = dump_structure(extended, given, note=WRITTEN)
            path.write_text(_provenance(found.explained, structure_path, logs) + text, encoding="utf-8")
            diagnosis = diagnosis.model_copy(update={"extended_model": str(path)})
    for file in filter(None, (json_path, out and out / _ANSWER)):
        write_json(file, diagnosis.model_dump(mode="json"))
    return diagnosis


def beside_json(path: Path | None) -> Path | None:
    """Return where the extended model is written if --json alone names a place; None if nowhere."""
    return path.with_name(f"{path.stem}_structure.toml") if path and path != STDOUT else None


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


def write_nearer(found: DiagnosisResult, structure_path: Path, logs: Logs, out: Path | None) -> str:
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
    logs_text = f"{names_of(logs.current)}, which it does not explain"
    head = f"# {structure_path.name} with its own parameters fitted to {logs_text}\n"
    with writing(path, ArgumentError.of_file("--out")):
        path.write_text(head + text, encoding="utf-8")
    return f"recalibrated model: {path}\n  {what}; diagnose again with it"


def calibrated_again(found: DiagnosisResult) -> list[str]:
    """Return why an extended model is not of the reference's calibration."""
    springs = f"calibrated to reference and current logs together, as unchanged: {', '.join(found.springs)}"
    return [_LIFTED] * bool(found.removed) + [springs] * bool(found.springs)


def _provenance(found: DiagnosisResult, structure_path: Path, logs: Logs) -> str:
    """Return comments on the origin of an extended model."""
    since = f" since {names_of(logs.reference)}" if logs.reference else ""
    lines = [f"{structure_path.name} as extended: what was found in {names_of(logs.current)}{since}"]
    for cause in listed_causes(found.diagnosis.causes):
        lines.append(f"{cause_text(cause)} (probability {probability_text(cause)})")
        lines += [f"  not written, but as compatible with the data: {text}" for text in alternative_texts(cause)]
    lines += effective_texts(found.diagnosis.causes)
    lines += calibrated_again(found)
    if logs.reference:
        lines.append("and what was fitted to the latter: the stiffness of materials, feet and joints")
    return "".join(f"# {line}\n" for line in lines)
