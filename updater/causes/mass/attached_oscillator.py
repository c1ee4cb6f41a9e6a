"""Oscillator attached to the structure: a loose part, an appendage, a damper.

It adds a new mode. With z the motion relative to the structure along its direction d, times the root of its mass, the
modes' mass matrix increases by m Phi^T Phi and is bordered by m^1/2 Phi^T d, the flexibility by 1 / omega_o^2: exact in
the reference's modes. The shape of the new mode is the structure excited at one place, which determines the position;
the shifts of the other modes determine the mass.

If no mode is measured that the reference does not have, its own mode may move the sensors too little to be measured.
Its frequency is then free, and only the shifts of the other modes contain information.

To first order a mass on a spring that responds at omega acts along the spring like m / (1 - omega_i^2 / omega^2) on
mode i, and like m across it.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.special import gammaln

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.mass.added_mass import scale_error
from updater.inference import (
    Comparison,
    Effect,
    Fit,
    Magnitude,
    NewModes,
    PositionPosterior,
    beside,
    linear_in_mass,
    log_uniform,
    no_effect,
    shaken,
)
from updater.inference import fit as fit_all
from updater.quantities import Quantity, Where, vector
from updater.reference import Reference
from updater.structure import Oscillator, Structure, fineness, size

_COARSE = 0.02  # m between positions, less on structures of less than a metre and a half
_FINER = 10  # times, where the posterior is
_KEPT = 90  # of the alternatives, those that are nearest to the data to first order
_MAX = 2000  # positions that are looked at
_MAX_FINE = 60
_NEAR = 20.0  # of log density under the best
_MASS_STD = 0.1  # of the structure's mass, Gaussian prior while it is fitted
_MIN_MASS = 1e-4  # of the structure's mass
_DAMPING_STD = 1.0  # of ln of its own damping over the modes': a third of it to three times as much
_TUNED = 0.15  # of ln f: how far its own frequency may lie from the new mode's
_STEP = 0.15  # step of ln f between starting frequencies if no mode determines it; also the deviation of their prior
_TOLD = 0.05  # step of ln f between frequencies with stated probabilities
_STILL = 1e-4  # standard deviation of ln f that counts as fixed
_BEYOND = 1.3  # times the lowest and the highest mode that is seen: farther off it is a mass, or not there
_CHANCE = 0.1  # probability of a new mode without a cause, or one that was not measured before
# prior of an oscillator without a measured mode, relative to one with it: a rigid body has a similar effect
_UNSEEN = 0.01
_MIN_START = 0.01  # of the largest mass, from where a fit begins
_SAME_FREQUENCY, _SAME_SHAPE = 0.1, 0.6  # of ln f, and MAC: a mode of the reference that was not seen before


@dataclass(frozen=True, eq=False, kw_only=True)
class AttachedOscillator:
    """Places, directions and new modes; parameters are mass [kg], ln f from the new mode's, and ln of its own damping.

    The latter is relative to that of the structure's modes, which share it as they share its energy. If its mode is not
    measured, positions, directions and starting frequencies.
    """

    reference: Reference
    comparison: Comparison
    new: NewModes | None  #: new modes that the reference does not have; None: the oscillator's mode is not measured
    log_frequency: FloatArray  #: (n_begun,) of the new modes, or that are begun from [ln Hz]
    member: IndexArray  #: (n,) of the structure's members
    position: FloatArray  #: (n,) distance from the member's start [m]
    axis: IndexArray  #: (n,) of the member's local axes, 0 along it
    mode: IndexArray  #: (n,) which of these frequencies
    translation: FloatArray  #: (n, 3, n_modes) of the reference's modes there, along the member's local axes
    log_prior: FloatArray  #: (n,)
    start: FloatArray  #: (n, 3)
    gap: float  #: between positions where they are not finer [m]
    name: str = "attached_oscillator"
    cannot_be_told_from: tuple[str, ...] = ()
    drifting: bool = True
    place_free: bool = False
    advice: str = "Look for a loose part at this place and fix it: the new mode must disappear."

    @property
    def _total(self) -> float:
        return self.reference.model.total_mass()

    @property
    def neutral_start(self) -> FloatArray:
        """Without mass, tuned to the mode that it is tried at."""
        return np.zeros(self.start.shape)

    @property
    def prior_std(self) -> FloatArray:
        """Mass [kg], ln f and ln of damping."""
        return np.array([_MASS_STD * self._total, _TUNED if self.new else _STEP, _DAMPING_STD])

    @property
    def lower(self) -> FloatArray:
        """It has a mass."""
        return np.tile([0.1 * _MIN_MASS * self._total, -np.inf, -np.inf], (len(self.member), 1))

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the mass that moves with the structure, and its coupling."""
        at, mass = self.translation[rows], theta[:, 0]
        along = np.take_along_axis(at, self.axis[rows, None, None], axis=1)[:, 0]
        omega = 2 * np.pi * np.exp(self.log_frequency[self.mode[rows]] + theta[:, 1])
        return replace(
            no_effect(len(rows), self.comparison),
            mass=mass[:, None, None] * (at.transpose(0, 2, 1) @ at),
            coupling=np.sqrt(mass)[:, None, None] * along[:, :, None],
            own=omega[:, None] ** -2.0,
            own_log_damping=theta[:, 2:],
            carried=np.zeros((len(rows), len(self.comparison.channels), 1)),
        )

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the log evidence of a mass of any order, with the new mode explained or not measured."""
        del rows
        mass = self._magnitude(theta[:, 0], np.sqrt(covariance[:, 0, 0])).log_ratio
        if self.new is None:
            return np.asarray(mass + np.log(_UNSEEN))
        explained = log_explained(self.new, self.comparison.overdispersion)[np.unique(self.mode)]
        # several new modes are equivalent: together with others only one remains here
        return np.asarray(mass + explained.mean())

    def _magnitude(self, mass: FloatArray, std: FloatArray) -> Magnitude:
        """Return posteriors of masses under a prior uniform in the logarithm; of its two signs one is possible."""
        found = log_uniform(
            mass, std, gaussian=_MASS_STD * self._total, least=_MIN_MASS * self._total, most=self._total
        )
        return replace(found, log_ratio=found.log_ratio + np.log(2.0))

    def refined(self, log_density: FloatArray, theta: FloatArray) -> Self:
        """Return positions closer together about the likely ones, of the same direction and mode."""
        near = np.flatnonzero(log_density > log_density.max() - _NEAR)
        near = near[np.argsort(-log_density[near])]
        steps = np.linspace(-self.gap, self.gap, 2 * _FINER + 1)
        chosen: dict[tuple[int, int, int, float], int] = {}
        for row in near.tolist():
            length = self.reference.structure.member[self.member[row]].length
            for at in np.clip(self.position[row] + steps, 0, length):
                key = int(self.member[row]), int(self.axis[row]), int(self.mode[row]), round(float(at), 6)
                chosen.setdefault(key, row)
            if len(chosen) > _MAX_FINE:
                break
        keys = sorted(chosen)
        columns = [np.array(column) for column in zip(*keys, strict=True)]
        source = np.array([chosen[key] for key in keys])
        refined = self.log_prior[source] + np.log(1 / _FINER)
        return replace(
            self,
            member=columns[0],
            axis=columns[1],
            mode=columns[2],
            position=columns[3],
            translation=translations(self.reference, columns[0], columns[3]),
            log_prior=refined,
            start=theta[source],
        )

    def _alike(self, fit: Fit[Cause]) -> IndexArray:
        """Return the alternatives of the best one's direction and new mode, by member and position."""
        same = self.mode == self.mode[fit.best] if self.new else np.ones(len(self.mode), bool)
        own = np.flatnonzero((self.axis == self.axis[fit.best]) & same)
        return own[np.lexsort((self.position[own], self.member[own]))]

    def where(self, fit: Fit[Cause]) -> Where:
        """Return mean of the most probable place, and the region."""
        own = self._alike(fit)
        return PositionPosterior(
            members=self.reference.structure.member,
            member=self.member[own],
            position=self.position[own],
            probability=fit.probability[own] / fit.probability[own].sum(),
            length=np.ones(len(own)),
            scale=size(self.reference.structure),
            resolution=self.gap / _FINER,
        ).where

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return mass and own frequency, averaged over the places; damping of the new mode where it was seen."""
        own = self._alike(fit)
        share = fit.probability[own] / fit.probability[own].sum()
        magnitude = self._magnitude(fit.theta[own, 0], np.sqrt(fit.covariance[own, 0, 0]))
        mass = float(share @ magnitude.mean)
        variance = float(share @ (magnitude.variance + (magnitude.mean - mass) ** 2))
        std = float(np.hypot(np.sqrt(variance), scale_error(self.reference, self.comparison) * mass))
        each = self.log_frequency[self.mode[own]] + fit.theta[own, 1]
        variances = fit.covariance[own, 1, 1]
        if self.new is None:
            each, variances, share = self._tunings(fit)
        log_f = float(share @ each)
        spread = float(np.sqrt(share @ (variances + (each - log_f) ** 2)))
        frequency = float(np.exp(log_f))
        found = {
            "mass": Quantity(value=mass, std=std, unit="kg"),
            "frequency": Quantity(value=frequency, std=frequency * spread, unit="Hz"),
        }
        if self.new is not None:
            damping, std = self.new.damping[self.mode[fit.best]], self.new.damping_std[self.mode[fit.best]]
            if np.isfinite(damping + std):
                found["damping"] = Quantity(value=float(damping), std=float(std), unit="-")
        return found

    def _tunings(self, fit: Fit[Cause]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return own frequencies at the best place (n,) [ln Hz], their variances and probabilities.

        A mode that is not measured may be in a range where hardly any mode is sensitive to it: its density is far from
        a Gaussian about the fitted values.
        """
        best = fit.best
        at = float(self.log_frequency[self.mode[best]] + fit.theta[best, 1])
        near = at + np.sqrt(fit.covariance[best, 1, 1]) * np.linspace(-4, 4, 33)
        begun, still = _begun(self.comparison), np.array([fit.theta[best, 0], 0.0, fit.theta[best, 2]])
        grid = np.union1d(near, np.arange(begun[0], begun[-1], _TOLD))
        n, one = len(grid), np.full(len(grid), best)
        held = _Held(
            **vars(self)
            | {name: getattr(self, name)[one] for name in ("member", "position", "axis", "translation", "log_prior")}
            | {
                "log_frequency": grid,
                "mode": np.arange(n),
                "start": np.tile(still, (n, 1)),
            }
        )
        density = fit_all(self.comparison, held, refine=False).log_density
        share = np.exp(density - density.max()) * np.gradient(grid)
        return grid, np.zeros(n), share / share.sum()

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Add the oscillator."""
        member = self.reference.structure.member[self.member[row]]
        way = member.axes[self.axis[row]]
        oscillator = Oscillator(
            at=vector(member.point(float(self.position[row]))),
            direction=vector(np.round(way, 9)),
            mass=float(theta[0]),
            frequency=float(np.exp(self.log_frequency[self.mode[row]] + theta[1])),
        )
        return structure.model_copy(update={"oscillator": (*structure.oscillator, oscillator)})


class _Held(AttachedOscillator):
    """An oscillator with its starting frequency fixed."""

    @property
    def prior_std(self) -> FloatArray:
        """Mass [kg], ln f and ln of damping."""
        return np.array([_MASS_STD * self._total, _STILL, _DAMPING_STD])


def propose_attached_oscillator(reference: Reference, comparison: Comparison) -> AttachedOscillator | None:
    """Return the positions and directions with the best agreement with a new mode, or with the shifts of the others.

    None if every new mode is one that the reference has.
    """
    new = comparison.new
    unknown = not_known(reference, comparison) if new is not None else np.empty(0, np.intp)
    if new is not None and not len(unknown):
        return None
    members = reference.structure.member
    length = sum(member.length for member in members)
    gap = max(_COARSE * fineness(reference.structure), length / _MAX)
    grids = [np.linspace(0, m.length, max(2, round(m.length / gap)) + 1) for m in members]
    member = np.repeat(np.arange(len(members)), [len(grid) for grid in grids])
    position = np.concatenate(grids)
    translation = translations(reference, member, position)
    largest = _MASS_STD * reference.model.total_mass()
    if new is not None:
        frequencies = new.log_frequency
        looked = [shaking(comparison, new, int(mode), translation, largest) for mode in unknown]
    else:
        frequencies = _begun(comparison)
        unknown = np.arange(len(frequencies))
        looked = hung(comparison, translation, np.exp(frequencies), largest)
    misfit, start = (np.stack(parts) for parts in zip(*looked, strict=True))  # (n_new, n, 3), (n_new, n, 3, 2)
    kept = np.sort(np.argsort(misfit, axis=None)[:_KEPT])
    mode, place, axis = np.unravel_index(kept, misfit.shape)
    alternatives = np.log(gap / length) - np.log(3 * len(unknown))  # the rest of the prior is where nothing fits
    return AttachedOscillator(
        reference=reference,
        comparison=comparison,
        new=new,
        log_frequency=frequencies,
        member=member[place],
        position=position[place],
        axis=axis.astype(np.intp),
        mode=unknown[mode],
        translation=translation[place],
        log_prior=np.full(len(kept), alternatives),
        start=np.pad(start[mode, place, axis], ((0, 0), (0, 1))),
        gap=gap,
    )


def has_unobserved_mode(cause: object) -> bool:
    """Return whether a cause is an oscillator whose mode is not measured."""
    return isinstance(cause, AttachedOscillator) and cause.new is None


def _begun(comparison: Comparison) -> FloatArray:
    """Return own frequencies to begin from where no new mode is seen [ln Hz]."""
    seen = np.log(comparison.frequency[comparison.paired])
    return np.arange(seen.min() - np.log(_BEYOND), seen.max() + np.log(_BEYOND), _STEP)


def log_explained(new: NewModes, overdispersion: float) -> FloatArray:
    """Return the log density of new modes (n_extra,) that fit to their noise, relative to modes without a cause.

    The latter come with a small probability, anywhere near in frequency, with any shape: uniform on half the sphere.
    """
    n = new.shape.shape[1]
    frequency = np.log(_TUNED / new.log_frequency_std)
    area = 0.5 * n * np.log(np.pi) - gammaln(n / 2)  # of half the unit sphere in n dimensions
    peak = (n - 1) * (np.linalg.slogdet(new.whitener)[1] / n - 0.5 * np.log(2 * np.pi))
    return np.asarray(frequency + (peak + area) / overdispersion - np.log(_CHANCE))


def not_known(reference: Reference, comparison: Comparison) -> IndexArray:
    """Return the new modes without a counterpart in the reference; a counterpart existed before."""
    new = comparison.new
    assert new is not None
    others = np.setdiff1d(np.arange(len(reference.frequency)), reference.paired)
    shape = comparison.at_channels[:, others]
    assurance = (new.shape @ shape) ** 2 / np.maximum((shape**2).sum(0), 1e-300)
    near = np.abs(new.log_frequency[:, None] - np.log(reference.frequency[others])) < _SAME_FREQUENCY
    return np.flatnonzero(~(near & (assurance > _SAME_SHAPE)).any(1))


def translations(reference: Reference, member: IndexArray, position: FloatArray) -> FloatArray:
    """Return the modes' translations (n, 3, n_modes) along the local axes of members at distances from their starts."""
    structure, model = reference.structure, reference.model
    members = structure.member
    points = np.array([members[m].point(float(s)) for m, s in zip(member.tolist(), position.tolist(), strict=True)])
    moved = (model.reader(points) @ reference.shape).reshape(len(points), 6, -1)[:, :3]
    axes = np.array([m.axes for m in members])
    return np.asarray(axes[member] @ moved)


