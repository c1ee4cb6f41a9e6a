"""Change of a member's axial force: cable tension, load of a column, heat between two abutments.

A force N more adds N G to the modal stiffness, G = Phi^T K_g Phi of the member's geometric stiffness: in the basis W
of Lambda^-1/2 G Lambda^-1/2 = V w V^T the flexibility Lambda^-1/2 V (1 + N w)^-1 V^T Lambda^-1/2. At N = -1 / max(w)
the structure buckles: the measure of every force.

A change since a reference may be of any size. A force that a structure file lacks is of the order of the dead load, of
temperature and of fit-up, which cause a force only as far as the structure restrains the member. Any other force, such
as that of a cable or a jack, is rarely left out of a file.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause, Discrete
from updater.causes.stretches import may_be_cut
from updater.fe import Element, Model, self_stress
from updater.inference import Comparison, Effect, Fit, in_modes, log_uniform, no_effect
from updater.quantities import Quantity, Where, vector
from updater.reference import Reference
from updater.structure import Member, Structure

_STD = 0.3  # of the force over that of buckling, while it is fitted
_MIN, _MAX = 0.003, 3.0  # of its magnitude
_COMPRESSED = -0.9  # relative to buckling: no structure is stable beyond
_GRAVITY = 9.81  # m/s2
_MISFIT = 2e-4  # strain of a member before it is restrained: 15 K of steel, 0.2 mm on a metre
_STATED = 0.3  # error of a preload in the file, relative to it
_LEAST_USUAL = 1e-3  # least of a usual force over the most
_STATIONS = 64  # along a member, between whose joints the force of a state is constant
_UNSTATED = 0.05  # probability of a force of any order that a structure file lacks


@dataclass(frozen=True, eq=False, kw_only=True)
class AxialForce(Discrete):
    """Members; the parameter is the force that is added over that at which the structure buckles."""

    members: tuple[Member, ...]
    buckling: FloatArray  #: (n,) force at which each member buckles the structure [N]
    share: FloatArray  #: (n, n_modes) w over its largest [-]
    basis: FloatArray  #: (n, n_modes, n_modes) Lambda^-1/2 V [s]
    #: (n,) most of a usual force over that of buckling; infinite for a change, which may be of any order
    usual: FloatArray
    scale_error: float  #: relative standard deviation of all forces, by the mass of the structure
    name: str = "axial_force"
    place_free: bool = False
    advice: str = "Measure the force in the member: a jack, a strain gauge, or its own frequency between two clamps."

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return flexibility changes."""
        more = theta * self.share[rows]
        basis = self.basis[rows]
        change = (basis * (-more / (1 + more))[:, None, :]) @ basis.transpose(0, 2, 1)
        return replace(no_effect(len(rows), self.comparison), compliance=in_modes(change, self.comparison))

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the correction of the evidence for a force of any order, or for a usual one."""
        value, std = theta[:, 0], np.sqrt(covariance[:, 0, 0])
        of_any_order = log_uniform(value, std, gaussian=_STD, least=_MIN, most=_MAX).log_ratio
        unit = self.usual[rows]
        if not np.isfinite(unit).all():
            return of_any_order
        usual = log_uniform(value / unit, std / unit, gaussian=_STD / unit, least=_LEAST_USUAL, most=1.0).log_ratio
        return np.asarray(np.logaddexp(np.log1p(-_UNSTATED) + usual, np.log(_UNSTATED) + of_any_order))

    def where(self, fit: Fit[Cause]) -> Where:
        """Return the member, all of it."""
        found = self.members[fit.best]
        return Where(
            member=found.name,
            position=vector(found.point(found.length / 2)),
            position_std=found.length / np.sqrt(12),
            region=((found.start, found.end),),
        )

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the force that was added, negative in compression."""
        unit, best = float(self.buckling[fit.best]), fit.best
        value, std = unit * float(fit.theta[best, 0]), unit * float(fit.covariance[best, 0, 0] ** 0.5)
        return {"force": Quantity(value=value, std=float(np.hypot(std, self.scale_error * value)), unit="N")}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Write the member's preload."""
        found = self.members[row]
        more = float(theta[0] * self.buckling[row])
        members = tuple(
            m.model_copy(update={"preload": m.preload + more}) if m.name == found.name else m for m in structure.member
        )
        return structure.model_copy(update={"member": members})


