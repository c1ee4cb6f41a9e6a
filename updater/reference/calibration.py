"""Physical parameters of the structure fitted to the baseline's frequencies, before the one-step update.

By the iterative sensitivity method: Young's modulus of each material (with its shear modulus), the flexibility of each
support and joint, and the additional stiffness of members where they meet. Density is not fitted: frequencies alone do
not distinguish it from stiffness.
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.optimize import linear_sum_assignment

from daq import FloatArray, IndexArray
from daq.bounded_text import meant
from oma import pair_modes
from oma.tracking import mac_of_moving
from updater.errors import PairingError
from updater.fe import Element, Model, Modes, build_model, elastic_energy, parts_between
from updater.modal_data import ModalMean, check_baseline, check_unit
from updater.quantities import SIGNIFICANT, ParameterChange
from updater.reference.model_error import FrequencyError, frequency_error
from updater.reference.segment_sensitivity import slope_by_factor, slope_by_spring, wall_errors
from updater.reference.sensitivity_method import (
    Convergence,
    Prior,
    SensitivityFit,
    fit_parameters,
    frequency_slope,
)
from updater.structure import (
    TURNS,
    Axis,
    Joint,
    ModelParameter,
    Structure,
    Support,
    apply_parameters,
    connection_of,
    flexibility_unit,
    is_of,
    is_rigid,
    joint_zones,
    model_parameters_of,
    physical_unit,
    physical_value,
    place_name,
    stands_for_rigid,
    starts_rigid,
    wall_of,
    walls_with_springs,
)

FREQUENCY_ERROR = 2e-3  #: ln f: residual that no parameter of a beam model explains
#: relative to the structure's mass: that of its density, and of paint, screws and cables
_MASS_STD = 0.015
_METAL = 6e10  # Pa of Young's modulus; that of concrete and timber depends on the batch
_MODULUS_STD = 0.02  # relative, of a metal's modulus about that of tables
_BEYOND = 4  # modes more than were measured, that sensors should see of the model
_SEEN = 1e-3  # relative to the largest simulated mode at the sensors: a smaller motion is not measured
_MAX_MODES = 120  # of the model
_REACH = 6.0  # times the highest frequency that was measured, that modes should go to ...
_MAX_FOR_REACH = 60  # ... as far as so many do
_ALIKE = 0.9  # share of a shape above which it certainly corresponds to the model's modes of the file
UNLIKE = 0.7  #: share below which it does not, once the model is nearly right
_CLOSE = 0.03  # of ln f: modes that turn into each other
_LEAST_PAIRED = 3  # modes that a structure is fitted to
# Log of the ratio of evidences above which it is very strong (Kass & Raftery 1995, J. Am. Stat. Assoc. 90, s. 3.2)
_LOG_VERY_STRONG = 5.0
# Chi-square per mode of a fit with springs of walls, above which the file has other errors that the springs imitate
_FAR_OFF = 10.0


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One fitted quantity."""

    name: str  #: such as `support 0 ry`
    value: float  #: factor of stiffness, c E I / L, along an axis c E I / L^3, or share that a weld takes [-]
    std: float  #: standard deviation by noise and the usual error of a model
    of_file_std: float = 0.0  #: standard deviation by masses and sections that the file has wrong
    at_bound: bool  #: whether it is at a bound

    @property
    def whole_std(self) -> float:
        """Standard deviation by noise, errors of a model and errors of the file together."""
        return float(np.hypot(self.std, self.of_file_std))


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibration:
    """Structure with its model calibrated to measured frequencies."""

    structure: Structure
    nominal: Structure  #: before calibration, as the file has it
    model: Model
    modes: Modes
    tracks: IndexArray  #: (n_tracks,) measured modes that have a partner
    paired: IndexArray  #: (n_tracks,) model mode of each
    n_nominal: int  #: measured modes that have a partner before calibration
    nominal_frequency: FloatArray  #: (n_tracks,) before calibration [Hz]
    nominal_mac: FloatArray  #: (n_tracks,) measured against the model before calibration [-]
    parameters: tuple[Parameter, ...]
    reason: Convergence | Literal["not_fitted"]  #: why the iteration ended
    knobs: tuple[ModelParameter, ...]  #: parameters that were fitted, or could be
    #: standard deviation of ln f of modes that were not measured: rms of those measured, each left out of the fit
    unmeasured_std: float = FREQUENCY_ERROR

    @property
    def fitted(self) -> bool:
        """True if anything was fitted."""
        return bool(self.parameters)

    @cached_property
    def frequency_error(self) -> FrequencyError:
        """Errors that the frequencies of `modes` (n_modes,) are expected to have by the mesh of faces and by walls."""
        return frequency_error(self.model, self.modes)

    def flexibility_std(self, connection: Support | Joint, axis: Axis) -> float:
        """Return how well a connection's flexibility is known [rad/(N m) or m/N]: 0 where it is the file's."""
        for knob, parameter in zip(self.knobs, self.parameters, strict=False):
            if knob.axis == axis and is_of(self.structure, connection, knob):
                return parameter.whole_std / parameter.value / dict(connection.stiffness.items())[axis]
        return 0.0

    @cached_property
    def unusual_moduli(self) -> tuple[ParameterChange, ...]:
        """Moduli of metals that were fitted farther from the file than metals differ: other errors are in them.

        A modulus contains the errors of density, sections and unlisted masses: frequencies do not separate them.
        """
        return tuple(
            change
            for change, shift in self._moduli_of_metals()
            if shift > SIGNIFICANT * np.hypot(_MODULUS_STD, change.std / change.after)
        )

    @property
    def mass_error(self) -> float:
        """Relative standard deviation of the structure's mass, and thus of all bodies, props and forces found on it.

        Frequencies determine these only as a share of the structure. What a fitted modulus differs by more than two
        deviations of moduli may be an error of the mass.
        """
        unusual = [shift - SIGNIFICANT * _MODULUS_STD for _, shift in self._moduli_of_metals()]
        return float(np.hypot(_MASS_STD, max([*unusual, 0.0])))

    def _moduli_of_metals(self) -> list[tuple[ParameterChange, float]]:
        """Return the fitted moduli of metals, each with how much the larger value exceeds the other."""
        found = []
        for knob, change in zip(self.knobs, self.changes(), strict=False):
            own = knob.kind == "stiffness" and not (knob.of_matrices or knob.of_group)
            if own and change.before and self.nominal.material[knob.target].youngs_modulus > _METAL:
                found.append((change, max(change.after / change.before, change.before / change.after) - 1))
        return found

    def is_rigid(self, connection: Support | Joint, axis: Axis) -> bool:
        """Return whether a connection is rigid as far as is known.

        The file has it rigid, and its flexibility is negligible or within two standard deviations of zero.
        """
        fitted = [(p.value, p.std) for p in self.parameters] or [(np.inf, 0.0)] * len(self.knobs)
        return any(
            stands_for_rigid(self.structure, connection, knob)
            or (is_rigid(knob) and is_of(self.structure, connection, knob) and value < SIGNIFICANT * std)
            for knob, (value, std) in zip(self.knobs, fitted, strict=False)
            if knob.axis == axis
        )

    def changes(self) -> tuple[ParameterChange, ...]:
        """Return the fitted parameters as they were in the file and as they are fitted."""
        pairs = zip(self.knobs, self.parameters, strict=False)  # none where nothing was fitted
        return tuple(self._change(knob, parameter, parameter.whole_std) for knob, parameter in pairs)

    def _change(self, knob: ModelParameter, parameter: Parameter, parameter_std: float) -> ParameterChange:
        value, before = parameter.value, None
        if knob.kind == "stiffness":
            after = physical_value(self.structure, knob, 0.0)
            before, std = after / value, after * parameter_std
        elif knob.kind == "weld":
            after, before, std = 1 / (1 - value), 1.0, parameter_std / (1 - value) ** 2
        elif knob.kind == "wall":
            value = max(value, knob.lower)  # 0 where a fit with shapes has the wall rigid
            after = physical_value(self.structure, knob, value)
            std = after * parameter_std / value
            before = physical_value(self.nominal, knob, knob.mean) if knob.in_file else None
        else:
            after = dict(connection_of(self.structure, knob).stiffness.items())[knob.axis]
            std = after * parameter_std / value
            before = after * value / knob.mean if knob.mean else None
        at_bound = parameter.at_bound and not (starts_rigid(knob) and value < knob.upper)  # a rigid one may stay so
        return ParameterChange(
            name=knob.key,
            quantity=knob.quantity,
            of=knob.of,
            position=knob.position,
            place=place_name(self.structure, knob.position) if knob.position else "",
            unit=physical_unit(self.structure, knob),
            before=before,
            after=after,
            std=0.0 if at_bound else std,
            at_bound=at_bound,
        )

    def physical_std(self) -> dict[str, float]:
        """Return the standard deviation of each fitted parameter by its name, in physical units.

        Of the structure as its file describes it: by noise and the usual error of a model alone.
        """
        pairs = zip(self.knobs, self.parameters, strict=False)  # none where nothing was fitted
        changes = [self._change(knob, parameter, parameter.std) for knob, parameter in pairs]
        return {change.name: change.std for change in changes if change.std > 0}

    def only(self, kept: npt.NDArray[np.bool_] | IndexArray) -> "Calibration":
        """Return the same with some of the tracks: a mask (n_tracks,), or indices."""
        names = ("tracks", "paired", "nominal_frequency", "nominal_mac")
        return replace(self, **{name: getattr(self, name)[kept] for name in names})


