"""Output of `diagnose --out`: the report, the recording for the viewer, and their numbers."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from monitor.cli.files import write_json
from monitor.describe import bare_reference
from monitor.discrepancy import DiscrepancyResult
from monitor.errors import ResultsError
from monitor.optional import run_optional
from monitor.report import diagnosis_report
from updater import Diagnosis, Structure

REPORT, RECORDING, NUMBERS = "report.html", "diagnosis.rrd", "discrepancy.json"


def draw(out: Path, diagnosis: Diagnosis, found: DiscrepancyResult | None, structure: Structure) -> None:
    """Write report, recording and numbers into a folder; what cannot be drawn is logged and left out.

    Parameters
    ----------
    out : the folder
    diagnosis : to draw
    found : comparison of measured with simulated modes of the structure; None: not known, and no recording
    structure : that was diagnosed

    Raises
    ------
    ResultsError
        If one of them cannot be written.
    """
    from monitor.viewer import write_diagnosis  # loads rerun: not before there is something to draw

    for name in (REPORT, RECORDING, NUMBERS):  # of an earlier diagnosis
        with _writing(out / name):
            (out / name).unlink(missing_ok=True)

    def record() -> None:
        if found is not None:
            with _writing(out / RECORDING):
                write_diagnosis(out / RECORDING, diagnosis, found, bare_reference(structure))

    if found is not None:
        write_json(out / NUMBERS, found.model_dump(mode="json"))
    run_optional(
        REPORT,
        lambda: diagnosis_report(diagnosis, out / REPORT, title=structure.name, structure=structure, found=found),
    )
    run_optional(RECORDING, record)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise ResultsError(path, f"cannot be written: {error.strerror}") from error


def written(out: Path, diagnosis: Diagnosis) -> list[Path]:
    """Return the files in the folder, what is to be read first in front."""
    names = [REPORT, RECORDING, *([Path(diagnosis.extended_model).name] if diagnosis.extended_model else [])]
    return [out / name for name in (*names, "diagnosis.json", NUMBERS) if (out / name).exists()]