def propose_axial_force(reference: Reference, comparison: Comparison) -> AxialForce | None:
    """Return every member; none of very many or of matrices."""
    structure = reference.structure
    if not may_be_cut(structure):
        return None
    buckling, share, basis = _geometric(reference)
    return AxialForce(
        prior_std=np.array([_STD]),
        lower=np.full((len(buckling), 1), _COMPRESSED),
        drifting=True,
        comparison=comparison,
        members=structure.member,
        buckling=buckling,
        share=share,
        basis=basis,
        scale_error=reference.calibration.mass_error,
        usual=usual_forces(reference.model) / buckling if reference.of_file else np.full(len(buckling), np.inf),
    )


def usual_forces(model: Model) -> FloatArray:
    """Return the most of each member's usual force that a file lacks (n,) [N].

    The weight of all, an error of a stated preload, and the force of a misfit strain: in states of self-stress z of
    unit energy, a strain e along a member of length L causes the force e L sum(N_z^2).
    """
    structure = model.structure
    weight = _GRAVITY * model.total_mass()
    preload = np.array([member.preload for member in structure.member])
    misfit = _MISFIT * np.diagonal(restrained_forces(model))
    return np.asarray(np.hypot(np.hypot(weight, misfit), _STATED * preload))


def restrained_forces(model: Model) -> FloatArray:
    """Return the mean axial force of each member if a member is shorter by its length (n_members shorter, n_members).

    Forces in tension [N]; of a state of self-stress, the force of a member is its mean along it.
    """
    structure, states = model.structure, self_stress(model, every=True)
    axial = []
    for member in structure.member:
        stiffness = structure.material[member.material].youngs_modulus * structure.section[member.section].area
        at = (np.arange(_STATIONS) + 0.5) * member.length / _STATIONS
        axial.append(np.sqrt(stiffness) * states.actions(member, at)[:, 0].mean(0))
    of_state = np.array(axial)
    length = np.array([member.length for member in structure.member])
    return np.asarray(length[:, None] * (of_state @ of_state.T))


@lru_cache(maxsize=4)
def _geometric(reference: Reference) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the buckling force [N], the shares w and the basis of each member."""
    value, basis = in_buckling_modes(reference, geometric_stiffness(reference))
    most = value[:, -1]
    return 1 / most, np.maximum(value, 0.0) / most[:, None], basis


def in_buckling_modes(reference: Reference, stiffness: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the stiffness in its own basis (n, n_modes), and this basis Lambda^-1/2 V (n, n_modes, n_modes) [s].

    Parameters
    ----------
    stiffness : (n, n_modes, n_modes) relative to that of the modes, see `geometric_stiffness`
    """
    value, vectors = np.linalg.eigh(stiffness)
    return value, (1 / (2 * np.pi * reference.frequency))[:, None] * vectors


@lru_cache(maxsize=4)
def geometric_stiffness(reference: Reference) -> FloatArray:
    """Return Lambda^-1/2 G Lambda^-1/2 of a unit axial force in each member (n_members, n_modes, n_modes) [1/N]."""
    model, root = reference.model, 1 / (2 * np.pi * reference.frequency)
    stiffness = {member.name: np.zeros((len(root), len(root))) for member in model.structure.member}
    known: dict[int, FloatArray] = {}  # elements of a kind are alike
    for name, (first, last, element) in zip(model.member_names, model.elements, strict=True):
        assert isinstance(element, Element)
        if id(element) not in known:
            turn = element.rotation(model.nodes[last] - model.nodes[first])
            known[id(element)] = turn.T @ element.geometric_stiffness() @ turn
        dofs = np.concatenate([model.dofs[first], model.dofs[last]])
        moved = np.where(dofs[:, None] >= 0, reference.shape[dofs], 0.0) * root
        stiffness[name] += moved.T @ known[id(element)] @ moved
    return np.array(list(stiffness.values()))