def calibrate(structure: Structure, measured: ModalMean, *, n_modes: int = 30) -> Calibration:
    """Fit a structure to measured modes at its sensors.

    Parameters
    ----------
    structure : as in the file
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
    highest = float(np.exp(np.nanmax(measured.log_frequency)))
    modes = enough_modes(nominal, rows, highest, len(measured.log_frequency), n_modes=n_modes)
    seen = (rows @ modes.shape).T
    frequency = np.exp(measured.log_frequency)
    check_unit(frequency, measured.shape, modes.frequency, seen)
    file = _Pairs(modes.frequency, seen, pair_modes(frequency, measured.shape, modes.frequency, seen))
    data = _Data(structure, measured, nominal.mesh_error(modes.shape), n_modes, walls=[])
    knobs = model_parameters_of(structure)
    held = [knob for knob in knobs if not knob.of_rigid_wall]
    rigid = data.fitted(held, data.pairs(held, file)) if file.n >= _LEAST_PAIRED else None
    best = rigid if len(held) == len(knobs) else _with_walls(data, knobs, file, rigid)
    if best is None:
        raise PairingError(
            f"only {file.n} of the modes at {np.round(frequency, 2).tolist()} Hz are paired with one "
            f"of the model's {np.round(modes.frequency[:12], 2).tolist()} Hz: check the structure and the "
            "channel map"
        )
    fit, tracks = best.fit, np.flatnonzero(best.answers >= 0)
    model, _, paired = best.misfit.solved(fit.value)
    value = [np.exp(x) if k.kind == "stiffness" else x for k, x in zip(best.knobs, fit.value, strict=True)]
    before = best.answers if best is rigid else _in_the_file(data, file, best.answers)
    return Calibration(
        structure=model.structure,
        nominal=structure,
        model=model,
        modes=model.modes(len(modes.frequency)),
        tracks=tracks,
        paired=paired,
        n_nominal=file.n,
        nominal_frequency=modes.frequency[before[tracks]],
        nominal_mac=_likeness(measured, before, seen)[tracks],
        parameters=tuple(
            Parameter(name=k.name, value=float(v), std=float(s), at_bound=bool(b))
            for k, v, s, b in zip(best.knobs, value, fit.std, fit.at_bound, strict=True)
        ),
        reason=fit.reason,
        knobs=tuple(best.knobs),
        unmeasured_std=max(best.misfit.rms(fit.left_out), FREQUENCY_ERROR),
    )


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Modes of a model, and measured ones that are paired with them."""

    frequency: FloatArray  #: (n_modes,) [Hz]
    seen: FloatArray  #: (n_modes, n_channels) shapes at the channels
    answers: IndexArray  #: (n_tracks,) model mode of each track, -1 for none

    @property
    def n(self) -> int:
        """Number of tracks with a partner."""
        return int((self.answers >= 0).sum())


