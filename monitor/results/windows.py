"""Results of the monitoring loop as they are logged: plain values, read back to the last digit."""

import json
import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from daq import Event
from monitor.detection import DetectorName
from monitor.detection.alarm import Kind, State
from monitor.results.comparison import ChannelHealth, DiagnosisAnswer, DiscrepancyResult
from updater.quantities import Vector

Phase = Literal["learning", "watching", "alarm"]
ModalQuantity = Literal["frequency", "damping", "shape"]


def _number(value: object) -> object:
    """Convert null to not-a-number: a log has null for values that are not finite."""
    return math.nan if value is None else value


Number = Annotated[float, BeforeValidator(_number)]

TOPIC_WINDOW = "/result/window"
TOPIC_REFERENCE = "/result/reference"
TOPIC_ALARM = "/result/alarm"
TOPIC_SELF_TEST = "/result/self_test"


class _Result(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="null")

    def payload(self) -> dict[str, Any]:
        """Return JSON values; values that are not finite become null, so that any reader of JSON accepts them."""
        values: dict[str, Any] = json.loads(self.model_dump_json())
        return values


class ModeResult(_Result):
    """One tracked mode in one window."""

    id: int  #: identity, counted from 1 in the baseline's order of frequency
    frequency: float  #: [Hz]
    frequency_std: Number  #: [Hz]
    damping: Number  #: [-]
    damping_std: Number  #: [-]
    shift_percent: float | None = None  #: shift of frequency relative to the baseline [%]
    shift_std_percent: float | None = None  #: its standard deviation, including that of the baseline [%]
    shape: list[float]  #: real part at each channel, unit norm [-]


class DetectorFigure(_Result):
    """Result of one detector for a window."""

    detector: DetectorName
    value: Number  #: squared distance from the prediction of the law, divided by the number of modes [-]
    limit: Number  #: limit that `value` exceeds by chance at the rate `false_alarms_per_year` [-]
    false_alarms_per_year: float  #: share of this detector in the stated rate


class Unsure(_Result):
    """Result of a window for which the temperature law is uncertain, as outside the temperatures of the baseline."""

    least_percent: float  #: smallest common change of all frequencies that would have been a jump [%]
    temperature: Number  #: temperature of the window [degC]
    coldest: Number  #: lowest temperature of the baseline's windows [degC]
    warmest: Number  #: highest temperature of the baseline's windows [degC]
    #: time since the last temperature reading, if there was one and the window has none [h]
    silent_hours: float | None = None

    @property
    def outside(self) -> bool:
        """Return whether the temperature is outside the range of the baseline."""
        return self.temperature < self.coldest or self.temperature > self.warmest


class SingleMode(_Result):
    """Mode that alone exceeds a limit, as also a wrong pole does for some windows."""

    mode: int  #: identity
    windows: int  #: consecutive windows so far
    needed: int  #: number of windows from which on it counts as a change


class ModeTrend(_Result):
    """Rate of change of one mode's frequency."""

    mode: int  #: identity
    percent_per_year: Number
    std_percent_per_year: Number


class TrendResult(_Result):
    """Slow trend of the frequencies since the baseline, without the effects of temperature and season."""

    weeks: float  #: weeks of data
    percent_per_year: float  #: rate of the mean over all modes
    std_percent_per_year: float
    modes: list[ModeTrend]  #: rates of the modes; not finite for modes with too few weeks


class DetectableChange(_Result):
    """Smallest lasting changes of frequency that reach the limit of a detector, with the present temperature law."""

    alike_percent: Number  #: common change of all modes [%]
    #: change of each mode alone, by identities from 1 on; not finite if not detectable [%]
    modes_percent: list[Number]
    thermometer: bool  #: true if the baseline has temperatures


