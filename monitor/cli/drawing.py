"""What `diagnose --out` draws: the report, the viewer's recording, and the numbers behind them."""

from pathlib import Path

from monitor.cli.files import write_json
from monitor.describe import bare_reference
from monitor.discrepancy import DiscrepancyResult
from monitor.errors import ResultsError
from monitor.report import diagnosis_report
from updater import Diagnosis, Structure

REPORT, RECORDING, NUMBERS = "report.html", "diagnosis.rrd", "discrepancy.json"


def draw(out: Path, diagnosis: Diagnosis, found: DiscrepancyResult, structure: Structure) -> None:
    """Write report, recording and numbers into a folder.

    Parameters
    ----------
    out : the folder
    diagnosis : to draw
    found : measured beside simulated, of the structure
    structure : that was diagnosed

    Raises
    ------
    ResultsError
        If one of them cannot be written.
    """
    from monitor.viewer import write_diagnosis  # loads rerun: not before there is something to draw

    write_json(out / NUMBERS, found.model_dump(mode="json"))
    diagnosis_report(diagnosis, out / REPORT, title=structure.name, structure=structure, found=found)
    try:
        write_diagnosis(out / RECORDING, diagnosis, found, bare_reference(structure))
    except OSError as error:
        raise ResultsError(out / RECORDING, f"cannot be written: {error.strerror}") from error


def written(out: Path, diagnosis: Diagnosis) -> list[Path]:
    """Return the files in the folder, what is to be read first in front."""
    names = [REPORT, RECORDING, *([Path(diagnosis.extended_model).name] if diagnosis.extended_model else [])]
    return [out / name for name in (*names, "diagnosis.json", NUMBERS) if (out / name).exists()]
