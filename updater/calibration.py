"""Physical parameters of the structure fitted to the baseline's frequencies, before the one-step update.

By the iterative sensitivity method: Young's modulus of each material (with its shear modulus), rotational flexibility
of each support and of each joint, and how much stiffer than their axes members are where they meet. Density is not
fitted: frequencies alone cannot tell it from stiffness.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from scipy import sparse

from daq import FloatArray, IndexArray
from oma import pair_modes
from updater.errors import PairingError
from updater.fe.assembly import build_model
from updater.fe.model import Model
from updater.fe.modes import Modes
from updater.internal_actions import parts_between
from updater.knobs import TURNS, Knob, apply_knobs, bending_stiffness, knobs_of, meetings, welded
from updater.modal_checks import check_baseline, check_unit
from updater.sensitivity import Convergence, Prior, fit_parameters, frequency_slope
from updater.statistics import ModalMean
from updater.structure import Structure

FREQUENCY_ERROR = 2e-3  #: of ln f: what no parameter of a beam model explains
_BEYOND = 4  # modes more than were measured, that sensors should see of the model
_SEEN = 1e-3  # of the largest simulated mode at the sensors: what moves less there is not seen
_MOST_MODES = 120  # of the model
_START = 1e-3  # where it begins
_STEP = 1e-4  # of ln of a weld's stiffness, in the finite difference of an element's matrix


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One fitted quantity."""

    name: str  #: such as `support 0 ry`
    value: float  #: factor of stiffness, c E I / L, or share of flexibility that a weld takes [-]
    std: float
    at_bound: bool  #: that it would leave what is possible if it could


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibration:
    """A structure whose model answers to measured frequencies as well as its parameters can."""

    structure: Structure
    model: Model
    modes: Modes
    tracks: IndexArray  #: (n_tracks,) measured modes that have a partner
    paired: IndexArray  #: (n_tracks,) model mode of each
    nominal_frequency: FloatArray  #: (n_tracks,) before calibration [Hz]
    nominal_mac: FloatArray  #: (n_tracks,) measured against the model before calibration [-]
    parameters: tuple[Parameter, ...]
    reason: Convergence | Literal["nothing was fitted"]  #: why the iteration ended


def calibrate(structure: Structure, measured: ModalMean, *, n_modes: int = 30) -> Calibration:
    """Fit a structure to measured modes at its sensors.

    Parameters
    ----------
    structure : as the file says
    measured : (n_tracks,) modes; channels name sensors of the structure
    n_modes : model modes to keep, at least: more where sensors see few of them

    Raises
    ------
    PairingError
        If fewer than three measured modes have a partner in the model.
    ModalDataError
        If one mode is on two tracks, or the frequencies are not in hertz.
    """
    check_baseline(measured)
    nominal = best_model(structure)
    rows = channel_rows(nominal, measured.channels)
    modes = _enough(nominal, rows, n_modes, len(measured.log_frequency) + _BEYOND)
    seen = (rows @ modes.shape).T
    frequency = np.exp(measured.log_frequency)
    answers = pair_modes(frequency, measured.shape, modes.frequency, seen)
    check_unit(frequency, measured.shape, modes.frequency, seen)
    if (answers >= 0).sum() < 3:
        raise PairingError(
            f"only {(answers >= 0).sum()} of the modes at {np.round(frequency, 2).tolist()} Hz answer to one of "
            f"the model's {np.round(modes.frequency[:12], 2).tolist()} Hz: is it the right structure, are the channels "
            "mapped rightly?"
        )
    tracks = np.flatnonzero(answers >= 0)
    measured = measured.only(tracks)
    paired = answers[tracks]
    knobs = knobs_of(structure)
    fit = fit_parameters(_Misfit(structure, knobs, measured, paired), _prior(knobs))
    fitted = apply_knobs(structure, knobs, fit.value)
    model = best_model(fitted)
    value = [np.exp(x) if k.kind == "stiffness" else x for k, x in zip(knobs, fit.value, strict=True)]
    cross = (measured.shape * seen[paired]).sum(1) ** 2
    return Calibration(
        structure=fitted,
        model=model,
        modes=model.modes(len(modes.frequency)),
        tracks=tracks,
        paired=paired,
        nominal_frequency=modes.frequency[paired],
        nominal_mac=cross / (seen[paired] ** 2).sum(1),
        parameters=tuple(
            Parameter(name=k.name, value=float(v), std=float(s), at_bound=bool(b))
            for k, v, s, b in zip(knobs, value, fit.std, fit.at_bound, strict=True)
        ),
        reason=fit.reason,
    )


def _enough(model: Model, rows: FloatArray, n_modes: int, n_seen: int) -> Modes:
    """Return modes of which sensors see some beyond what was measured: what a change does is made of those.

    Of a plane frame with sensors in its plane most of the first thirty may be across it, or turn it.

    Parameters
    ----------
    rows : (n_channels, n_dofs) that read the sensors
    n_modes : at least
    n_seen : that sensors should see, if the model has as many
    """
    most = int((model.dofs[:, :3] >= 0).sum())
    n_modes = min(n_modes, most)
    while True:
        modes = model.modes(n_modes)
        length = np.linalg.norm(rows @ modes.shape, axis=0)
        if (length > _SEEN * length.max()).sum() >= n_seen or n_modes >= min(most, _MOST_MODES):
            return modes
        n_modes = min(2 * n_modes, most, _MOST_MODES)