@dataclass(frozen=True, eq=False)
class _Fitted:
    """Parameters fitted to paired modes."""

    knobs: list[ModelParameter]
    answers: IndexArray  #: (n_tracks,) number of a mode of the model that they were paired with, -1 for none
    misfit: "_Misfit"
    fit: SensitivityFit


@dataclass(frozen=True, eq=False)
class _Data:
    """A structure, and the measured modes that it is fitted to."""

    structure: Structure
    measured: ModalMean  #: (n_tracks,)
    mesh_error: FloatArray  #: (n_modes,) of the structure as in the file
    n_modes: int  #: of a model that is roughly fitted
    walls: list[ModelParameter]  #: springs of walls that the file has rigid, where these are not taken as rigid

    def pairs(self, knobs: list[ModelParameter], start: _Pairs) -> IndexArray:
        """Return the model mode (n_tracks,) of each track, -1 for none.

        If some pairs are sure and others are not, the model is first fitted to the sure ones.
        """
        measured, answers = self.measured, start.answers
        alike = np.flatnonzero(share_within(measured, answers, start.frequency, start.seen) > _ALIKE)
        if not _LEAST_PAIRED <= len(alike) < start.n:
            return answers
        rough = self._misfit(knobs, alike, answers, self.n_modes)
        first = fit_parameters(rough, _prior(knobs))
        nearer = _pairs_with(
            best_model(apply_parameters(self.structure, knobs, first.value)), measured, len(start.frequency)
        )
        share = share_within(measured, nearer.answers, nearer.frequency, nearer.seen)
        return np.where(share > UNLIKE, nearer.answers, -1)

    def misfit(self, knobs: list[ModelParameter], answers: IndexArray) -> "_Misfit":
        """Return the misfit to the tracks that have a partner."""
        return self._misfit(knobs, np.flatnonzero(answers >= 0), answers, int(answers.max()) + 1 + _BEYOND)

    def _misfit(self, knobs: list[ModelParameter], tracks: IndexArray, answers: IndexArray, n_modes: int) -> "_Misfit":
        of_mesh = self.mesh_error[answers[tracks]]
        return _Misfit(self.structure, knobs, self.measured.only(tracks), of_mesh, self.walls, n_modes)

    def fitted(self, knobs: list[ModelParameter], answers: IndexArray, start: FloatArray | None = None) -> _Fitted:
        """Return parameters fitted to the tracks that have a partner; None: from the prior's start."""
        misfit, prior = self.misfit(knobs, answers), _prior(knobs)
        if start is not None:
            prior = replace(prior, start=start)
        return _Fitted(knobs, answers, misfit, fit_parameters(misfit, prior))


