"""Something that hangs on the structure by a spring of its own: a loose part, an appendage, a damper.

It brings a mode that was not there. With z its motion beside the structure's along its direction d, times the root of
its mass, the modes' mass matrix grows by m Phi^T Phi and is bordered by m^1/2 Phi^T d, the flexibility by
1 / omega_o^2: exact in the reference's modes. The new mode's shape is the structure shaken at one place, which says
where; how far the other modes make way says how heavy it is.

Proposed only where a mode is seen that the reference does not know.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln

from daq import FloatArray, IndexArray
from updater.causes.magnitude import Magnitude, log_uniform
from updater.comparison import Comparison, NewModes, shaken
from updater.fe.element import local_axes
from updater.posterior import credible, places
from updater.reanalysis import Effect, no_effect
from updater.reference import Reference
from updater.shape_errors import beside
from updater.structure import Oscillator, Structure
from updater.verdict import Quantity, Where, vector

if TYPE_CHECKING:
    from updater.causes.base import Cause
    from updater.fit import Fit

_COARSE = 0.02  # m between positions
_FINE = 0.002  # m between them where the posterior is
_KEPT = 90  # of the alternatives, those that are nearest to the data to first order
_MOST = 2000  # positions that are looked at
_MOST_FINE = 60
_NEAR = 20.0  # of log density under the best
_MASS_STD = 0.1  # of the structure's mass, Gaussian prior while it is fitted
_LEAST_MASS = 1e-4  # of the structure's mass
_LEAST_START = 1e-3  # of the structure's mass, from where a fit begins
_TUNED = 0.15  # of ln f: how far its own frequency may lie from the new mode's
_CHANCE = 0.1  # probability of a new mode that is nobody's, or was not seen before
_SAME_FREQUENCY, _SAME_SHAPE = 0.1, 0.6  # of ln f, and MAC: a mode of the reference that was not seen before


@dataclass(frozen=True, eq=False, kw_only=True)
class AttachedOscillator:
    """Places, directions and new modes; parameters are mass [kg] and ln f, from the new mode's."""

    reference: Reference
    comparison: Comparison
    new: NewModes
    member: IndexArray  #: (n,) of the structure's members
    position: FloatArray  #: (n,) distance from the member's start [m]
    axis: IndexArray  #: (n,) of the member's local axes, 0 along it
    mode: IndexArray  #: (n,) which of the new modes
    translation: FloatArray  #: (n, 3, n_modes) of the reference's modes there, along the member's local axes
    log_prior: FloatArray  #: (n,)
    start: FloatArray  #: (n, 2)
    name: str = "attached_oscillator"
    cannot_be_told_from: tuple[str, ...] = ()
    drifting: bool = True
    place_free: bool = False
    advice: str = "Look for something loose at the place that is named, and hold it: the new mode must go."

    @property
    def _total(self) -> float:
        return self.reference.calibration.model.total_mass()

    @property
    def prior_std(self) -> FloatArray:
        """Mass [kg] and ln f."""
        return np.array([_MASS_STD * self._total, _TUNED])

    @property
    def lower(self) -> FloatArray:
        """It has a mass."""
        return np.tile([0.1 * _LEAST_MASS * self._total, -np.inf], (len(self.member), 1))

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the mass that rides on the structure, and what is coupled with it."""
        at, mass = self.translation[rows], theta[:, 0]
        along = np.take_along_axis(at, self.axis[rows, None, None], axis=1)[:, 0]
        omega = 2 * np.pi * np.exp(self.new.log_frequency[self.mode[rows]] + theta[:, 1])
        return replace(
            no_effect(len(rows), self.comparison),
            mass=mass[:, None, None] * (at.transpose(0, 2, 1) @ at),
            coupling=np.sqrt(mass)[:, None, None] * along[:, :, None],
            own=omega[:, None] ** -2.0,
        )

    def log_ratio(self, theta: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return what a mass of any order makes of the evidence, and that the new mode is somebody's."""
        mass = self._magnitude(theta[:, 0], np.sqrt(covariance[:, 0, 0])).log_ratio
        explained = _log_explained(self.new, self.comparison.overdispersion)[np.unique(self.mode)]
        return np.asarray(mass + explained.mean())  # of several new modes alike: beside others only one is left here

    def _magnitude(self, mass: FloatArray, std: FloatArray) -> Magnitude:
        """Return posteriors of masses under a prior uniform in the logarithm; of its two signs one is possible."""
        found = log_uniform(
            mass, std, gaussian=_MASS_STD * self._total, least=_LEAST_MASS * self._total, most=self._total
        )
        return replace(found, log_ratio=found.log_ratio + np.log(2.0))

    def finer(self, log_density: FloatArray, theta: FloatArray) -> "AttachedOscillator":
        """Return positions closer together about the likely ones, of the same direction and mode."""
        near = np.flatnonzero(log_density > log_density.max() - _NEAR)
        near = near[np.argsort(-log_density[near])]
        steps = np.arange(-_COARSE, _COARSE + _FINE / 2, _FINE)
        chosen: dict[tuple[int, int, int, float], int] = {}
        for row in near.tolist():
            length = self.reference.calibration.structure.member[self.member[row]].length
            for at in np.clip(self.position[row] + steps, 0, length):
                key = int(self.member[row]), int(self.axis[row]), int(self.mode[row]), round(float(at), 6)
                chosen.setdefault(key, row)
            if len(chosen) > _MOST_FINE:
                break
        keys = sorted(chosen)
        columns = [np.array(column) for column in zip(*keys, strict=True)]
        source = np.array([chosen[key] for key in keys])
        finer = self.log_prior[source] + np.log(_FINE / _COARSE)
        return replace(
            self,
            member=columns[0],
            axis=columns[1],
            mode=columns[2],
            position=columns[3],
            translation=_translations(self.reference, columns[0], columns[3]),
            log_prior=finer,
            start=theta[source],
        )

    def _alike(self, fit: "Fit[Cause]") -> IndexArray:
        """Return the alternatives of the best one's direction and mode, by member and position."""
        best = fit.best
        own = np.flatnonzero((self.axis == self.axis[best]) & (self.mode == self.mode[best]))
        return own[np.lexsort((self.position[own], self.member[own]))]

    def where(self, fit: "Fit[Cause]") -> Where:
        """Return mean of the most probable place, and the region."""
        own = self._alike(fit)
        probability = fit.probability[own] / fit.probability[own].sum()
        member, position = self.member[own], self.position[own]
        place = places(member, position, probability, probability)[0]
        mean = float(place.share @ position)
        std = float(np.sqrt(place.share @ (position - mean) ** 2 + _FINE**2 / 12))
        members = self.reference.calibration.structure.member
        return Where(
            member=members[place.member].name,
            position=vector(members[place.member].point(mean)),
            position_std=std,
            region=tuple(
                (vector(members[m].point(a)), vector(members[m].point(b)))
                for m, a, b in credible(member, position, probability, probability)
            ),
        )

    def parameters(self, fit: "Fit[Cause]") -> dict[str, Quantity]:
        """Return mass and own frequency, averaged over the places; damping of the new mode where it was seen."""
        own = self._alike(fit)
        share = fit.probability[own] / fit.probability[own].sum()
        magnitude = self._magnitude(fit.theta[own, 0], np.sqrt(fit.covariance[own, 0, 0]))
        mass = float(share @ magnitude.mean)
        variance = float(share @ (magnitude.variance + (magnitude.mean - mass) ** 2))
        log_f = float(share @ fit.theta[own, 1])
        spread = float(np.sqrt(share @ (fit.covariance[own, 1, 1] + (fit.theta[own, 1] - log_f) ** 2)))
        frequency = float(np.exp(self.new.log_frequency[self.mode[fit.best]] + log_f))
        found = {
            "mass": Quantity(value=mass, std=variance**0.5, unit="kg"),
            "frequency": Quantity(value=frequency, std=frequency * spread, unit="Hz"),
        }
        damping, std = self.new.damping[self.mode[fit.best]], self.new.damping_std[self.mode[fit.best]]
        if np.isfinite(damping + std):
            found["damping"] = Quantity(value=float(damping), std=float(std), unit="-")
        return found

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Add the oscillator."""
        member = self.reference.calibration.structure.member[self.member[row]]
        way = local_axes(np.subtract(member.end, member.start), member.local_y)[self.axis[row]]
        oscillator = Oscillator(
            at=vector(member.point(float(self.position[row]))),
            direction=vector(np.round(way, 9)),
            mass=float(theta[0]),
            frequency=float(np.exp(self.new.log_frequency[self.mode[row]] + theta[1])),
        )
        return structure.model_copy(update={"oscillator": (*structure.oscillator, oscillator)})


def propose_attached_oscillator(reference: Reference, comparison: Comparison) -> AttachedOscillator | None:
    """Return the places and directions whose shaking looks most like a new mode; None if there is none."""
    new = comparison.new
    unknown = _unknown(reference, comparison) if new is not None else np.empty(0, np.intp)
    if new is None or not len(unknown):
        return None
    members = reference.calibration.structure.member
    length = sum(member.length for member in members)
    gap = max(_COARSE, length / _MOST)
    grids = [np.linspace(0, m.length, max(2, round(m.length / gap)) + 1) for m in members]
    member = np.repeat(np.arange(len(members)), [len(grid) for grid in grids])
    position = np.concatenate(grids)
    translation = _translations(reference, member, position)
    total = reference.calibration.model.total_mass()
    looked = [_first_order(comparison, new, int(mode), translation, total) for mode in unknown]
    misfit, start = (np.stack(parts) for parts in zip(*looked, strict=True))  # (n_new, n, 3), (n_new, n, 3, 2)
    kept = np.sort(np.argsort(misfit, axis=None)[:_KEPT])
    mode, place, axis = np.unravel_index(kept, misfit.shape)
    alternatives = np.log(gap / length) - np.log(3 * len(unknown))  # the rest of the prior is where nothing fits
    return AttachedOscillator(
        reference=reference,
        comparison=comparison,
        new=new,
        member=member[place],
        position=position[place],
        axis=axis.astype(np.intp),
        mode=unknown[mode],
        translation=translation[place],
        log_prior=np.full(len(kept), alternatives),
        start=start[mode, place, axis],
    )


def _unknown(reference: Reference, comparison: Comparison) -> IndexArray:
    """Return the new modes that the reference has none for: what it has was there before, and was not seen."""
    new = comparison.new
    assert new is not None
    others = np.setdiff1d(np.arange(len(reference.frequency)), reference.paired)
    shape = comparison.at_channels[:, others]
    assurance = (new.shape @ shape) ** 2 / np.maximum((shape**2).sum(0), 1e-300)
    near = np.abs(new.log_frequency[:, None] - np.log(reference.frequency[others])) < _SAME_FREQUENCY
    return np.flatnonzero(~(near & (assurance > _SAME_SHAPE)).any(1))


def _translations(reference: Reference, member: IndexArray, position: FloatArray) -> FloatArray:
    """Return the modes' translations (n, 3, n_modes) along the local axes of members at distances from their starts."""
    structure, model = reference.calibration.structure, reference.calibration.model
    members = structure.member
    points = np.array([members[m].point(float(s)) for m, s in zip(member.tolist(), position.tolist(), strict=True)])
    moved = (model.reader(points) @ reference.shape).reshape(len(points), 6, -1)[:, :3]
    axes = np.array([local_axes(np.subtract(m.end, m.start), m.local_y) for m in members])
    return np.asarray(axes[member] @ moved)


