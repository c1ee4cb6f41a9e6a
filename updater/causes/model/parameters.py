"""Parameters of the structure file that are slightly wrong: stiffness, springs, welds, sections, masses, all at once.

This cause applies to a structure file without a learned reference: otherwise the calibration has fitted these
parameters. All parameters of a calibration have the same priors here. Each of them adds compliance of a material's
members or of a spring, or reduces that of a joint's zone; masses of sections, bodies and housings add modal mass. Of
external matrices, each of a group's stiffness, of all, or of a spring: the stiffness f f_i K_i of a group has the
factor of all, so that its compliance is over both.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc, log_ndtr, ndtri

from daq import FloatArray, IndexArray
from updater.causes.base import BoolArray, Cause, Discrete
from updater.causes.modal_loads import group_compliance, modal_section_forces, modal_spring_force
from updater.causes.overall.common_factor import ground_compliance
from updater.fe import Model, self_stress
from updater.inference import Comparison, Effect, Fit, common_magnitude, no_effect
from updater.quantities import ParameterChange, Quantity
from updater.reference import Reference, best_model, spring_of
from updater.structure import (
    FACTORS,
    JOINT_ZONES,
    ON_MEMBER,
    TURNS,
    WALL_ACTIONS,
    Member,
    ModelParameter,
    Structure,
    apply_parameters,
    bodies_of_one,
    connection_of,
    flexibility_unit,
    is_negligible,
    joint_zones,
    physical_slope,
    physical_unit,
    physical_value,
    segments_of_one,
    starts_rigid,
    wall_of,
)

_STIFFNESS_STD = 0.05  # ln E including the density, which frequencies cannot distinguish from it
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)  # of an element, or a joint's zone
# times c E I / L: prior flexibility of a rigid foot or joint in a calibration, where it may have come loose
_LOOSE = 0.1
_TURNED = slice(3, None)  # twist and bending, which are reduced in a joint's zone
_LESS_BELIEVED = 4.0  # times both of a file that is seen to be far off
_LEAST_ORDER = 0.1  # of all errors of a file, relative to their priors; uniform in its logarithm
_LEAST_P = 1e-300  # probability that is not rounded to 0


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelParameters(Discrete):
    """One alternative: all parameters relative to the file."""

    nominal: Structure  #: structure as in the file
    knobs: tuple[ModelParameter, ...]
    file_value: FloatArray  #: (n_knobs,) values of the file's model
    moved: FloatArray  #: (n_knobs,) values of the reference's model relative to those
    compliance: FloatArray  #: (n_knobs, n_modes + n_stress, same) that one of each adds to the reference's model
    mass: FloatArray  #: (n_masses, n_modes, n_modes) modal mass that one of each with mass adds
    name: str = "model_parameters"
    place_free: bool = True
    advice: str = (
        "Use the extended model, or learn a reference from logs, which calibrates the same parameters; then only what "
        "changes is left to explain. Frequencies determine only the ratio of Young's modulus to density."
    )

    @property
    def start(self) -> FloatArray:
        """Start of a fit: the values of the reference's model."""
        return self.moved[None]

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return compliances, that of a material goes with 1 / E, and modal masses."""
        theta = np.minimum(theta, self._upper)
        more = np.where(self._stiffness, np.expm1(self.moved - theta), theta - self.moved)
        change = np.tensordot(more * self._of_whole(theta), self.compliance, 1)
        heavier = np.where(self._stiffness, np.exp(theta) - np.exp(self.moved), theta - self.moved)[:, self._masses]
        return replace(
            no_effect(len(rows), self.comparison), compliance=change, mass=np.tensordot(heavier, self.mass, 1)
        )

    def compliance_increments(self, theta: FloatArray) -> dict[int, tuple[FloatArray, FloatArray]]:
        """Return all but masses and a factor of external matrices: that of a material less the stiffer it is."""
        amount = np.where(self._stiffness, -np.exp(self.moved - theta), theta < self._upper) * self._of_whole(theta)
        every = enumerate(zip(self.compliance, amount.T, strict=True))
        return {k: one for k, one in every if not self._whole[k] and not self._masses[k]}

    @property
    def _upper(self) -> FloatArray:
        return np.array([knob.upper for knob in self.knobs]) - self.file_value

    @property
    def _stiffness(self) -> IndexArray:
        return np.array([knob.kind in {"stiffness", *FACTORS} for knob in self.knobs])

    @property
    def _masses(self) -> BoolArray:
        """Mask (n_knobs,) of parameters with mass."""
        return np.array([knob.has_mass for knob in self.knobs])

    @property
    def _whole(self) -> BoolArray:
        """Mask (n_knobs,) of the factor of all external stiffness."""
        return np.array([knob.of_matrices for knob in self.knobs])

    def _of_whole(self, theta: FloatArray) -> FloatArray:
        """Return the factor of all on compliances of groups (..., n_knobs); 1 of others."""
        of_all = np.exp(((self.moved - theta) * self._whole).sum(-1, keepdims=True))
        return np.where(self._stiffness & ~self._whole, of_all, 1.0)

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the parts of priors and posteriors above the least values, and the correction for a common order.

        A file may be right within a tenth of the priors in all its parameters.
        """
        del rows
        std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        kept = log_ndtr((theta - self.lower) / std) - log_ndtr(-self.lower / self.prior_std)
        prior = self.prior_std
        relative = covariance / (prior[:, None] * prior)
        common = common_magnitude(theta / prior, relative, gaussian=1.0, least=_LEAST_ORDER, most=1.0)
        return np.asarray(kept.sum(1) + common)

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the values after the change, in physical units."""
        return {c.name: Quantity(value=c.after, std=c.std, unit=c.unit) for c in self.changes(fit)}

    def changes(self, fit: Fit[Cause]) -> tuple[ParameterChange, ...]:
        """Return every parameter that the written model changes, in the file and as fitted; significant ones first.

        A spring that is as good as rigid is not among them.
        """
        std, value = np.sqrt(np.diagonal(fit.covariance[0])), self.file_value + fit.theta[0]
        moved = [k for k in self._written(fit.theta[0]) if not is_negligible(self.knobs[k], float(value[k]))]
        found = [self._change(k, float(fit.theta[0, k]), float(std[k])) for k in moved]
        return tuple(sorted(found, key=lambda change: not change.listed))

    def deviations(self, fit: Fit[Cause]) -> float:
        """Return by how many standard deviations all parameters together differ from the file's.

        The information of the data beyond the priors is one chi-square with as many degrees of freedom as parameters
        are determined; returned is the deviation of a Gaussian with the same probability.
        """
        theta, covariance = fit.theta[0], fit.covariance[0]
        information = np.linalg.inv(covariance) - np.diag(self.prior_std**-2.0)
        determined = max(float(np.trace(covariance @ information)), 1.0)
        p_value = chdtrc(determined, max(float(theta @ information @ theta), 0.0))
        return -float(ndtri(max(p_value / 2, _LEAST_P)))

    def physical_std(self, fit: Fit[Cause]) -> dict[str, float]:
        """Return the standard deviations of all parameters."""
        std = np.sqrt(np.diagonal(fit.covariance[0]))
        every = (self._change(k, float(fit.theta[0, k]), float(std[k])) for k in range(len(self.knobs)))
        return {change.name: change.std for change in every}

    def _change(self, k: int, theta: float, std: float) -> ParameterChange:
        knob, value = self.knobs[k], float(self.file_value[k] + min(theta, self._upper[k]))
        if knob.kind == "wall":  # rigid in the file: infinitely stiff
            value = max(value, knob.lower)
        rigid = starts_rigid(knob)
        at_bound = theta >= self._upper[k] or (theta <= self.lower[0, k] and not rigid)
        return ParameterChange(
            name=knob.key,
            quantity=knob.quantity,
            of=knob.of,
            position=knob.position,
            unit=physical_unit(self.nominal, knob),
            before=None if rigid else physical_value(self.nominal, knob, float(self.file_value[k])),
            after=physical_value(self.nominal, knob, value),
            std=0.0 if at_bound else std * physical_slope(self.nominal, knob, value),
            at_bound=at_bound,
        )

    def _written(self, theta: FloatArray) -> list[int]:
        """Return the parameters with an entry in the written model."""
        relative = {"stiffness", "section", "body"}  # others have nothing at their least value
        return [
            k
            for k, knob in enumerate(self.knobs)
            if (knob.mean and not starts_rigid(knob)) or knob.kind in relative or theta[k] > self.lower[0, k]
        ]

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Write the new values of all changed parameters; rigid connections and absent welds get no entry."""
        del row
        moved = self._written(theta)
        value = self.file_value + np.minimum(theta, self._upper)
        return apply_parameters(structure, [self.knobs[k] for k in moved], value[moved])


