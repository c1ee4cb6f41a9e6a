"""Values of a diagnosis; `monitor.text.diagnosis` makes their sentences, and the JSON of `modalwatch diagnose`."""

from typing import Literal

from updater.quantities import ParameterChange, PlainValue, Quantity, Vector, Where

Verdict = Literal["nothing_to_explain", "explained", "ambiguous", "unexplained"]
#: why a cause is refused; a model that is assumed to be worse is one with a larger model error
Reason = Literal["poor_fit", "uniform_shift", "no_change_fits_as_well", "worse_model_only", "less_probable"]
#: why nothing is measured next that would separate hypotheses
Situation = Literal["no_change", "unsteady", "scattered_mass", "widespread_stiffness"]


class Cause(PlainValue):
    """One accepted cause."""

    cause: str
    probability: float
    where: Where | None  #: None for a cause that has no place
    parameters: dict[str, Quantity]
    cannot_be_told_from: tuple[str, ...] = ()
    changes: tuple[ParameterChange, ...] = ()  #: changes of the model's own parameters, for causes that consist of them


class Rejected(PlainValue):
    """One cause that was tried and refused."""

    cause: str
    log_evidence: float  #: against the best one [-]
    reason: Reason
    p_value: float  #: of its fit


class NewSensor(PlainValue):
    """A further sensor."""

    position: Vector  #: [m]
    axis: Literal["x", "y", "z"]


class KnownMass(PlainValue):
    """A known mass, clamped on."""

    mass: float  #: [kg]
    position: Vector  #: [m]


class LongerRecord(PlainValue):
    """A longer record."""

    times: int  #: length relative to the present one


class Instrument(PlainValue):
    """An instrument that measures a factor on all frequencies."""

    name: str  #: as the cause states it


class Measurement(PlainValue):
    """A measurement, and what it is expected to separate."""

    what: NewSensor | KnownMass | LongerRecord | Instrument
    pairs: tuple[tuple[int, int], ...]  #: hypotheses that it separates
    deviations: float  #: by at least so many standard deviations


class Measurements(PlainValue):
    """Measurements that decide between hypotheses, the most decisive first."""

    hypotheses: tuple[tuple[str, ...], ...]  #: names of the causes of each
    measurements: tuple[Measurement, ...]
    inseparable: tuple[tuple[int, int], ...]  #: hypotheses that none of the measurements considered separates


class OddFrequency(PlainValue):
    """A frequency that an explanation does not fit."""

    frequency: float  #: of the mode in the reference [Hz]
    deviations: float  #: distance in standard deviations


class OddShape(PlainValue):
    """A shape that an explanation does not fit."""

    frequency: float  #: of the mode in the reference [Hz]
    mac: float
    channel: str  #: with the largest residual


class Misfit(PlainValue):
    """What the best hypothesis does not fit: the measurement is to be repeated."""

    causes: tuple[str, ...]  #: names of those of the hypothesis
    frequency: OddFrequency | None  #: None if no frequency is off by itself
    shape: OddShape | None  #: None if all agree


#: measurements that decide, a misfit, or the advice of each cause found
NextMeasurement = Measurements | Misfit | Situation | tuple[str, ...]


class Failed(PlainValue):
    """One cause, several together, or another part of the answer, left out because of an internal fault."""

    part: str  #: names of causes, or of the part
    error: str  #: type and message of the fault


class FrequencyFit(PlainValue):
    """A frequency as measured, and as predicted without and with the causes [Hz]."""

    measured: float | None
    std: float | None
    before: float | None
    after: float | None


class Pair(PlainValue):
    """A figure without and with the causes."""

    before: float | None
    after: float | None


class ModeFit(PlainValue):
    """One mode, without and with the causes."""

    frequency: FrequencyFit
    mac: Pair


class Gain(PlainValue):
    """The gain of the written model over the same model without the causes, on data that were not used if `heldout`."""

    heldout: bool
    frequency_error_percent: Pair  #: root mean square over the modes measured that the written model has
    one_minus_mac: Pair  #: mean
    log_likelihood: Pair
    change_error_percent: Pair | None = None  #: root mean square error of predicted changes since the baseline
    n_modes: int = 0  #: measured modes that the written model has
    n_measured: int = 0  #: all that were measured
    noise_percent: float | None = None  #: frequency error that measurement noise alone would leave
    exceeds_noise: bool = False  #: whether the residual of the written model is larger


class ReferenceStep(PlainValue):
    """Windows of the reference logs that are left out because the structure was in another state."""

    start: int  #: start of the first of them [ns UTC]
    end: int  #: end of the last one [ns UTC]
    n_windows: int  #: number of windows left out
    of_windows: int  #: number of windows of the reference logs
    frequency: tuple[float, ...]  #: frequency of each mode measured in both states [Hz]
    shift_percent: tuple[float, ...]  #: shift of these modes relative to the windows that are used [%]
    shift_std_percent: tuple[float, ...]  #: [%]
    p_value: float  #: probability of as clear a step in windows of one state [-]


class PairedModes(PlainValue):
    """Numbers of measured modes that have a partner in the model, as filed and as calibrated."""

    before: int
    after: int


class CalibrationSummary(PlainValue):
    """Calibration of the model that causes are sought about, to the reference or to the measured modes."""

    modes_measured: int
    modes_paired: PairedModes
    frequency_error_percent: Pair  #: root mean square over the modes that are paired afterwards


class Diagnosis(PlainValue):
    """Errors of the simulation, or changes of the structure."""

    verdict: Verdict
    causes: tuple[Cause, ...]
    rejected: tuple[Rejected, ...]
    modes: tuple[ModeFit, ...]
    gain: Gain | None
    calibration: CalibrationSummary | None = None  #: None where the structure file was taken as it is
    next_measurement: NextMeasurement
    failed: tuple[Failed, ...] = ()  #: parts left out because of internal faults
