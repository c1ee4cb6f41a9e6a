"""Values that a diagnosis consists of; `monitor` makes the JSON of `modalwatch diagnose` from them."""

from typing import Literal

from updater.quantities import Breathing, ParameterChange, PlainValue, Quantity, Vector, Where

Verdict = Literal["nothing_to_explain", "explained", "ambiguous", "unexplained"]
Reason = Literal["poor_fit", "uniform_shift", "no_change_fits_as_well", "worse_model_only", "less_probable"]
Situation = Literal[
    "no_change",
    "unsteady",
    "scattered_mass",
    "widespread_stiffness",
    "worse_model",
    "unfit_model",
    "insignificant",
    "other_model",
]


class FittedCause(PlainValue):
    """One cause with its place and size."""

    cause: str
    where: Where | None  #: None for a cause that has no place
    parameters: dict[str, Quantity]
    changes: tuple[ParameterChange, ...] = ()  #: changes of the model's own parameters, for causes that consist of them
    advice: str = ""  #: check or measurement that decides about this cause


class Alternative(FittedCause):
    """A cause that the data cannot distinguish from an accepted one."""

    log_evidence: float  #: relative to the accepted one [-]


class SignalEvidence(PlainValue):
    """Evidence of the signals for a loss of stiffness that opens and closes."""

    log_evidence: float  #: that they add to that of the modes [-]
    decides: bool  #: whether another cause, or no change, is more probable by the modes alone


class OtherStiffness(PlainValue):
    """Stiffness of a foot, bearing or joint like one that changed."""

    name: str  #: name of the place, such as `foot of the left post`; empty if it has none
    position: Vector  #: [m]
    member: str | None  #: that a joint is between and the others; None of a support
    parameter: str  #: such as `stiffness_ry`
    change_percent: float  #: change of the stiffness since the reference [%]
    std_percent: float  #: [%]
    deviations: float  #: change of the flexibility over its standard deviation [-]


class Cause(FittedCause):
    """One accepted cause."""

    probability: float  #: probability that this cause, or one of `cannot_be_told_from`, is right
    cannot_be_told_from: tuple[str, ...] = ()
    alternatives: tuple[Alternative, ...] = ()  #: fitted causes of `cannot_be_told_from`
    breathing: Breathing | None = None  #: opening and closing of a loss of stiffness; None if not tested
    signals: SignalEvidence | None = None  #: None for causes that the signals add no evidence to
    others: tuple[OtherStiffness, ...] = ()  #: feet, bearings or joints like it, as far as the data determine them


class Rejected(PlainValue):
    """A cause that was tried and rejected."""

    cause: str
    log_evidence: float  #: relative to the best one [-]
    reason: Reason  #: a model that is assumed to be worse has a larger error of its predictions
    p_value: float  #: of its fit


class Measurement(PlainValue):
    """A measurement and the hypotheses that it is expected to separate; fields of other kinds are empty."""

    kind: Literal["sensor", "known_mass", "longer_record", "instrument"]
    position: Vector | None = None  #: of the sensor or the mass [m]
    axis: str = ""  #: of the sensor: x, y or z
    mass: float = 0.0  #: [kg]
    length: int = 1  #: of the record, relative to the present one
    instrument: str = ""  #: as the cause states it
    pairs: tuple[tuple[int, int], ...] = ()  #: hypotheses that it separates, by their places in `hypotheses`
    deviations: float = 0.0  #: by at least so many standard deviations
    information: float = 0.0  #: expected reduction of the entropy of the hypotheses [bit]
    leaves: float = 0.0  #: expected number of equally probable hypotheses with the entropy afterwards [-]
    hours: float = 0.0  #: work and recording [h]

    @property
    def information_per_hour(self) -> float:
        """Expected information over the effort [bit/h]."""
        return self.information / self.hours if self.hours > 0 else float("inf")


class SmallestChange(PlainValue):
    """Smallest change of one kind that these data distinguish from errors of the structure file."""

    cause: str
    parameter: str
    value: float | None  #: smallest magnitude at half of all places or channels; None if no size is detectable
    value_at_most_places: float | None  #: smallest magnitude at nine of ten places or channels
    unit: str
    extent: float | None = None  #: length of the stretch [m]; None for other kinds