def propose_model_parameters(reference: Reference, comparison: Comparison) -> ModelParameters | None:
    """Return the one alternative; None where a baseline was calibrated."""
    calibration = reference.calibration
    if calibration.fitted or not calibration.knobs:
        return None
    knobs, nominal = calibration.knobs, reference.nominal
    file = nominal.reference.model if nominal else calibration.model
    file_value = np.array([_file_value(file, knob) for knob in knobs])
    value = nominal.value if nominal else file_value
    lower = np.array([knob.lower for knob in knobs]) - file_value
    return ModelParameters(
        prior_std=np.array(
            [_prior(k, _LESS_BELIEVED if nominal and nominal.far else 1.0, reference.of_file) for k in knobs]
        ),
        lower=np.minimum(lower, 0.0)[None],
        comparison=comparison,
        nominal=file.structure,
        knobs=knobs,
        file_value=file_value,
        moved=value - file_value,
        compliance=np.array([_compliance(reference, k, x, file.structure) for k, x in zip(knobs, value, strict=True)]),
        mass=_masses(reference, knobs, file.structure),
    )


def _prior(knob: ModelParameter, wider: float, of_file: bool) -> float:
    """Return the standard deviation of a parameter about the file's value, wider for an inconsistent file.

    Parameters
    ----------
    of_file : whether errors of the file are sought: a connection that has come loose is a cause of its own there
    """
    if knob.kind == "stiffness":
        return wider * (knob.prior if knob.of_group else _STIFFNESS_STD)
    rigid = knob.kind in ("support", "joint") and not knob.mean and knob.axis in TURNS
    if not rigid:
        return knob.prior
    return wider * (knob.prior if of_file else _LOOSE)