def shaking(
    comparison: Comparison, new: NewModes, mode: int, translation: FloatArray, largest: float
) -> tuple[FloatArray, FloatArray]:
    """Return how badly each place and direction (n, 3) explains a new mode, and where its fit begins (n, 3, 2).

    A mass m on a spring that answers at omega acts along its direction like m / (1 - omega_i^2 / omega^2) on a mode
    omega_i, and like m across it; the structure shaken there moves by the sum of phi phi_s / (omega_r^2 - omega^2).
    """
    answer = shaken(np.exp(new.log_frequency[mode]), comparison.frequency)
    shape = (translation * answer) @ comparison.baseline_at_channels.T
    shape = np.where(np.linalg.norm(shape, axis=-1, keepdims=True) > 0, shape, 1.0)
    off = ((beside(new.shape[mode], shape) @ new.whitener[mode].T) ** 2).sum(-1)
    squared = translation[:, :, comparison.paired] ** 2
    across = squared.sum(1, keepdims=True) - squared
    whitener = comparison.drifting.matrix
    effect = -0.5 * (across - squared * answer[comparison.paired]) @ whitener.T
    shift = whitener @ comparison.log_ratio
    mass = effect @ shift / np.maximum((effect**2).sum(-1), 1e-12)
    mass = np.clip(mass, _MIN_START * largest, largest)
    off += ((shift - mass[:, :, None] * effect) ** 2).sum(-1)
    # the structure's receptance at its foot: omega_o^2 = omega^2 / (1 - m sum phi_s^2 / (omega_r^2 / omega^2 - 1))
    foot = np.clip(mass * (translation**2 * answer).sum(-1), -0.3, 0.3)
    return np.asarray(off), np.stack([mass, -0.5 * np.log(1 - foot)], axis=-1)