def _with_walls(data: _Data, knobs: list[ModelParameter], file: _Pairs, rigid: _Fitted | None) -> _Fitted | None:
    """Return the fit with springs of walls if its evidence is much greater than with rigid walls, otherwise `rigid`.

    The prior of a spring is about the flexibility of a wall that bends, and modes that do not determine it leave it
    there: a rigid joint would become soft. Both are fitted to the same modes, with the errors of walls that have the
    expected springs, the one with rigid walls also from the parameters of the other: a local minimum is no evidence.
    These modes are paired with the expected flexibility of the walls if more are paired then.

    Parameters
    ----------
    knobs : all, with those of walls that the file has rigid
    file : modes as in the file
    rigid : fit without springs of walls; None if too few modes are paired with those of the file
    """
    walls = [knob for knob in knobs if knob.of_rigid_wall]
    held = [knob for knob in knobs if not knob.of_rigid_wall]
    data = replace(data, walls=walls)
    expected = best_model(apply_parameters(data.structure, walls, np.array([knob.mean for knob in walls])))
    softer = _pairs_with(expected, data.measured, len(file.frequency))
    start = softer if softer.n > file.n else file
    if start.n < _LEAST_PAIRED:
        return rigid
    answers = data.pairs(knobs, start)
    if rigid is not None and (answers >= 0).sum() <= (rigid.answers >= 0).sum():
        answers, first = rigid.answers, data.fitted(held, rigid.answers, rigid.fit.value)
    else:
        first = data.fitted(held, answers)
    free = data.fitted(knobs, answers)
    of_held = [not knob.of_rigid_wall for knob in knobs]
    nearby = first, data.fitted(held, answers, free.fit.value[of_held])
    gain = free.fit.log_evidence - max(one.fit.log_evidence for one in nearby)
    near = free.fit.chi_square < _FAR_OFF * (answers >= 0).sum()
    return free if near and gain > _LOG_VERY_STRONG else rigid