class Separation(PlainValue):
    """Measurements that would decide between hypotheses."""

    hypotheses: tuple[tuple[str, ...], ...]  #: names of the causes of each
    measurements: tuple[Measurement, ...]  #: of each kind the best, by expected information per hour
    inseparable: tuple[tuple[int, int], ...]  #: hypotheses that no measurement considered separates
    open: float = 0.0  #: number of equally probable hypotheses with the same entropy [-]


class Misfit(PlainValue):
    """Significant residuals of the best hypothesis."""

    causes: tuple[str, ...]  #: names of the causes of the hypothesis
    frequency: tuple[float, float] | None  #: of a mode in the reference [Hz], and its distance in standard deviations
    shape: tuple[float, float, str] | None  #: frequency of the mode [Hz], MAC and channel with the largest residual
    #: largest relative error of the model's frequencies by a coarse mesh, and how many elements for one give that
    #: of a good model; None if the mesh is not coarse
    mesh: tuple[float, int] | None = None
    #: largest relative difference of the calibrated model's frequencies from the baseline's; None if as of a good model
    model: float | None = None
    of_matrices: bool = False  #: whether the model is of external matrices


#: what is to be measured next; of an explanation that nothing is to be separated from, the advice of its causes
NextMeasurement = Separation | Misfit | Situation | tuple[str, ...]


class Failed(PlainValue):
    """One cause, several together, or another part of the answer, left out because of an internal fault."""

    part: str
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


class MassShift(PlainValue):
    """Shift of a frequency by a known mass, as measured, and as predicted with the causes."""

    frequency: float  #: measured without the mass [Hz]
    measured_percent: float
    std_percent: float  #: standard deviation of the difference: noise, and errors of the model
    predicted_percent: float


class MassTestFit(PlainValue):
    """A further record with a known mass, compared with its prediction with the causes."""

    mass: float  #: [kg]
    position: Vector  #: [m]
    modes: tuple[MassShift, ...]
    p_value: float  #: probability of equal or larger differences if the causes are right [-]
    left_out: bool = False  #: whether the causes were sought without it, as no cause explains it with the other records


class Gain(PlainValue):
    """Errors of the same model without and with the causes; on held-out data if `heldout` is true."""

    heldout: bool
    frequency_error_percent: Pair  #: root mean square over the measured modes that the written model has
    one_minus_mac: Pair  #: mean over these modes
    log_likelihood: Pair
    change_error_percent: Pair | None = None  #: root mean square error of predicted changes since the baseline
    n_modes: int = 0  #: number of measured modes that the written model has
    n_measured: int = 0  #: number of measured modes
    noise_percent: float | None = None  #: frequency error caused by the noise of the measurement alone
    exceeds_noise: bool = False  #: true if the error of the written model is larger than noise explains


class ReferenceStep(PlainValue):
    """Windows of the reference logs that are left out because the structure was in another state."""

    start: int  #: start of the first of them [ns UTC]
    end: int  #: end of the last one [ns UTC]
    n_windows: int  #: number of windows left out
    of_windows: int  #: number of windows of the reference logs
    frequency: tuple[float, ...]  #: frequency of each mode measured in both states [Hz]
    shift_percent: tuple[float, ...]  #: shift of these modes relative to the windows that are used [%]
    shift_std_percent: tuple[float, ...]  #: [%]
    p_value: float  #: probability of an equal or clearer step without a change [-]


class PairedModes(PlainValue):
    """Numbers of measured modes that have a partner in the model, as filed and as calibrated."""

    before: int
    after: int


class CalibrationSummary(PlainValue):
    """Calibration of the model to the reference or to the measured modes, before causes are sought."""

    modes_measured: int
    modes_paired: PairedModes
    frequency_error_percent: Pair  #: root mean square over the modes that are paired afterwards
    #: moduli of metals that were fitted farther from the file than metals differ: the file has other errors
    unusual_moduli: tuple[ParameterChange, ...] = ()
    fits_reference: bool = True  #: false if this error is that of a model of another structure: no change is explained