def hung(
    comparison: Comparison, translation: FloatArray, own: FloatArray, largest: float
) -> list[tuple[FloatArray, FloatArray]]:
    """Return the chi-square residual of a mass on a spring at each position, in each direction, and the start of a fit.

    A mass that responds at omega acts along its direction like m / (1 - omega_i^2 / omega^2) on mode i, and like m
    across it.

    Parameters
    ----------
    translation : (n, 3, n_modes) of the reference's modes at the places, along the directions
    own : (n_own,) frequencies at which it may answer [Hz]
    largest : standard deviation of the mass beforehand [kg], and the most that a fit begins from

    Returns
    -------
    for each own frequency: (n, 3) minus the gain in chi-square, and (n, 3, 2) mass [kg] and zero
    """
    linear, paired = linear_in_mass(comparison), comparison.paired
    along = translation[:, :, paired]  # (n, 3, n_compared)
    shift = np.einsum("pai,ij->paij", along**2, linear.by_shift.T)
    turned = np.einsum("pai,pak,ikc->paic", along, translation, linear.by_coupling, optimize=True)
    found = []
    for frequency in own.tolist():
        more = -shaken(np.array(frequency), comparison.frequency[paired]) - 1  # than the mass alone, along it
        by_shift = shift.sum((1, 2))[:, None] + np.einsum("i,paij->paj", more, shift)
        by_turn = turned.sum(1)[:, None] + more[:, None] * turned
        rest = by_shift @ linear.log_ratio + np.einsum("paic,ic->pa", by_turn, linear.shape)
        slope = (by_shift**2).sum(-1) + (by_turn**2).sum((-1, -2)) + largest**-2
        mass = np.clip(rest / slope, 0.0, largest)
        left = slope * mass**2 - 2 * rest * mass
        found.append((left, np.stack([mass, np.zeros(mass.shape)], axis=-1)))
    return found