class Novelty(_Result):
    """Distance of a window from the baseline."""

    t2: Number  #: value of the detector nearest to its limit, or farthest above it [-]
    limit: Number  #: limit of this detector [-]
    modes: list[int]  #: identities of the modes that were used
    detectors: list[DetectorFigure] = []  #: results of all detectors; empty in logs of older versions
    #: set if the uncertainty of the law makes the smallest detectable change at least three times as large
    unsure: Unsure | None = None
    single_mode: SingleMode | None = None  #: set if one mode alone deviates, for too few windows yet
    detectable: DetectableChange | None = None  #: smallest changes detectable in this window
    trend: TrendResult | None = None  #: significant slow trend, unless forgiven; not part of the distance

    @property
    def level(self) -> float:
        """Over the limit [-]; not-a-number where no mode entered."""
        return self.t2 / self.limit if self.modes else math.nan


class Interval(_Result):
    """A stretch of a member."""

    member: str
    start: Vector  #: [m]
    end: Vector  #: [m]


class ProfilePoint(_Result):
    """Posterior along the members."""

    member: str
    position: Vector  #: [m]
    density: float  #: probability per metre [1/m]
    mass: float  #: best mass at this place [kg]


class OtherPlace(_Result):
    """Another possible place of the mass."""

    member: str
    position: Vector  #: position on the member's axis [m]
    position_std: Number  #: standard deviation along the member [m]
    mass: float  #: mass at this place [kg]
    mass_std: Number  #: [kg]
    probability: float  #: probability of the place [-]
    joint: str = ""  #: name of the joint or foot that the place is, where members meet; empty on one member


class MassAnswer(_Result):
    """Place and size of an added mass, from all windows since the change."""

    member: str
    position: Vector  #: position on the member's axis [m]
    position_std: Number  #: standard deviation along the member [m]
    mass: float  #: [kg]
    mass_std: Number  #: [kg]
    region: list[Interval]  #: 95 % credible region
    member_probability: float  #: probability that it is on this member, or at `joint` [-]
    p_value: Number  #: probability of a worse fit if a mass is the cause [-]
    n_windows: int  #: number of windows used
    profile: list[ProfilePoint]
    outlook: str = ""  #: accuracy with more windows, and its limit
    others: list[OtherPlace] = []  #: other possible places, such as the mirror image on a symmetric frame
    joint: str = ""  #: name of the joint or foot that the place is, where members meet; empty on one member


class FlaggedDof(_Result):
    """Node and direction with a significant mass increment."""

    node: int  #: index into `ReferenceResult.nodes`
    direction: Literal["x", "y", "z"]
    z: float  #: normalised increment over its standard deviation [-]


class IncrementPlace(_Result):
    """Position of one point mass that explains the increments of all nodes best."""

    located: bool  #: true if one mass fits and its 95 % region is short; otherwise no place is stated
    fits: bool  #: true if one mass explains the increments
    member: str
    position: Vector  #: [m]
    radius: float  #: distance to the farthest end of the region [m]
    region: list[Interval]  #: 95 % confidence region
    mass: float  #: order of magnitude of the mass [kg]
    p_value: float  #: probability of a worse fit if one mass is the cause [-]


class MassIncrements(_Result):
    """Nodal mass increments of the one-step update (the paper's eqs 3 to 14)."""

    place: IncrementPlace | None = None  #: None if nothing is flagged
    increment: list[Vector]  #: (n_nodes,) by direction, diag(M_u) - diag(M) [kg]
    increment_std: list[Vector]  #: [kg]
    normalised: list[tuple[float | None, float | None, float | None]]  #: eq. 14 [kg]; None where it is undetermined
    normalised_std: list[tuple[float | None, float | None, float | None]]  #: [kg]
    totals: Vector  #: sums of the normalised increments: of the order of the mass, not an estimate of it [kg]
    totals_std: Vector  #: [kg]
    z_limit: float  #: largest |z| of all nodes that one in 100 undisturbed windows exceeds (family-wise 1 %) [-]
    flagged: list[FlaggedDof]  #: sorted by the distance from the place
    n_windows: int  #: number of windows used