def _in_the_file(data: _Data, file: _Pairs, answers: IndexArray) -> IndexArray:
    """Return the mode (n_tracks,) of the file of each track that has a partner: the paired, or the most alike one."""
    tracks = np.flatnonzero(answers >= 0)
    found = answers.copy()
    found[tracks] = data.misfit([], answers).solved(np.empty(0))[2]
    return np.where((answers >= 0) & (file.answers >= 0), file.answers, found)


def _pairs_with(model: Model, measured: ModalMean, n_modes: int) -> _Pairs:
    """Return a model's modes, and the measured ones that are paired with them."""
    modes = model.modes(n_modes)
    seen = (channel_rows(model, measured.channels) @ modes.shape).T
    answers = pair_modes(np.exp(measured.log_frequency), measured.shape, modes.frequency, seen)
    return _Pairs(modes.frequency, seen, answers)


def share_within(measured: ModalMean, answers: IndexArray, frequency: FloatArray, seen: FloatArray) -> FloatArray:
    """Return the share (n_tracks,) [-] of each shape's square norm that model modes near the paired one span.

    Close modes rotate into each other by unknown errors; 0 for a mode without a partner.

    Parameters
    ----------
    measured : (n_tracks,) with shapes of unit norm
    answers : (n_tracks,) paired mode of the model, -1 for none
    frequency : (n_modes,) of the model [Hz]
    seen : (n_modes, n_channels) its shapes at the channels
    """
    found = np.zeros(len(answers))
    for track in np.flatnonzero(answers >= 0).tolist():
        about = np.abs(np.log(frequency / frequency[answers[track]])) < _CLOSE
        basis, _ = np.linalg.qr(seen[about].T)
        found[track] = ((basis.T @ measured.shape[track]) ** 2).sum()
    return found


def _likeness(measured: ModalMean, answers: IndexArray, seen: FloatArray) -> FloatArray:
    """Return the MAC (n_tracks,) of each mode with its paired model mode; 0 if there is none."""
    cross = (measured.shape * seen[answers]).sum(1) ** 2
    return np.asarray(np.where(answers >= 0, cross / (seen[answers] ** 2).sum(1), 0.0))


def enough_modes(model: Model, rows: FloatArray, highest: float, n_measured: int, *, n_modes: int = 30) -> Modes:
    """Return modes, some of them measurable beyond the highest measured one: a change's effect consists of them.

    For a plane frame with sensors in its plane, most of the first thirty modes may be out of plane or torsional; for a
    long beam they may end at three times the highest measured frequency, which is not sufficient for the kink of a soft
    stretch.

    Parameters
    ----------
    rows : (n_channels, n_dofs) that read the sensors
    highest : frequency that was measured [Hz]
    n_measured : modes that were
    n_modes : at least
    """
    most = int((model.dofs[:, :3] >= 0).sum())
    n_modes = min(n_modes, most)
    while True:
        modes = model.modes(n_modes)
        length = np.linalg.norm(rows @ modes.shape, axis=0)
        seen = (length > _SEEN * length.max()).sum() >= n_measured + _BEYOND
        far = modes.frequency[-1] > _REACH * highest or n_modes >= _MAX_FOR_REACH
        if (seen and far) or n_modes >= min(most, _MAX_MODES):
            return modes
        n_modes = min(2 * n_modes, most, _MAX_MODES)


