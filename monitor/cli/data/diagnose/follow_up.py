"""Comparison of a diagnosis with an earlier one, whose advice was followed."""

from pathlib import Path

from monitor.analysis.observation import Observation
from monitor.errors import ArgumentError, ResultsError
from monitor.results.comparison import DiagnosisAnswer, FollowUp
from monitor.views.report import load_diagnosis


def earlier_diagnosis(path: Path | None) -> DiagnosisAnswer | None:
    """Return the earlier diagnosis, which left causes open.

    Raises
    ------
    ArgumentError
        If the file is no diagnosis, or the diagnosis left nothing open.
    """
    if path is None:
        return None
    try:
        found = load_diagnosis(path)
    except ResultsError as error:
        raise ArgumentError("--follows", str(error)) from error
    if found.separation is None:
        raise ArgumentError("--follows", f"{path}: no causes were left open ({found.verdict})")
    return found


def measured_since(before: Observation | None, after: Observation, n_masses: int) -> str:
    """Return which kind of further measurement was made.

    Parameters
    ----------
    before, after : the reference logs and the current ones: a channel that only these have is a further sensor
    n_masses : number of records with a known mass
    """
    if n_masses:
        return "known_mass"
    return "longer_record" if before is None or _channels(after) <= _channels(before) else "sensor"


def follow_up(earlier: DiagnosisAnswer, now: DiagnosisAnswer, kind: str) -> FollowUp | None:
    """Return how many causes were left open and are now; None if nothing is explained now.

    Parameters
    ----------
    kind : of the further measurement
    """
    left = now.separation.open if now.separation else 1.0 if now.verdict == "explained" else None
    if earlier.separation is None or left is None:
        return None
    expected = [m.leaves for m in earlier.separation.measurements if m.kind == kind]
    return FollowUp(before=earlier.separation.open, now=left, expected=min(expected, default=None))


def _channels(observation: Observation) -> set[str]:
    return {name for estimate in observation.estimates for name in estimate.channels}