def _prior(knobs: list[Knob]) -> Prior:
    lower = np.array([k.lower for k in knobs])
    return Prior(
        mean=np.zeros(len(knobs)),
        std=np.array([k.prior for k in knobs]),
        lower=lower,
        upper=np.array([k.upper for k in knobs]),
        start=np.array([0.0 if k.kind == "stiffness" else _START for k in knobs]),
    )


class _Misfit:
    """Log frequencies of the structure with parameters x over the measured ones."""

    def __init__(self, structure: Structure, knobs: list[Knob], measured: ModalMean, paired: IndexArray) -> None:
        self._structure, self._knobs, self._paired = structure, knobs, paired
        self._meetings = meetings(structure)
        self._goal = measured.log_frequency
        self._tolerance = np.hypot(measured.log_frequency_std, FREQUENCY_ERROR)
        self._solved = lru_cache(1)(self._solve)

    def _solve(self, *x: float) -> tuple[Model, Modes]:
        model = best_model(apply_knobs(self._structure, self._knobs, np.array(x)))
        modes = model.modes(int(self._paired.max()) + 1)
        return model, Modes(frequency=modes.frequency[self._paired], shape=modes.shape[:, self._paired])

    def residual(self, x: FloatArray) -> FloatArray:
        return np.asarray((np.log(self._solved(*x)[1].frequency) - self._goal) / self._tolerance)

    def slope(self, x: FloatArray) -> FloatArray:
        model, modes = self._solved(*x)
        columns = [self._by_knob(model, modes, x, i) for i in range(len(self._knobs))]
        return np.asarray(np.column_stack(columns) / self._tolerance[:, None])

    def _by_knob(self, model: Model, modes: Modes, x: FloatArray, i: int) -> FloatArray:
        knob = self._knobs[i]
        if knob.kind == "stiffness":
            return frequency_slope(modes.omega, modes.shape, self._stiffened(model, x, i) @ modes.shape)
        if knob.kind == "weld":
            return self._by_weld(model, modes, knob, float(x[i]))
        return self._by_spring(model, modes, knob)

    def _stiffened(self, model: Model, x: FloatArray, i: int) -> sparse.csc_array:
        """Return dK / d ln E of a material: its members' part of K, which is proportional to E."""
        doubled = x.copy()
        doubled[i] += np.log(2)
        return sparse.csc_array(
            best_model(apply_knobs(self._structure, self._knobs, doubled)).stiffness - model.stiffness
        )

    def _by_weld(self, model: Model, modes: Modes, knob: Knob, less: float) -> FloatArray:
        """Return d ln omega by the share of flexibility that a weld takes, its elements' part of b^T dK b."""
        gained = np.zeros(len(modes.omega))
        for member, start, end in welded(self._structure, self._meetings[knob.target]):
            for element, local in parts_between(model, modes.shape, member, start, end):
                more, fewer = (replace(element, bending=element.bending * np.exp(h)) for h in (_STEP, -_STEP))
                change = (more.elastic_stiffness() - fewer.elastic_stiffness()) @ local / (2 * _STEP)
                gained += (local * change).sum(0)
        return np.asarray(gained / (2 * modes.omega**2) / (1 - less))

    def _by_spring(self, model: Model, modes: Modes, knob: Knob) -> FloatArray:
        """Return d ln omega / dc, -q^2 / (2 omega^2 E I / L) by the moments q of the modes in the spring."""
        axis = TURNS.index(knob.axis)
        if knob.kind == "support":
            support = model.structure.support[int(knob.target)]
            row, stiffness = model.turn_rows(support.at, axis), support.stiffness[knob.axis]
        else:
            joint = next(j for j in model.structure.joint if j.member == knob.target)
            row, stiffness = (
                model.joint_rows(joint, axis),
                next(v for a, v in joint.stiffness.items() if a == knob.axis),
            )
        moment = stiffness * (row @ modes.shape)
        return np.asarray(-(moment**2) / (2 * modes.omega**2 * bending_stiffness(self._structure)))


def best_model(structure: Structure) -> Model:
    """Timoshenko, consistent mass: a thin-beam model's upper modes are per cents off, which turns into place."""
    return build_model(structure, shear_flexible=True, mass="consistent")


def channel_rows(model: Model, channels: tuple[str, ...], *, across: bool = False) -> FloatArray:
    """Return rows (n_channels, n_dofs) that read the named sensors.

    Parameters
    ----------
    across : read along the two axes across each sensor instead (2 n_channels, n_dofs), first axes first

    Raises
    ------
    PairingError
        If the structure has no sensor of a name.
    """
    known = model.structure.channels
    missing = [c for c in channels if c not in known]
    if missing:
        raise PairingError(f"the structure has no sensor for channel {missing[0]!r}; it has {', '.join(known)}")
    chosen = [known.index(c) for c in channels]
    if across:
        return np.asarray(model.cross_rows[:, chosen].reshape(2 * len(chosen), -1))
    return np.asarray(model.sensor_rows[chosen])
