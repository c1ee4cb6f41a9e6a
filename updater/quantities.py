"""Quantities, places and parameters as plain values, in the units of engineers."""

import math
from typing import Literal

from pydantic import BaseModel, ConfigDict

from daq import FloatArray

Vector = tuple[float, float, float]
#: side of a moment, or of it on both sides of zero; or with dry friction, beyond a moment from where it was left
Opens = Literal["above", "below", "within", "beyond", "slips"]
#: on one side of a moment; within a moment on both sides of zero, as play; beyond it
Law = Literal["one_side", "within", "beyond"]


ECCENTRIC = 3.0  #: standard deviations from which the offset of a body from its member's axis is reported
SIGNIFICANT = 2.0  #: standard deviations by which a reported parameter differs from its value before, at least
ONE_SIDED_95 = 1.645  #: standard deviations of a one-sided bound of 95 %
BREATHES = 1e-3  #: p value below which a place opens and closes
JOINT_ZONE = "stiffness factor"  #: quantities of the zones of a joint begin with it
FREQUENCY_STD = 2e-3  #: error of a beam model in ln f, for any parameters
GAIN_STD = 0.01  #: usual error of the gain of an accelerometer, by data sheets
ASKEW_STD = 0.02  #: rad: usual misalignment of a sensor
PLACE_STD = 3e-3  #: m on a frame of 1.5 m: usual distance of a sensor from its stated place
_NAMES = {
    "sensor_polarity": "sensor sign turned",
    "sensor_swap": "sensors exchanged",
    "sensor_orientation": "sensor direction",
    "sensor_dead": "dead sensor",
    "amplitude_softening": "softening with amplitude",
    "damping_change": "change of damping",
    "support_spring": "additional support",
}  # others are their own words


def vector(values: FloatArray) -> Vector:
    """Return three plain numbers."""
    x, y, z = (float(v) for v in values)
    return x, y, z


def rounded_value(value: float, std: float) -> float:
    """Return a value to the second digit of its deviation, and to three digits of its own at least."""
    if value == 0 or not (math.isfinite(std) and std > 0):
        return value
    return round(value, max(1 - math.floor(math.log10(std)), 2 - math.floor(math.log10(abs(value)))))


def plain(name: str) -> str:
    """Return a name of a cause or parameter as words."""
    return _NAMES.get(name, name.replace("_", " "))


def cause_name(words: str) -> str:
    """Return the name of a cause from its words, as `plain` returns them; a name is returned as it is."""
    return next((name for name, text in _NAMES.items() if text == words), words.replace(" ", "_"))


