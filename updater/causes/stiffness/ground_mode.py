"""Floor, foundation or neighbouring structure with a mode of its own, which moves feet of the structure.

With a foot on a mass m_g and a spring k_g, the structure moves statically with the foot by psi, and relative to that by
its modes with fixed feet (Craig and Bampton). With z the motion of the ground times the root of m = m_g + psi^T M psi,
the mass matrix is bordered by m^-1/2 Phi^T M psi and the flexibility by m / (k_g + psi^T K psi): exact in the modes of
the reference. The dynamic stiffness k_g (1 - omega^2 / omega_g^2) under the foot is positive for modes below the
frequency of the ground, which become lower, and negative for those above it, which become higher.

Seen far below the ground's frequency, it is a foot with less stiffness: `support_stiffness`.

References
----------
Craig, R. R., Bampton, M. C. C. (1968). Coupling of substructures for dynamic analyses. AIAA J. 6(7), 1313-1319.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from daq import FloatArray, IndexArray
from updater.causes.base import BoolArray, Cause, Discrete
from updater.causes.mass.attached_oscillator import log_explained, not_known
from updater.causes.stretches import may_be_cut
from updater.fe import Model
from updater.inference import Comparison, Effect, Fit, NewModes, log_uniform, no_effect, shaken
from updater.quantities import Quantity, Where, vector
from updater.reference import Reference, best_model, channel_rows
from updater.structure import AXES, Axis, Ground, Structure, Support, Vector, flexibility_unit

_STIFF = 1e-6  # flexibility of a fixed foot, relative to that of the longest member
_RATIO_STD = 5.0  # Gaussian prior of the mass of the structure over that of the ground, while it is fitted
_MIN_RATIO, _MAX_RATIO = 0.005, 20.0  # range of the order of that ratio
_LEAST = 0.1  # bound of the ratio, relative to the least one
_BEGUN = (0.05, 0.3, 1.0, 4.0)  # ratios from which fits begin
_TUNED = 0.15  # of ln f: standard deviation of the predicted frequency of the new mode before the fit
_DAMPING_STD = 1.0  # of ln of its own damping over the modes': a third of it to three times as much
_SOFTEST = 0.02  # least square of the frequency with the structure at rest on it, relative to that of the new mode
_STEP = 1e-4  # of the differences by which deviations are propagated, in standard deviations
_ROTATIONS = AXES[3:]


@dataclass(frozen=True, eq=False, kw_only=True)
class GroundMode(Discrete):
    """Grounds under feet, by axis and new mode; parameters are the ratio of the masses, ln f, and ln of own damping.

    The ratio is the mass that the structure moves with the ground, over the ground's own; ln f is that of the new mode
    relative to the measured one. Each alternative is there several times, with fits that begin from different ratios.
    """

    reference: Reference
    new: NewModes  #: new modes
    grounds: tuple[tuple[tuple[Vector, ...], Axis], ...]  #: (n,) supports and axis of each alternative
    mode: IndexArray  #: (n,) new mode of each
    part: FloatArray  #: (n, n_modes) Phi^T M psi
    mass: FloatArray  #: (n,) psi^T M psi [kg] or [kg m2]
    held: FloatArray  #: (n,) psi^T K psi: stiffness of the structure against it [N/m] or [N m/rad]
    moved: FloatArray  #: (n, n_channels) psi at the channels
    begun: FloatArray  #: (n, 3)
    name: str = "ground_mode"
    place_free: bool = False
    advice: str = "Measure on the floor near the foot and on neighbouring structures: they must have the new mode too."

    @property
    def start(self) -> FloatArray:
        """Start of a fit."""
        return self.begun

    @property
    def neutral_start(self) -> FloatArray:
        """Heavy ground, which the structure does not move, tuned to the new mode."""
        return np.zeros(self.begun.shape)

    def repeats(self, other: "GroundMode", row: int) -> BoolArray:
        """Return the alternatives with the ground of alternative `row`."""
        return np.array([ground == other.grounds[row] for ground in self.grounds])

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the ground, coupled with the modes of fixed feet."""
        share, own = self._share(theta, rows), self._own(theta, rows)
        root = np.sqrt(share / self.mass[rows])[:, None, None]
        return replace(
            no_effect(len(rows), self.comparison),
            coupling=root * self.part[rows, :, None],
            carried=root * self.moved[rows, :, None],
            own=own[:, None] ** -2.0,
            own_log_damping=theta[:, 2:],
        )

    def _share(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the structure's share (n,) of the mass that moves with the ground."""
        del rows
        return np.asarray(theta[:, 0] / (1 + theta[:, 0]))

    def _own(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the frequency (n,) with the structure at rest on the ground, for a new mode as in theta [rad/s].

        The ground's equation of motion at that frequency omega, with the structure's response:
        omega_o^2 / omega^2 = 1 + sum_r (phi_r^T M psi)^2 / m / (omega_r^2 / omega^2 - 1).
        """
        at = np.exp(self.new.log_frequency[self.mode[rows]] + theta[:, 1])
        answer = shaken(at[:, None], self.comparison.frequency)
        reaction = (self.part[rows] ** 2 * answer).sum(1) * self._share(theta, rows) / self.mass[rows]
        return np.asarray(2 * np.pi * at * np.sqrt(np.maximum(1 + reaction, _SOFTEST)))

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the log evidence of a ratio of any order, with the new mode explained."""
        del rows
        std = np.sqrt(covariance[:, 0, 0])
        found = log_uniform(theta[:, 0], std, gaussian=_RATIO_STD, least=_MIN_RATIO, most=_MAX_RATIO).log_ratio
        explained = log_explained(self.new, self.comparison.overdispersion)[np.unique(self.mode)]
        return np.asarray(found + np.log(2.0) + explained.mean())

    def where(self, fit: Fit[Cause]) -> Where:
        """Return the feet, and the middle between them."""
        feet, _ = self.grounds[fit.best]
        middle = vector(np.mean(feet, axis=0))
        return Where(member=None, position=middle, position_std=0.0, region=tuple((at, at) for at in feet))

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return mass and frequency of the ground without the structure; damping of the new mode."""
        row, theta = fit.best, fit.theta[fit.best]
        _, axis = self.grounds[row]
        turns = axis in _ROTATIONS
        of_mass, of_frequency = self._deviations(row, theta, fit.covariance[row])
        mass, frequency = self._ground(row, theta)
        damping, std = self.new.damping[self.mode[row]], self.new.damping_std[self.mode[row]]
        found = {
            f"{'inertia' if turns else 'mass'}_{axis}": Quantity(
                value=mass, std=of_mass, unit="kg m2" if turns else "kg"
            ),
            "frequency": Quantity(value=frequency, std=of_frequency, unit="Hz"),
        }
        if np.isfinite(damping + std):
            found["damping"] = Quantity(value=float(damping), std=float(std), unit="-")
        return found

    def _ground(self, row: int, theta: FloatArray) -> tuple[float, float]:
        """Return mass [kg] or [kg m2] and frequency [Hz] of the ground without the structure."""
        ratio = max(float(theta[0]), _LEAST * _MIN_RATIO)
        whole, mass = float(self.mass[row]) * (1 + 1 / ratio), float(self.mass[row]) / ratio
        total = whole * float(self._own(theta[None], np.array([row]))[0]) ** 2
        stiffness = max(total - float(self.held[row]), _SOFTEST * total)
        return mass, float(np.sqrt(stiffness / mass) / (2 * np.pi))

    def _deviations(self, row: int, theta: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return the standard deviations (2,) of mass and frequency to first order."""
        step = _STEP * np.sqrt(np.diag(covariance))
        moved = np.array([self._ground(row, theta + each) for each in np.diag(step)])
        slope = (moved - np.array(self._ground(row, theta))) / step[:, None]
        return np.sqrt(np.diag(slope.T @ covariance @ slope))

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Put the feet on the ground."""
        feet, axis = self.grounds[row]
        mass, frequency = self._ground(row, theta)
        ground = Ground(at=feet, axis=axis, mass=mass, frequency=frequency)
        return structure.model_copy(update={"ground": (*structure.ground, ground)})


def propose_ground_mode(reference: Reference, comparison: Comparison) -> GroundMode | None:
    """Return grounds under each foot and under all of them, by axis; none without a mode that the reference has not.

    None of very many members or of matrices, nor against a file without reference logs, where it was not measured how
    often one is named wrongly.
    """
    if reference.of_file:
        return None
    new = comparison.new
    unknown = not_known(reference, comparison) if new is not None else np.empty(0, np.intp)
    grounds = _grounds(reference.structure) if len(unknown) and may_be_cut(reference.structure) else []
    if new is None or not grounds:
        return None
    part, mass, held, moved = _static(reference, tuple(grounds), comparison.channels)
    # sensors read it with the errors with which they read the modes that it is made of
    moved = moved + part @ (comparison.baseline_at_channels - comparison.at_channels).T
    number, mode, ratio = (
        each.ravel() for each in np.meshgrid(np.arange(len(grounds)), unknown, _BEGUN, indexing="ij")
    )
    return GroundMode(
        prior_std=np.array([_RATIO_STD, _TUNED, _DAMPING_STD]),
        lower=np.tile([_LEAST * _MIN_RATIO, -np.inf, -np.inf], (len(number), 1)),
        drifting=True,
        comparison=comparison,
        reference=reference,
        new=new,
        grounds=tuple(grounds[k] for k in number.tolist()),
        mode=mode,
        part=part[number],
        mass=mass[number],
        held=held[number],
        moved=moved[number],
        begun=np.column_stack([ratio, np.zeros((len(ratio), 2))]),
    )


def _grounds(structure: Structure) -> list[tuple[tuple[Vector, ...], Axis]]:
    """Return the feet and the axis of each ground that would move some foot that is held along its motion."""
    feet = [(support,) for support in structure.support]
    together = [structure.support] if len(structure.support) > 1 else []
    found: dict[tuple[tuple[Vector, Axis], ...], tuple[tuple[Vector, ...], Axis]] = {}
    for supports in (*feet, *together):
        at = tuple(support.at for support in supports)
        for axis in AXES:
            moved = _moved(supports, Ground(at=at, axis=axis, mass=1.0, frequency=1.0))
            if moved:
                found.setdefault(moved, (at, axis))
    taken = {(at, ground.axis) for ground in structure.ground for at in ground.at}
    return [one for one in found.values() if not taken & {(at, one[1]) for at in one[0]}]


def _moved(supports: Sequence[Support], ground: Ground) -> tuple[tuple[Vector, Axis], ...]:
    """Return the held directions of supports that a ground moves."""
    return tuple(
        (support.at, axis)
        for support in supports
        for axis, motion in zip(AXES, ground.motion(support.at), strict=True)
        if motion and axis in {*support.fixed, *support.stiffness}
    )


@lru_cache(maxsize=4)
def _static(
    reference: Reference, grounds: tuple[tuple[tuple[Vector, ...], Axis], ...], channels: tuple[str, ...]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return Phi^T M psi (n, n_modes), psi^T M psi (n,), psi^T K psi (n,), psi at the channels (n, n_channels)."""
    model = best_model(_all_sprung(reference.structure))
    springs = [
        (support.at, axis, stiffness)
        for support in model.structure.support
        for axis, stiffness in support.stiffness.items()
    ]
    stiffness = np.array([spring for _, _, spring in springs])
    rows = np.array([model.support_rows(at, axis) for at, axis, _ in springs])
    motion = np.zeros((len(springs), len(grounds)))
    for j, (feet, way) in enumerate(grounds):
        ground = Ground(at=feet, axis=way, mass=1.0, frequency=1.0)
        motion[:, j] = [ground.motion(at)[AXES.index(axis)] for at, axis, _ in springs]
    load = rows.T @ (stiffness[:, None] * motion)
    psi = splu(sparse.csc_array(model.stiffness)).solve(load)
    held = stiffness @ motion**2 - (load * psi).sum(0)
    weighed = model.mass @ psi
    return (
        (_with_held(reference.model, model, reference.shape).T @ weighed).T,
        (psi * weighed).sum(0),
        np.maximum(held, 0.0),
        (channel_rows(model, channels) @ psi).T,
    )


def _all_sprung(structure: Structure) -> Structure:
    """Return a structure with stiff springs in the place of fixed axes of supports."""
    supports = []
    for support in structure.support:
        stiff = {axis: flexibility_unit(structure, axis, support.at) / _STIFF for axis in support.fixed}
        supports.append(support.model_copy(update={"fixed": (), "stiffness": {**support.stiffness, **stiff}}))
    return structure.model_copy(update={"support": tuple(supports)})


def _with_held(model: Model, sprung: Model, shape: FloatArray) -> FloatArray:
    """Return shapes (n_dofs, n_modes) at the DOFs of a model whose fixed axes are on springs: zero at these."""
    found = np.zeros((sprung.n_dofs, shape.shape[1]))
    free = model.dofs >= 0
    found[sprung.dofs[free]] = shape[model.dofs[free]]
    n, of_others = int(model.dofs.max()) + 1, int(sprung.dofs.max()) + 1
    found[of_others:] = shape[n:]  # grounds and oscillators
    return found
