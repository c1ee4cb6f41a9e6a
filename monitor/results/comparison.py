"""Diagnosis, and comparison of measured and simulated modes, as plain values: in logs and JSON files."""

from typing import TYPE_CHECKING, Literal

from updater import Cause, Diagnosis, Gain
from updater.diagnosis import ReferenceStep, Separation, Verdict
from updater.quantities import ExchangedSections, PlainValue, Vector

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class RejectedCause(PlainValue):
    """A cause that was tried and rejected."""

    cause: str
    log_evidence: float  #: relative to the best one [-]
    why: str


class CoursePoint(PlainValue):
    """A window of a record within which the structure changed."""

    time: int  #: middle of the window [ns UTC]
    share: float  #: share of the change that it shows: 0 as at the start, 1 as at the end [-]
    std: float  #: standard deviation of `share` [-]


class ChangeRate(PlainValue):
    """Mean rate of a gradual change."""

    cause: str
    parameter: str  #: parameter of the cause, or of the model
    per_hour: float  #: [unit/h]
    std: float  #: [unit/h]
    unit: str


class WithinRecord(PlainValue):
    """Change of the structure within the logs that are diagnosed."""

    kind: Literal["sudden", "gradual"]
    start: int  #: mean time of the windows of the first state [ns UTC]
    end: int  #: mean time of the windows of the last state [ns UTC]
    of_all: bool  #: true if the mean of all windows is diagnosed; otherwise the last state
    verdict: Verdict  #: verdict on the change from the first to the last state
    causes: tuple[Cause, ...]  #: causes of this change
    rates: tuple[ChangeRate, ...]  #: rates of a gradual change
    step: tuple[int, int] | None  #: times between which a sudden change happened [ns UTC]
    course: tuple[CoursePoint, ...]
    p_value: float  #: probability of an equal or clearer change in windows of one state [-]


class FollowUp(PlainValue):
    """Hypotheses left open by an earlier diagnosis and by this one: equally probable ones of the same entropy."""

    before: float  #: by the earlier one [-]
    now: float  #: [-]
    expected: float | None  #: by the advice of the earlier one; None where it did not advise this measurement [-]


class DiagnosisAnswer(Diagnosis):
    """The whole JSON of a diagnosis."""

    rejected: tuple[RejectedCause, ...]
    next_measurement: str
    separation: Separation | None = None  #: the measurements that would decide; None unless causes are left open
    follows: FollowUp | None = None  #: an earlier diagnosis, whose advice was followed
    extended_model: str | None = None  #: path of the structure.toml with the causes written in
    reference_steps: tuple[ReferenceStep, ...] = ()  #: changes of the structure within the reference logs
    within_record: WithinRecord | None = None  #: change of the structure within the logs that are diagnosed
    #: sections that fit far better with width and height exchanged; None if the file is right, or was not tested
    exchanged_sections: ExchangedSections | None = None

    def plot(self) -> "Figure":
        """Draw the errors of the model without and with the causes, and the log evidence [-] of all causes.

        Raises
        ------
        ValueError
            If no mode was compared and no cause weighed.
        """
        from updater.diagnosis import diagnosis_figure  # matplotlib is loaded only for a figure

        return diagnosis_figure(self.causes, self.modes, self.rejected)


class ModeComparison(PlainValue):
    """A mode, measured and simulated; None if one of the two is missing."""

    simulated: float | None  #: frequency without the causes [Hz]
    measured: float | None  #: [Hz]
    off_percent: float | None  #: measured relative to simulated frequency, without the causes [%]
    std_percent: float | None  #: standard deviation: noise, and expected errors of the model [%]
    mac: float | None  #: [-]
    off_percent_after: float | None = None  #: the same with the causes [%]
    mac_after: float | None = None  #: [-]
    compared: bool = True  #: true if the diagnosis uses it: the reference has it, and the match is certain