def _prior(knobs: list[ModelParameter]) -> Prior:
    return Prior(
        mean=np.array([k.mean for k in knobs]),
        std=np.array([k.prior for k in knobs]),
        lower=np.array([k.lower for k in knobs]),
        upper=np.array([k.upper for k in knobs]),
        start=np.array([k.start for k in knobs]),
    )


class _Misfit:
    """Log frequencies of the structure with parameters x over the measured ones.

    A parameter may move a mode across another, so that partners are searched again at each x. The error of a mesh
    (n_tracks,) is part of the tolerance, and that of walls that bend: parameters that replaced them would make the
    shapes wrong.
    """

    def __init__(
        self,
        structure: Structure,
        knobs: list[ModelParameter],
        measured: ModalMean,
        mesh_error: FloatArray,
        walls: list[ModelParameter],
        n_modes: int,
    ) -> None:
        self._structure, self._knobs, self._measured, self._n_modes = structure, knobs, measured, n_modes
        variance = measured.log_frequency_std**2 + FREQUENCY_ERROR**2
        of_model = FrequencyError(mesh=mesh_error, walls=self._wall_errors(walls)).covariance
        self._whitener = np.linalg.inv(np.linalg.cholesky(np.diag(variance) + of_model))
        self._solved = lru_cache(2)(self._solve)  # a step that failed, and the parameters before it

    def _wall_errors(self, walls: list[ModelParameter]) -> FloatArray:
        """Return the relative errors (n_tracks, n_springs) by walls: of the file's springs, and of expected ones."""
        structure = apply_parameters(self._structure, walls, np.array([w.mean for w in walls]))
        if not walls_with_springs(structure):
            return np.zeros((len(self._measured.log_frequency), 0))
        model, modes, _ = self._paired(structure)
        return wall_errors(model, modes)

    def _solve(self, *x: float) -> tuple[Model, Modes, IndexArray]:
        return self._paired(apply_parameters(self._structure, self._knobs, np.array(x)))

    def _paired(self, structure: Structure) -> tuple[Model, Modes, IndexArray]:
        model = best_model(structure)
        modes = model.modes(self._n_modes)
        seen = (channel_rows(model, self._measured.channels) @ modes.shape).T
        unlike = 1 - mac_of_moving(self._measured.shape, seen)
        apart = np.abs(np.log(modes.frequency) - self._measured.log_frequency[:, None])
        _, partner = linear_sum_assignment(unlike + apart)
        return model, Modes(frequency=modes.frequency[partner], shape=modes.shape[:, partner]), partner

    def solved(self, x: FloatArray) -> tuple[Model, Modes, IndexArray]:
        """Return the model, its modes (n_tracks,) paired with the measured ones, and their numbers."""
        return self._solved(*x)

    def residual(self, x: FloatArray) -> FloatArray:
        off = np.log(self._solved(*x)[1].frequency) - self._measured.log_frequency
        return np.asarray(self._whitener @ off)

    def rms(self, whitened: FloatArray) -> float:
        """Return the root mean square in ln f of whitened residuals (n_tracks,), each given the tracks before it."""
        return float(np.sqrt(np.mean((whitened / np.diag(self._whitener)) ** 2)))

    def slope(self, x: FloatArray) -> FloatArray:
        model, modes, _ = self._solved(*x)
        columns = [self._by_knob(model, modes, x, i) for i in range(len(self._knobs))]
        return np.asarray(self._whitener @ np.column_stack(columns))

    def _by_knob(self, model: Model, modes: Modes, x: FloatArray, i: int) -> FloatArray:
        knob = self._knobs[i]
        if knob.kind == "stiffness" and self._structure.external is None:
            return self._by_material(model, modes, knob.target)
        if knob.of_group:
            return frequency_slope(modes.omega, modes.shape, model.groups[knob.target] @ modes.shape)
        if knob.kind == "stiffness":
            return frequency_slope(modes.omega, modes.shape, self._stiffened(model, x, i) @ modes.shape)
        if knob.kind == "weld":
            return self._by_weld(model, modes, knob, float(x[i]))
        if knob.kind == "wall":
            return self._by_wall(model, modes, knob, float(x[i]))
        return self._by_spring(model, modes, knob)

    def _by_material(self, model: Model, modes: Modes, material: str) -> FloatArray:
        """Return d ln omega / d ln E of a material: its members' part of K is proportional to E."""
        members = {member.name for member in self._structure.member if member.material == material}
        return elastic_energy(model, modes.shape, members) / (2 * modes.omega**2)

    def _stiffened(self, model: Model, x: FloatArray, i: int) -> sparse.csc_array:
        """Return dK / d ln f of external matrices, their part of K, which is proportional to f."""
        doubled = x.copy()
        doubled[i] += np.log(2)
        return sparse.csc_array(
            best_model(apply_parameters(self._structure, self._knobs, doubled)).stiffness - model.stiffness
        )

    def _by_weld(self, model: Model, modes: Modes, knob: ModelParameter, less: float) -> FloatArray:
        """Return d ln omega by the share of flexibility that a weld takes, its elements' part of b^T dK b."""
        zones = joint_zones(model.structure, knob)
        parts = [part for zone in zones for part in parts_between(model, modes.shape, *zone)]
        return slope_by_factor(modes, parts, Element.turned) / (1 - less)

    def _by_wall(self, model: Model, modes: Modes, knob: ModelParameter, flexibility: float) -> FloatArray:
        """Return d ln omega by the flexibility of a wall's spring: its segment's elastic energy over its compliance."""
        wall = wall_of(self._structure, self._structure.member_named(knob.target), knob.at)
        assert wall is not None  # the parameter is of it
        return slope_by_spring(model, modes, wall, knob.axis) * wall.slope(flexibility)

    def _by_spring(self, model: Model, modes: Modes, knob: ModelParameter) -> FloatArray:
        """Return d ln omega / dc, -q^2 / (2 omega^2 unit) by the moments or forces q of the modes in the spring."""
        row, spring = spring_of(model, knob)
        force = spring * (row @ modes.shape)
        return np.asarray(-(force**2) / (2 * modes.omega**2 * flexibility_unit(self._structure, knob.axis, knob.at)))


