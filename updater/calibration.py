"""Physical parameters of the structure fitted to the baseline's frequencies, before the one-step update.

The iterative sensitivity method (Friswell & Mottershead 1995, ch. 8), kept small: Young's modulus of each material
(with its shear modulus), rotational flexibility of each support and of each joint, all with priors, so that what the
frequencies do not show stays where it was. Density is not fitted: frequencies alone cannot tell it from stiffness.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from daq import FloatArray, IndexArray
from oma import pair_modes
from updater.errors import ModalDataError, PairingError
from updater.fe.assembly import build_model
from updater.fe.model import Model
from updater.fe.modes import Modes
from updater.modal_checks import check_baseline, unit_hint
from updater.statistics import ModalMean
from updater.structure import AXES, Joint, Member, Structure, Support

_STIFFNESS_PRIOR = 0.03  # of ln E
_FLEXIBILITY_PRIOR = 0.02  # of c E I / L, c the spring's flexibility: a nominally rigid connection
_MODEL_ERROR = 2e-3  # of ln f: what no parameter of a beam model explains
_RIGID = 1e-6  # the least flexibility c E I / L
_TURNS = AXES[3:]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One fitted quantity."""

    name: str  #: such as `support 0 ry`
    value: float  #: factor of stiffness, or c E I / L [-]
    std: float


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


@dataclass(frozen=True)
class _Knob:
    name: str
    prior: float
    lower: float
    kind: str  #: stiffness, support or joint
    target: str  #: material, index of the support, or member
    axis: str


def calibrate(structure: Structure, measured: ModalMean, *, n_modes: int = 30) -> Calibration:
    """Fit a structure to measured modes at its sensors.

    Parameters
    ----------
    structure : as the file says
    measured : (n_tracks,) modes; channels name sensors of the structure
    n_modes : model modes to keep

    Raises
    ------
    PairingError
        If fewer than three measured modes have a partner in the model.
    ModalDataError
        If one mode is on two tracks, or the frequencies are not in hertz.
    """
    check_baseline(measured)
    nominal = best_model(structure)
    n_modes = min(n_modes, int((nominal.dofs[:, :3] >= 0).sum()))
    modes = nominal.modes(n_modes)
    rows = channel_rows(nominal, measured.channels)
    seen = (rows @ modes.shape).T
    frequency = np.exp(measured.log_frequency)
    answers = pair_modes(frequency, measured.shape, modes.frequency, seen)
    unit = unit_hint(frequency, measured.shape, modes.frequency, seen)
    if unit:
        raise ModalDataError(
            f"frequencies: expected hertz, found {np.round(frequency, 2).tolist()}, which answer to the model's "
            f"{np.round(modes.frequency[:12], 2).tolist()} Hz if they are in {unit}"
        )
    if (answers >= 0).sum() < 3:
        raise PairingError(
            f"only {(answers >= 0).sum()} of the modes at {np.round(frequency, 2).tolist()} Hz answer to one of "
            f"the model's {np.round(modes.frequency[:12], 2).tolist()} Hz: is it the right structure, are the channels "
            "mapped rightly?"
        )
    tracks = np.flatnonzero(answers >= 0)
    measured = measured.only(tracks)
    paired = answers[tracks]
    knobs = _knobs(structure)
    tolerance = np.hypot(measured.log_frequency_std, _MODEL_ERROR)
    prior = np.array([k.prior for k in knobs])
    start = np.array([max(k.lower, 0.0) for k in knobs])
    start[[k.kind != "stiffness" for k in knobs]] = 1e-3

    def residual(x: FloatArray) -> FloatArray:
        fitted = best_model(_apply(structure, knobs, x)).modes(int(paired.max()) + 1).frequency
        return np.asarray(np.r_[(np.log(fitted[paired]) - measured.log_frequency) / tolerance, x / prior])

    step = np.full(len(knobs), 1e-4)
    fit = least_squares(residual, start, bounds=([k.lower for k in knobs], np.inf), x_scale=prior, diff_step=step)
    slope = np.asarray(fit.jac)
    std = np.sqrt(np.diag(np.linalg.inv(slope.T @ slope)))
    fitted = _apply(structure, knobs, fit.x)
    model = best_model(fitted)
    value = [np.exp(x) if k.kind == "stiffness" else x for k, x in zip(knobs, fit.x, strict=True)]
    cross = (measured.shape * seen[paired]).sum(1) ** 2
    return Calibration(
        structure=fitted,
        model=model,
        modes=model.modes(n_modes),
        tracks=tracks,
        paired=paired,
        nominal_frequency=modes.frequency[paired],
        nominal_mac=cross / (seen[paired] ** 2).sum(1),
        parameters=tuple(
            Parameter(name=k.name, value=float(v), std=float(s)) for k, v, s in zip(knobs, value, std, strict=True)
        ),
    )


