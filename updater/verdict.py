"""The answer of a diagnosis, as other programs read it (docs/updater.md, `modalwatch diagnose --json`)."""

from typing import Literal

from pydantic import BaseModel, ConfigDict

from daq import FloatArray

Vector = tuple[float, float, float]
Verdict = Literal["nothing_to_explain", "explained", "ambiguous", "unexplained"]


SIGNIFICANT = 2.0  #: standard deviations by which a reported parameter differs from its value before, at least


def vector(values: FloatArray) -> Vector:
    """Return three plain numbers."""
    x, y, z = (float(v) for v in values)
    return x, y, z


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="null")


class Quantity(_Part):
    """An estimated parameter of a cause."""

    value: float
    std: float
    unit: str


class Where(_Part):
    """Place of a cause on the structure, or the channels of one that sits in the measuring chain."""

    member: str | None = None
    position: Vector | None = None  #: on the member's axis [m]
    position_std: float | None = None  #: along the member [m]
    region: tuple[tuple[Vector, Vector], ...] = ()  #: 95 %, from and to [m]
    channels: tuple[str, ...] = ()


class ParameterChange(_Part):
    """A parameter of the model that a cause changes, in the units of engineers."""

    name: str  #: as `modalwatch structure --parameters` lists it, such as `steel.E` or `support 0.ry`
    quantity: str  #: such as `Young's modulus` or `rotational stiffness about y`
    of: str  #: material, support or joint that it belongs to
    position: Vector | None  #: of the support, the joint or the weld [m]
    unit: str  #: Pa, N m/rad, N/m, or - for a factor of stiffness
    before: float | None  #: None for a connection that was rigid
    after: float
    std: float  #: of `after`

    @property
    def significant(self) -> bool:
        """True if it differs from `before` by more than two standard deviations.

        The deviation of a connection's flexibility, which is 0 where it is rigid, is relatively that of its stiffness.
        """
        if self.before is None:
            return self.after > SIGNIFICANT * self.std
        return abs(self.after - self.before) > SIGNIFICANT * self.std


class Cause(_Part):
    """One accepted cause."""

    cause: str
    probability: float
    where: Where | None  #: None for a cause that has no place
    parameters: dict[str, Quantity]
    cannot_be_told_from: tuple[str, ...] = ()
    changes: tuple[ParameterChange, ...] = ()  #: of the model's own parameters, for causes that are made of them


class Rejected(_Part):
    """One cause that was tried and refused."""

    cause: str
    log_evidence: float  #: against the best one [-]
    why: str


class Failed(_Part):
    """One cause, several together, or another part of the answer, left out because of an internal fault."""

    part: str
    error: str  #: type and message of the fault


class FrequencyFit(_Part):
    """A frequency as measured, and as predicted without and with the causes [Hz]."""

    measured: float | None
    std: float | None
    before: float | None
    after: float | None


class Pair(_Part):
    """A figure without and with the causes."""

    before: float | None
    after: float | None


class ModeFit(_Part):
    """One mode, without and with the causes."""

    frequency: FrequencyFit
    mac: Pair


class Gain(_Part):
    """The gain of the written model over the same model without the causes, on data that were not used if `heldout`."""

    heldout: bool
    frequency_error_percent: Pair  #: root mean square over the modes measured that the written model has
    one_minus_mac: Pair  #: mean
    log_likelihood: Pair
    change_error_percent: Pair | None = None  #: root mean square of what changes since the baseline are mispredicted by
    n_modes: int = 0  #: measured modes that the written model has
    n_measured: int = 0  #: all that were measured
    noise_percent: float | None = None  #: frequency error that measurement noise alone would leave
    exceeds_noise: bool = False  #: whether what the written model leaves is more than that


class ReferenceStep(_Part):
    """Windows of the reference logs that are left out because the structure was in another state."""

    start: int  #: of the first of them [ns UTC]
    end: int  #: of the last one [ns UTC]
    n_windows: int  #: that are left out
    of_windows: int  #: that the reference logs have
    frequency: tuple[float, ...]  #: of each mode seen on both sides [Hz]
    shift_percent: tuple[float, ...]  #: of these modes, against the windows that are used [%]
    shift_std_percent: tuple[float, ...]  #: [%]
    p_value: float  #: probability of as clear a step in windows of one state [-]


class PairedModes(_Part):
    """Numbers of measured modes that have a partner in the model, as filed and as calibrated."""

    before: int
    after: int


class CalibrationSummary(_Part):
    """Calibration of the model that causes are sought about, to the reference or to the measured modes."""

    modes_measured: int
    modes_paired: PairedModes
    frequency_error_percent: Pair  #: root mean square over the modes that are paired afterwards


class Diagnosis(_Part):
    """Errors of the simulation, or changes of the structure."""

    verdict: Verdict
    causes: tuple[Cause, ...]
    rejected: tuple[Rejected, ...]
    modes: tuple[ModeFit, ...]
    gain: Gain | None
    extended_model: str | None = None  #: path of the structure.toml with the causes written in
    calibration: CalibrationSummary | None = None  #: None where the structure file was taken as it is
    next_measurement: str
    failed: tuple[Failed, ...] = ()  #: what internal faults left out
    reference_steps: tuple[ReferenceStep, ...] = ()  #: changes of the structure within the reference logs