class PlainValue(BaseModel):
    """Base model of values that are written to files and logs: frozen, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="null")


class Quantity(PlainValue):
    """An estimated parameter of a cause."""

    value: float
    std: float
    unit: str


class Where(PlainValue):
    """Position of a cause on the structure, or the channels of a sensor fault."""

    member: str | None = None
    position: Vector | None = None  #: position on the member's axis [m]
    position_std: float | None = None  #: standard deviation along the member [m]
    region: tuple[tuple[Vector, Vector], ...] = ()  #: 95 % credible region: start and end of each stretch [m]
    channels: tuple[str, ...] = ()
    name: str = ""  #: name of the place, such as `foot of the right post`; empty if it has none


def check_opening(opens: Opens, moment: float) -> None:
    """Raise ValueError for a place that opens, or slips, on both sides of zero alike, but not of a positive moment."""
    if opens in ("within", "beyond", "slips") and not moment > 0:
        raise ValueError(f"expected a moment > 0 with opens = {opens}, found {moment:g}")


class ExchangedSections(PlainValue):
    """Members whose sections fit measured frequencies far better with width and height exchanged."""

    members: tuple[str, ...]
    paired: int  #: number of measured modes that have a partner in the calibrated model of the file
    paired_exchanged: int  #: the same with the exchange
    error_percent: float | None  #: root mean square of their frequency errors; None if too few are paired
    error_percent_exchanged: float


class Opening(PlainValue):
    """Member, axis and moments of a place that opens and closes; flexibilities over 1 / (E I) or 1 / (G J)."""

    member: str  #: member whose moment opens it
    position: Vector  #: [m]
    axis: Literal["x", "y", "z"]  #: local axis of the member that the moment acts about; x: torque
    flexibility: Quantity  #: rotation per moment while it is open [m]
    closed: Quantity  #: the same while it is closed [m]
    mean: Quantity  #: mean over time, which the modes show [m]
    moment: Quantity  #: moment at which it opens [N m]
    opens: Opens  #: side of that moment on which it is open


class NonlinearGain(PlainValue):
    """Prediction of the nonlinear part of signals that were not used; the linear model predicts none of it."""

    log_likelihood: Quantity  #: gain over the linear model [-]


class Breathing(PlainValue):
    """Closing of a crack or a connection that is softer under some moments than under others."""

    #: share of the mean added flexibility that is absent while the crack is closed; if it does not open and close, by
    #: the law with the larger bound [-]
    share: Quantity
    open_time: Quantity | None  #: share of the time in which it is open; None if it does not open and close [-]
    p_value: float  #: probability of an equal or larger nonlinear part of a linear structure
    law: Law | None = None  #: moments under which it is open; None if it does not open and close
    opening: Opening | None = None  #: None if it does not open and close, or not under one moment of a member
    heldout: NonlinearGain | None = None  #: None without held-out signals

    @property
    def significant(self) -> bool:
        """True if it opens and closes."""
        return self.p_value < BREATHES

    @property
    def upper_share(self) -> float:
        """One-sided bound of 95 % of the share [-]."""
        return self.share.value + ONE_SIDED_95 * self.share.std


class ParameterChange(PlainValue):
    """A parameter of the model that a cause changes, in the units of engineers."""

    name: str  #: name as listed by `modalwatch structure --parameters`, such as `steel.E` or `support 0.ry`
    quantity: str  #: such as `Young's modulus` or `rotational stiffness about y`
    of: str  #: material, support, joint, section or body that it belongs to
    position: Vector | None  #: position of the support, the joint, the weld or the body [m]
    unit: str  #: Pa, N m/rad, N/m, kg, or - for a factor
    before: float | None  #: None if the connection was rigid
    after: float
    std: float  #: standard deviation of `after`; 0 at a bound
    before_std: float = 0.0  #: standard deviation of `before`; 0 for a value of the file
    place: str = ""  #: name of the place, such as `foot of the right post`; empty if it has none
    member: str = ""  #: member that a rotational spring holds; empty if not known
    member_stiffness: float | None = None  #: stiffness of this member's end: 4 E I / L, twist G J / L [N m/rad]
    twists: bool = False  #: true if the spring holds this member against twist
    at_bound: bool = False  #: true if `after` is a bound, and the best value without it is beyond

    @property
    def added_flexibility(self) -> tuple[float, float]:
        """Flexibility added to a connection and its standard deviation [rad/(N m) or m/N]: the quantity fitted.

        The deviation of `after` contains that of `before`: flexibilities add, with independent errors.
        """
        before = 0.0 if self.before is None else 1 / self.before
        of_before = self.before_std * before**2
        return 1 / self.after - before, math.sqrt(max((self.std / self.after**2) ** 2 - of_before**2, 0.0))

    @property
    def overlaps(self) -> bool:
        """True if the values before and after agree within two standard deviations of each."""
        if self.before is None:
            return False
        return abs(self.after - self.before) < SIGNIFICANT * (self.before_std + self.std)

    @property
    def relative(self) -> tuple[float, float] | None:
        """Relative change and its standard deviation; None for a connection that was rigid, or a mass that was none."""
        if not self.before or self.after == 0:
            return None
        before, after = 1 / self.before, 1 / self.after
        added, of_added = self.added_flexibility
        std = math.hypot(added * self.before_std * before**2, before * of_added) / after**2
        return self.after / self.before - 1, std

    @property
    def listed(self) -> bool:
        """True if it is listed with its values: significant, or at a bound."""
        return self.significant or self.at_bound

    @property
    def written(self) -> bool:
        """True if the written file differs from the one given: by a spring, or by digits that are known."""
        return self.before is None or rounded_value(self.after, self.std) != self.before

    @property
    def significant(self) -> bool:
        """True if it differs from `before` by more than two standard deviations; not at a bound.

        The deviation of a connection's flexibility, which is 0 where it is rigid, is relatively that of its stiffness.
        """
        return not self.at_bound and self.deviations > SIGNIFICANT

    @property
    def deviations(self) -> float:
        """Difference from `before` in standard deviations, at least 0; infinite without a deviation.

        Of the zone of a joint it is that of the flexibility, of which a stiff zone has nearly none.
        """
        off = self.after if self.before is None else abs(self.after - self.before)
        if self.before is not None and self.quantity.startswith(JOINT_ZONE):  # as good as rigid, if not as known
            off *= self.after / self.before
        if self.std > 0:
            return max(off / self.std, 0.0)
        return math.inf if off > 0 else 0.0