class ChannelHealth(PlainValue):
    """State of a channel relative to the baseline, or to the model, and to the other channels."""

    gain: float  #: negative if the polarity is reversed [-]
    gain_std: float  #: [-]
    delay: float | None = None  #: [s]; None if phases are not known
    delay_std: float | None = None  #: [s]


class SensorComparison(PlainValue):
    """A sensor over all modes; the figures after are those with the causes."""

    channel: str
    comac: float  #: [-]
    residual: float  #: residual relative to the shapes' typical component [-]
    noise: float  #: residual of noise alone [-]
    comac_after: float | None = None
    residual_after: float | None = None
    missed: float | None = None  #: error of the prediction from the other sensors, relative to the signal [-]
    missed_after: float | None = None
    missed_least: float | None = None  #: smallest error of a linear prediction [-]
    health: ChannelHealth | None = None


class BalanceResult(PlainValue):
    """Model error at each node from residual forces, in the order of the reference; None where nothing is known."""

    loss: tuple[float | None, ...]  #: excess stiffness of the model, relative to its stiffness [-]
    loss_std: tuple[float | None, ...]
    added: tuple[float | None, ...]  #: missing mass of the model, relative to its mass [-]
    added_std: tuple[float | None, ...]
    log_odds: float  #: log evidence of errors of mass minus that of errors of stiffness [-]


class SignalComparison(PlainValue):
    """A sensor's signal about the resonances, measured and predicted from the others by the model with the causes."""

    channel: str
    start: float  #: time of the samples from the start of the log's window [s]
    step: float  #: interval of the samples [s]
    measured: tuple[float, ...]  #: [m/s2]
    predicted: tuple[float, ...]  #: [m/s2]
    frequency: tuple[float | None, ...]  #: frequencies of the spectra, None between resonances [Hz]
    spectrum: tuple[float | None, ...]  #: spectrum of the measurement [(m/s2)^2/Hz]
    missed: tuple[float | None, ...]  #: spectrum of the prediction error without the causes [(m/s2)^2/Hz]
    missed_after: tuple[float | None, ...]  #: the same with the causes; without them if there are none


class FrequencyTrend(PlainValue):
    """Frequency of a mode per window, as a linear function of another quantity."""

    mode: float  #: mean frequency [Hz]
    over: str  #: temperature or amplitude
    unit: str
    at: tuple[float, ...]  #: value of each window [unit]
    change_percent: tuple[float, ...]  #: change from the mean [%]
    std_percent: tuple[float, ...]
    slope: float  #: [%/unit]
    slope_std: float


class PlaceDensity(PlainValue):
    """Probability of a cause along the structure."""

    cause: str
    member: tuple[str, ...]  #: member of each place
    position: tuple[Vector, ...]  #: [m]
    density: tuple[float, ...]  #: [1/m]


class DiscrepancyResult(PlainValue):
    """Comparison of measured and simulated modes, sensors and signals."""

    modes: tuple[ModeComparison, ...]  #: pairs and unpaired simulated modes, then unpaired measured ones
    rows: tuple[float, ...]  #: simulated frequencies of the MAC's rows [Hz]
    columns: tuple[float, ...]  #: measured frequencies of its columns [Hz]
    mac: tuple[tuple[float | None, ...], ...]  #: empty where no shapes were measured
    sensors: tuple[SensorComparison, ...]
    balance: BalanceResult | None = None
    signals: tuple[SignalComparison, ...] = ()
    trends: tuple[FrequencyTrend, ...] = ()
    places: tuple[PlaceDensity, ...] = ()
    gain_std: Gain | None = None  #: standard deviations of the gain, if it is significant
    note: str = ""  #: reason why a part is missing
    measured_before: bool = False  #: true if `simulated` are the modes of the reference logs

    @property
    def listed(self) -> tuple[ModeComparison, ...]:
        """Modes that were measured, before or now, or are used for the answer."""
        return tuple(mode for mode in self.modes if mode.measured is not None or mode.compared)