class ModeChange(_Result):
    """Change of one measured mode since the baseline."""

    id: int  #: identity
    frequency: float  #: frequency of the baseline [Hz]
    shift_percent: Number  #: shift of the frequency relative to the expected one at the temperature of the windows [%]
    shift_std_percent: Number  #: its standard deviation, including that of the baseline [%]
    damping: Number  #: damping of the baseline [-]
    damping_shift: Number  #: damping minus that of the baseline [-]
    damping_shift_std: Number  #: [-]
    mac: Number  #: MAC of the shape with that of the baseline [-]
    changed: list[ModalQuantity]  #: significant changes; all modes together have one by chance in 1 of 100 cases


class ModalChange(_Result):
    """Change of the measured modes since the baseline, at a site without a structure file."""

    modes: list[ModeChange]
    n_windows: int  #: number of windows used


class Spectrum(_Result):
    """Singular values of the spectral matrix, and the stabilisation diagram's poles."""

    frequency: list[float]  #: (n,) [Hz]
    singular_values: list[list[float]]  #: (k, n) [dB re (m/s2)2/Hz]
    pole_frequency: list[float]  #: [Hz]
    pole_order: list[int]
    pole_stable: list[bool]


class LearningProgress(_Result):
    """Progress of the baseline that is being learned."""

    windows: int  #: usable windows so far, this one included
    target: int  #: number of windows from which the baseline is learned; it is increased if they are too few


class WindowResult(_Result):
    """One analysed window."""

    index: int  #: counted from 0
    start: int  #: [ns UTC]
    end: int  #: [ns UTC]
    phase: Phase
    channels: list[str]  #: channels of the shapes
    faults: dict[str, str] = {}  #: channels left out, with the reason
    modes: list[ModeResult]
    novelty: Novelty | None = None
    answer: MassAnswer | None = None
    increments: MassIncrements | None = None
    diagnosis: DiagnosisAnswer | None = None  #: diagnosis since the baseline
    change: ModalChange | None = None  #: change of the modes, at a site without a structure file
    discrepancy: DiscrepancyResult | None = None  #: basis of the diagnosis
    spectrum: Spectrum | None = None
    sensors: dict[str, ChannelHealth] = {}  #: state of the channels, at intervals, over the windows since the last one
    rms: dict[str, float] = {}  #: rms of each channel [m/s2]
    problem: str | None = None  #: reason why no modes were identified
    learning: LearningProgress | None = None  #: progress at a usable window, until the baseline is learned
    skipped: bool = False  #: true if left out because the analysis was behind; a replay leaves it out too


class ReferenceMode(_Result):
    """A mode of the reference; without a structure file, a mode of the measured baseline."""

    id: int
    frequency: float  #: [Hz]
    frequency_std: Number  #: deviation of the baseline mean [Hz]
    damping: Number  #: [-]
    model_frequency: Number = math.nan  #: frequency of the structure file before calibration [Hz]; null without one
    mac: Number = math.nan  #: MAC of the measured shape with that of the model before the update [-]; null without one
    displacement: list[Vector] = []  #: displacement of each node, largest 1 [-]
    rotation: list[Vector] = []  #: rotation of each node in the same scale [rad/m]; none in older logs
    shape: list[float] = []  #: measured shape at each of `channels`, without a structure file; or none [-]


class AcceptedShift(_Result):
    """A change of the structure that a person accepted, with the shifts of the frequencies."""

    time: int  #: time at which it became the reference [ns UTC]
    raised: int  #: time of the alarm [ns UTC]
    cause: str  #: cause as stated by the person
    by: str
    found: str  #: text of the diagnosis
    n_windows: int  #: number of windows of the new reference
    #: shift of each mode's frequency; None for a hidden mode, which is not monitored [%]
    shift_percent: list[float | None]
    shift_std_percent: list[float | None]  #: standard deviation of each shift [%]


