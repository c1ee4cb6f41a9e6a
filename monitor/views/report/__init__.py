"""The report: one HTML page that needs no network, the verdict first, the evidence below it; a PDF of the same."""

import errno
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup, escape
from pydantic import ValidationError

from daq.errors import writing
from monitor.errors import ResultsError
from monitor.results.comparison import DiagnosisAnswer, DiscrepancyResult
from monitor.results.convert import bare_reference
from monitor.results.state_comparison import StateComparison
from monitor.results.windows import ReferenceResult
from monitor.text.verdicts import diagnosis_text
from monitor.views.report.content import diagnosis_content, run_content, versions
from monitor.views.report.pdf import load_typst as load_typst
from monitor.views.report.pdf import pdf_of
from monitor.views.run import Run
from oma.plots import styled
from updater import Structure


def run_report(run: Run, path: Path, diagnosis: DiagnosisAnswer | None = None, *, pdf: Path | None = None) -> None:
    """Write the report of a run.

    Parameters
    ----------
    run : as read from its log
    path : of the page; an existing one is replaced
    diagnosis : to show instead of the one in the log
    pdf : of a PDF with the content of the page; an existing one is replaced

    Raises
    ------
    ResultsError
        If a file cannot be written.
    ImportError
        Naming the extra, if the package for PDFs is not installed.
    """
    if pdf:
        load_typst()
    _write(path, "run.html", lambda: run_content(run, diagnosis), pdf)


def diagnosis_report(
    diagnosis: DiagnosisAnswer,
    path: Path | None,
    *,
    title: str,
    structure: Structure | None = None,
    found: DiscrepancyResult | None = None,
    pdf: Path | None = None,
    facts: Sequence[tuple[str, str]] = (),
    states: StateComparison | None = None,
) -> None:
    """Write the report of a diagnosis alone; errors as for `run_report`.

    Parameters
    ----------
    diagnosis : the answer of `modalwatch diagnose`
    path : of the page; None for none
    title : name of the diagnosed structure
    structure : to draw the causes on
    found : comparison of measured and simulated modes, of the same structure
    pdf : of a PDF with the content of the page
    facts : names and values, shown before the diagnosis
    states : shapes before and now, of the same structure
    """

    def values() -> dict[str, Any]:
        reference = bare_reference(structure) if structure else None
        return _diagnosis_values(diagnosis, reference, found, title, facts, states)

    _write(path, "diagnosis.html", values, pdf)


def alarm_report(
    diagnosis: DiagnosisAnswer, *, title: str, facts: list[tuple[str, str]], reference: ReferenceResult | None
) -> str:
    """Return the page of an alarm.

    Parameters
    ----------
    diagnosis : its last one
    title : name of the site
    facts : names and values, shown before the diagnosis
    reference : to draw the causes on
    """
    with styled():
        return _rendered("diagnosis.html", _diagnosis_values(diagnosis, reference, None, title, facts))


def _diagnosis_values(
    diagnosis: DiagnosisAnswer,
    reference: ReferenceResult | None,
    found: DiscrepancyResult | None,
    title: str,
    facts: Sequence[tuple[str, str]],
    states: StateComparison | None = None,
) -> dict[str, Any]:
    content = diagnosis_content(diagnosis, reference, found, states)
    return {
        "title": title,
        "state": {"nothing_to_explain": "normal", "explained": "alarm"}.get(diagnosis.verdict, "watch"),
        "headline": diagnosis_text(diagnosis),
        "facts": facts,
        "diagnosis": content,
        "versions": versions(),
    }


_CODE = re.compile("`([^`]*)`")
_UNIT = re.compile(r"(?<=[\d)]) (?=(?:%|degrees\b|[µnmkMG]?(?:m|g|N|Hz|s|rad|Pa)\b))|(?<=N) (?=m\b)")


class _DiagnosisFile(DiagnosisAnswer):
    version: int = 1


def load_diagnosis(path: Path) -> DiagnosisAnswer:
    """Read the output of `modalwatch diagnose --json`.

    Raises
    ------
    ResultsError
        Naming file and field.
    """
    try:
        found = _DiagnosisFile.model_validate_json(path.read_bytes())
        return DiagnosisAnswer.model_validate(found.model_dump(exclude={"version"}))
    except OSError as error:
        raise ResultsError(path, f"cannot be read: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ResultsError(path, f"is no diagnosis: {place + ': ' if place else ''}{first['msg']}") from error


def _write(path: Path | None, template: str, values: Callable[[], dict[str, Any]], pdf: Path | None = None) -> None:
    """Write a page; where none can be written is refused before anything is drawn, which takes seconds."""
    with ExitStack() as stack:
        parts = {file: stack.enter_context(_part_of(file)) for file in (path, pdf) if file}
        with styled():
            text = _rendered(template, values())
        for file, part in parts.items():
            content = pdf_of(text) if file == pdf else text.encode()
            with writing(file, ResultsError):
                part.write_bytes(content)
                part.replace(file)


@contextmanager
def _part_of(path: Path) -> Iterator[Path]:
    """Create the file that will take a name once it is whole; remove it if it does not."""
    part = path.with_name(path.name + ".part")
    with writing(path, ResultsError):
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        part.touch()
    try:
        yield part
    finally:
        part.unlink(missing_ok=True)


def _rendered(template: str, values: dict[str, Any]) -> str:
    environment = Environment(
        loader=PackageLoader("monitor.views.report"),
        autoescape=select_autoescape(["html"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["tied"] = _tied
    return environment.get_template(template).render(values)


def _tied(text: str) -> Markup:
    """Return a text with deviations and units that stay on one line, and what is in backticks as code."""
    tied = _UNIT.sub("\u00a0", text.replace(" ± ", "\u00a0±\u00a0").replace(" per kN", "\u00a0per\u00a0kN"))
    return Markup(_CODE.sub(r"<code>\1</code>", str(escape(tied))))