def spring_of(model: Model, knob: ModelParameter) -> tuple[FloatArray, float]:
    """Return the row (n_dofs,) that reads how a connection's spring is strained, and its stiffness [N m/rad or N/m]."""
    connection = connection_of(model.structure, knob)
    stiffness = next(v for axis, v in connection.stiffness.items() if axis == knob.axis)
    if isinstance(connection, Joint):
        return model.joint_rows(connection, TURNS.index(knob.axis)), stiffness
    return model.support_rows(connection.at, knob.axis), stiffness


def best_model(structure: Structure) -> Model:
    """Timoshenko, consistent mass: a thin-beam model's upper modes are per cents off, which turns into place."""
    return build_model(structure, shear_flexible=True, mass="consistent")


def channel_rows(model: Model, channels: tuple[str, ...], *, across: bool = False) -> FloatArray:
    """Return rows (n_channels, n_dofs) [-] that give the displacements at the named sensors, along their directions.

    Parameters
    ----------
    model : whose structure has the sensors
    channels : their names
    across : read along the two axes across each sensor instead (2 n_channels, n_dofs), first axes first

    Raises
    ------
    PairingError
        If the structure has no sensor of a name.
    """
    known = model.structure.channels
    missing = [c for c in channels if c not in known]
    if missing:
        near = meant(missing[0], [name for name in known if name not in channels])
        raise PairingError(f"the structure has no sensor for channel {missing[0]!r}{near}; it has {', '.join(known)}")
    chosen = [known.index(c) for c in channels]
    if across:
        return np.asarray(model.cross_rows[:, chosen].reshape(2 * len(chosen), -1))
    return np.asarray(model.sensor_rows[chosen])