def _first_order(
    comparison: Comparison, new: NewModes, mode: int, translation: FloatArray, total: float
) -> tuple[FloatArray, FloatArray]:
    """Return how badly each place and direction (n, 3) explains a new mode, and where its fit begins (n, 3, 2).

    A mass m on a spring that answers at omega acts along its direction like m / (1 - omega_i^2 / omega^2) on a mode
    omega_i, and like m across it; the structure shaken there moves by the sum of phi phi_s / (omega_r^2 - omega^2).
    """
    answer = shaken(np.exp(new.log_frequency[mode]), comparison.frequency)
    shape = (translation * answer) @ comparison.heard_at_channels.T
    shape = np.where(np.linalg.norm(shape, axis=-1, keepdims=True) > 0, shape, 1.0)
    off = ((beside(new.shape[mode], shape) @ new.whitener[mode].T) ** 2).sum(-1)
    squared = translation[:, :, comparison.paired] ** 2
    across = squared.sum(1, keepdims=True) - squared
    whitener = comparison.drifting.matrix
    effect = -0.5 * (across - squared * answer[comparison.paired]) @ whitener.T
    shift = whitener @ comparison.log_ratio
    mass = effect @ shift / np.maximum((effect**2).sum(-1), 1e-12)
    mass = np.clip(mass, _LEAST_START * total, _MASS_STD * total)
    off += ((shift - mass[:, :, None] * effect) ** 2).sum(-1)
    # the structure's receptance at its foot: omega_o^2 = omega^2 / (1 - m sum phi_s^2 / (omega_r^2 / omega^2 - 1))
    foot = np.clip(mass * (translation**2 * answer).sum(-1), -0.3, 0.3)
    return np.asarray(off), np.stack([mass, -0.5 * np.log(1 - foot)], axis=-1)


def _log_explained(new: NewModes, overdispersion: float) -> FloatArray:
    """Return the log density of new modes (n_extra,) that fit to their noise, over that of modes that are nobody's.

    The latter come with a small probability, anywhere near in frequency, with any shape: uniform on half the sphere.
    """
    n = new.shape.shape[1]
    frequency = np.log(_TUNED / new.log_frequency_std)
    area = 0.5 * n * np.log(np.pi) - gammaln(n / 2)  # of half the unit sphere in n dimensions
    peak = (n - 1) * (np.linalg.slogdet(new.whitener)[1] / n - 0.5 * np.log(2 * np.pi))
    return np.asarray(frequency + (peak + area) / overdispersion - np.log(_CHANCE))
