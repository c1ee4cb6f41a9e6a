"""JSON schema of a diagnosis (docs/updater.md, `modalwatch diagnose --json`)."""

from updater.diagnosis import CalibrationSummary, Cause, Failed, Gain, ModeFit, ReferenceStep, Verdict
from updater.quantities import PlainValue


class RejectedCause(PlainValue):
    """One cause that was tried and refused."""

    cause: str
    log_evidence: float  #: against the best one [-]
    why: str


class DiagnosisAnswer(PlainValue):
    """Errors of the simulation, or changes of the structure."""

    verdict: Verdict
    causes: tuple[Cause, ...]
    rejected: tuple[RejectedCause, ...]
    modes: tuple[ModeFit, ...]
    gain: Gain | None
    extended_model: str | None = None  #: path of the structure.toml with the causes written in
    calibration: CalibrationSummary | None = None  #: None where the structure file was taken as it is
    next_measurement: str
    failed: tuple[Failed, ...] = ()  #: parts left out because of internal faults
    reference_steps: tuple[ReferenceStep, ...] = ()  #: changes of the structure within the reference logs