def _file_value(model: Model, knob: ModelParameter) -> float:
    """Return the model's value of a parameter."""
    if knob.kind == "wall" and knob.in_file:
        return knob.mean
    if knob.kind not in {"support", "joint"}:
        return 0.0
    return flexibility_unit(model.structure, knob.axis, knob.at) / spring_of(model, knob)[1]


def _compliance(reference: Reference, knob: ModelParameter, value: float, file: Structure) -> FloatArray:
    """Return the compliance (n_modes + n_stress, same) that one of a parameter adds; of ln E, that there is.

    Parameters
    ----------
    value : that the reference's model has
    file : structure whose units of flexibility are used
    """
    model = reference.model
    members = model.structure.member
    if knob.kind in {"body", "housings"}:
        return np.zeros(2 * (len(reference.frequency) + self_stress(model).n,))
    if knob.of_matrices:
        own = (2 * np.pi * reference.frequency) ** -2.0
        whole = np.diag(np.concatenate([own, np.ones(self_stress(model).n)]))
        return whole - ground_compliance(reference)
    if knob.of_group:
        return group_compliance(reference)[knob.target]
    if knob.kind in {"stiffness", "section"}:
        of_section = knob.kind == "section"
        turns = knob.axis in TURNS and of_section
        borne = slice(3 + TURNS.index(knob.axis), 4 + TURNS.index(knob.axis)) if turns else slice(None)
        parts = [
            _between(reference, m, np.linspace(0, member.length, member.elements + 1), borne)
            for m, member in enumerate(members)
            if knob.target == (member.section if of_section else member.material)
        ]
        return np.asarray(np.sum(parts, axis=0))
    if knob.kind in JOINT_ZONES:
        parts = [
            _between(reference, members.index(m), np.unique([start, *_inside(knob, m, start, end), end]), _TURNED)
            for m, start, end in joint_zones(model.structure, knob)
        ]
        whole = np.asarray(np.sum(parts, axis=0))
        return whole if knob.kind in FACTORS else -whole / (1 - value)
    if knob.kind == "wall":
        wall = wall_of(model.structure, model.structure.member_named(knob.target), knob.at)
        assert wall is not None  # the parameter is of it
        action = WALL_ACTIONS[knob.axis]
        ends = np.array(wall.span(knob.axis))
        return -wall.slope(value) * _between(reference, members.index(wall.branch), ends, slice(action, action + 1))
    row, _ = spring_of(model, knob)
    force = modal_spring_force(reference, connection_of(model.structure, knob), knob.axis, row)
    return np.outer(force, force) / flexibility_unit(file, knob.axis, knob.at)


def _inside(knob: ModelParameter, member: Member, start: float, end: float) -> list[float]:
    """Return where a member passes a joint between two distances from its start [m]: its moments jump there."""
    at = float(np.linalg.norm(np.subtract(knob.at, member.start)))
    return [at] if start + ON_MEMBER < at < end - ON_MEMBER else []


def _masses(reference: Reference, knobs: Sequence[ModelParameter], file: Structure) -> FloatArray:
    """Return the modal mass (n_masses, n_modes, n_modes) that one of each parameter with mass adds.

    Parameters
    ----------
    file : structure whose masses they are relative to
    """
    structure, n = reference.model.structure, len(reference.frequency)
    found = []
    for knob in (knob for knob in knobs if knob.has_mass):
        body, segment = bodies_of_one(file, knob), segments_of_one(file, knob)
        more = {"body": (*structure.body, *body), "segment": (*structure.segment, *segment)}
        added = best_model(structure.model_copy(update=more)).mass - reference.model.mass
        found.append(reference.shape.T @ (added @ reference.shape))
    return np.array(found).reshape(-1, n, n)


def _between(reference: Reference, member: int, edges: FloatArray, actions: slice) -> FloatArray:
    """Return the compliance (n_modes + n_stress, same) of a member between edges (n,) [m], by some of its actions."""
    half = np.diff(edges)[:, None] / 2
    at = (edges[:-1, None] + half * (_POINTS + 1)).ravel()
    found = modal_section_forces(reference, {member: at})[member][:, actions] * np.sqrt(
        (half * _WEIGHTS).reshape(-1, 1, 1)
    )
    flat = found.reshape(-1, found.shape[2])
    return flat.T @ flat
