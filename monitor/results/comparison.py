"""Comparison of measured and simulated modes as plain values: in logs and in discrepancy.json."""

from pydantic import BaseModel, ConfigDict

from updater import Gain

Vector = tuple[float, float, float]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="null")


class ModeComparison(_Part):
    """A mode, measured and simulated; None if one of the two is missing."""

    simulated: float | None  #: frequency without the causes [Hz]
    measured: float | None  #: [Hz]
    off_percent: float | None  #: measured against simulated, without the causes [%]
    std_percent: float | None  #: standard deviation of it: noise, and what the model is not expected to know [%]
    mac: float | None  #: [-]
    off_percent_after: float | None = None  #: with the causes [%]
    mac_after: float | None = None  #: [-]
    compared: bool = True  #: whether causes are sought with it: the reference has it, and it is surely the same mode


class ChannelHealth(_Part):
    """State of a channel relative to the baseline, or to the model, and to the other channels."""

    gain: float  #: negative where its polarity is turned [-]
    gain_std: float  #: [-]
    delay: float | None = None  #: [s]; None where phases are not known
    delay_std: float | None = None  #: [s]


class SensorComparison(_Part):
    """A sensor over all modes; the figures after are those with the causes."""

    channel: str
    comac: float  #: [-]
    residual: float  #: of the shapes' typical component [-]
    noise: float  #: what noise alone would leave of the residual [-]
    comac_after: float | None = None
    residual_after: float | None = None
    missed: float | None = None  #: by the prediction from the other sensors, over the signal [-]
    missed_after: float | None = None
    missed_least: float | None = None  #: by the best linear prediction that there is [-]
    health: ChannelHealth | None = None


class BalanceResult(_Part):
    """Model error at each node from residual forces, in the order of the reference; None where nothing is known."""

    loss: tuple[float | None, ...]  #: stiffness that the model has too much, over its own [-]
    loss_std: tuple[float | None, ...]
    added: tuple[float | None, ...]  #: mass that the model lacks, over its own [-]
    added_std: tuple[float | None, ...]
    log_odds: float  #: log evidence of errors of mass over that of errors of stiffness [-]


class SignalComparison(_Part):
    """A sensor's signal about the resonances, measured and predicted from the others by the model with the causes."""

    channel: str
    start: float  #: of the samples, from the log's window [s]
    step: float  #: between samples [s]
    measured: tuple[float, ...]  #: [m/s2]
    predicted: tuple[float, ...]  #: [m/s2]
    frequency: tuple[float | None, ...]  #: of the spectra, None between resonances [Hz]
    spectrum: tuple[float | None, ...]  #: of what was measured [(m/s2)^2/Hz]
    missed: tuple[float | None, ...]  #: of what the prediction without the causes misses [(m/s2)^2/Hz]
    missed_after: tuple[float | None, ...]  #: with the causes; as without them where there are none


class FrequencyTrend(_Part):
    """A mode's frequency over what goes with it, window by window, with a straight line through it."""

    mode: float  #: mean frequency [Hz]
    over: str  #: temperature or amplitude
    unit: str
    at: tuple[float, ...]  #: of each window [unit]
    change_percent: tuple[float, ...]  #: from the mean [%]
    std_percent: tuple[float, ...]
    slope: float  #: [%/unit]
    slope_std: float


class PlaceDensity(_Part):
    """Probability of a cause along the structure."""

    cause: str
    member: tuple[str, ...]  #: of each place
    position: tuple[Vector, ...]  #: [m]
    density: tuple[float, ...]  #: [1/m]


class DiscrepancyResult(_Part):
    """All of it."""

    modes: tuple[ModeComparison, ...]  #: pairs and what was simulated only, then what was measured only
    rows: tuple[float, ...]  #: simulated frequencies of the MAC's rows [Hz]
    columns: tuple[float, ...]  #: measured frequencies of its columns [Hz]
    mac: tuple[tuple[float | None, ...], ...]  #: empty where no shapes were measured
    sensors: tuple[SensorComparison, ...]
    balance: BalanceResult | None = None
    signals: tuple[SignalComparison, ...] = ()
    trends: tuple[FrequencyTrend, ...] = ()
    places: tuple[PlaceDensity, ...] = ()
    gain_std: Gain | None = None  #: standard deviations of what the causes gain, where that is more than chance
    note: str = ""  #: why a part is missing