def with_springs(structure: Structure, flexibility: float = 1e-5) -> Structure:
    """Return the structure with springs where feet and joints are rigid, so stiff (c E I / L) that it shows nowhere."""
    knobs = [knob for knob in _knobs(structure) if knob.kind != "stiffness"]
    return _apply(structure, knobs, np.full(len(knobs), flexibility))


def best_model(structure: Structure) -> Model:
    """Timoshenko, consistent mass: a thin-beam model's upper modes are per cents off, which turns into place."""
    return build_model(structure, shear_flexible=True, mass="consistent")


def channel_rows(model: Model, channels: tuple[str, ...]) -> FloatArray:
    """Return rows (n_channels, n_dofs) that read the named sensors.

    Raises
    ------
    PairingError
        If the structure has no sensor of a name.
    """
    known = model.structure.channels
    missing = [c for c in channels if c not in known]
    if missing:
        raise PairingError(f"the structure has no sensor for channel {missing[0]!r}; it has {', '.join(known)}")
    return np.asarray(model.sensor_rows[[known.index(c) for c in channels]])


def _knobs(structure: Structure) -> list[_Knob]:
    knobs = [_Knob(f"stiffness of {m}", _STIFFNESS_PRIOR, -np.inf, "stiffness", m, "") for m in structure.material]
    for i, support in enumerate(structure.support):
        held = [a for a in _TURNS if a in support.fixed]
        knobs += [_Knob(f"support {i} flexibility {a}", _FLEXIBILITY_PRIOR, _RIGID, "support", str(i), a) for a in held]
    for member in _jointed(structure):
        knobs += [
            _Knob(f"joint of {member} flexibility {a}", _FLEXIBILITY_PRIOR, _RIGID, "joint", member, a) for a in _TURNS
        ]
    return knobs


def _jointed(structure: Structure) -> dict[str, tuple[float, float, float]]:
    """Members that another member's end meets rigidly -> the point; each meeting once, springs on the later member."""
    found: dict[str, tuple[float, float, float]] = {}
    for i, member in enumerate(structure.member):
        for other in structure.member[:i]:
            for point in (other.start, other.end, member.start, member.end):
                if member.name not in found and _on(member, point) and _on(other, point):
                    found[member.name] = point
    given = {joint.member for joint in structure.joint}
    return {name: point for name, point in found.items() if name not in given}


def _on(member: Member, point: tuple[float, float, float]) -> bool:
    along = np.subtract(member.end, member.start) / member.length
    s = float(np.clip(np.dot(np.subtract(point, member.start), along), 0, member.length))
    return bool(np.linalg.norm(member.point(s) - np.asarray(point)) < 1e-6)


def _apply(structure: Structure, knobs: list[_Knob], x: FloatArray) -> Structure:
    """Return the structure with the parameters `x` written into it."""
    material = dict(structure.material)
    springs: dict[tuple[str, str], dict[str, float]] = {}
    for knob, value in zip(knobs, x, strict=True):
        if knob.kind == "stiffness":
            old, factor = material[knob.target], float(np.exp(value))
            changed = {"youngs_modulus": old.youngs_modulus * factor, "shear_modulus": old.shear_modulus * factor}
            material[knob.target] = old.model_copy(update=changed)
        else:
            springs.setdefault((knob.kind, knob.target), {})[knob.axis] = bending_stiffness(structure) / float(value)
    supports = [_sprung(s, springs.get(("support", str(i)), {})) for i, s in enumerate(structure.support)]
    meeting = _jointed(structure)
    joints = [
        Joint.model_validate({"member": name, "at": meeting[name], "stiffness": axes})
        for (kind, name), axes in springs.items()
        if kind == "joint"
    ]
    return structure.model_copy(
        update={"material": material, "support": tuple(supports), "joint": (*structure.joint, *joints)}
    )


def _sprung(support: Support, springs: dict[str, float]) -> Support:
    fixed = [axis for axis in support.fixed if axis not in springs]
    return Support.model_validate({"at": support.at, "fixed": fixed, "stiffness": {**support.stiffness, **springs}})


def bending_stiffness(structure: Structure) -> float:
    """E I / L of the longest member: the measure of every flexibility [N m/rad]."""
    member = max(structure.member, key=lambda m: m.length)
    section = structure.section[member.section]
    return structure.material[member.material].youngs_modulus * max(section.second_moment) / member.length