class ReferenceResult(_Result):
    """The reference learned from the baseline, with the geometry to draw it, if there are positions of the sensors."""

    time: int  #: [ns UTC]
    n_windows: int
    nodes: list[Vector]  #: [m]
    lines: dict[str, list[int]]  #: member -> its nodes in order; lines between sensors without a structure file
    sensors: dict[str, tuple[Vector, Vector]]  #: channel -> place [m], direction
    modes: list[ReferenceMode]
    calibrated: dict[str, tuple[float, float]]  #: parameter -> value, standard deviation
    delays: dict[str, tuple[float, float]] = {}  #: device -> constant delay against their mean, standard deviation [s]
    delay_wander: float = 0.0  #: standard deviation of a window's delays about the constants [s]
    accepted: list[AcceptedShift] = []  #: accepted changes since the baseline, in order
    channels: list[str] = []  #: channels of the measured shapes, without a structure file

    @property
    def has_model(self) -> bool:
        """Return whether there is a structure: geometry, and modes of a model at its nodes."""
        return bool(self.lines) and not self.channels

    @property
    def has_geometry(self) -> bool:
        """Return whether there is something to draw: a structure, or positions of sensors."""
        return bool(self.lines)

    @property
    def has_shapes(self) -> bool:
        """Return whether there are mode shapes, of the model or at the channels."""
        return self.has_model or bool(self.channels)

    @property
    def late(self) -> dict[str, float]:
        """Time by which each device's scans were taken earlier than their arrivals indicate [s]."""
        return {device: delay for device, (delay, _) in self.delays.items()}


class SelfTestResult(_Result):
    """Self-test: a simulated mass is added to copies of the newest windows, at random places."""

    time: int  #: [ns UTC]
    mass: float  #: [kg]
    places: int  #: number of places tried
    detected: int  #: number of places at which the alarm would have been raised within six windows
    passed: bool  #: true if these are at least half of the places
    last_passed: int | None  #: time of the last test that passed, including this one [ns UTC]

    @property
    def probability(self) -> float:
        """Of detection [-]."""
        return self.detected / self.places

    @property
    def text(self) -> str:
        """Return a text of one line."""
        outcome = "passed" if self.passed else "FAILED"
        seen = f"{self.detected} of {self.places} places"
        return f"self-test {outcome}: {1000 * self.mass:.0f} g would raise the alarm at {seen}"


class AlarmResult(_Result):
    """A change of the alarm."""

    time: int  #: end of the window that caused it, or when a person acknowledged it [ns UTC]
    state: State  #: new state
    text: str
    window: Annotated[int, Field(ge=0)]  #: last window analysed by then
    kind: Kind = "state"  #: further event
    lasted: float | None = None  #: duration of an alarm that ends [s]
    quiet: bool = False  #: true if no notice is needed: the alarm flaps, or continues
    since: int | None = None  #: time at which an alarm that continues over a restart was raised [ns UTC]

    @property
    def raised(self) -> bool:
        """Return whether this is the beginning of an alarm."""
        return self.state == "alarm" and self.kind == "state"


Result = WindowResult | ReferenceResult | AlarmResult | SelfTestResult  #: results of the analysis


_TYPES: dict[str, type[Result]] = {
    TOPIC_WINDOW: WindowResult,
    TOPIC_REFERENCE: ReferenceResult,
    TOPIC_ALARM: AlarmResult,
    TOPIC_SELF_TEST: SelfTestResult,
}


def result_event(result: Result) -> Event:
    """Return a result as an event of the log."""
    time_ns = result.end if isinstance(result, WindowResult) else result.time
    topic = next(topic for topic, kind in _TYPES.items() if isinstance(result, kind))
    return Event(topic=topic, time=time_ns, payload=result.payload())


def is_result(event: Event) -> bool:
    """Return whether an event of the log is a result."""
    return event.topic in _TYPES


def event_result(event: Event) -> Result | None:
    """Return the result in an event of the log, None if there is none."""
    kind = _TYPES.get(event.topic)
    return kind.model_validate(event.payload) if kind else None
