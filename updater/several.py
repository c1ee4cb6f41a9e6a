"""How many masses were added, where, and how much: one to a few, the number chosen by evidence."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from daq import FloatArray
from updater.causes.added_mass import AddedMass, propose_added_mass
from updater.causes.bodies import PER_BODY, Bodies
from updater.causes.nothing import Nothing
from updater.comparing import compare
from updater.comparison import Comparison
from updater.fit import Fit, fit
from updater.localization import FITS, MODEL_ERRORS, MassChange, mass_change
from updater.mass_scans import same_places, starts
from updater.reference import Reference
from updater.statistics import ModalMean

_FURTHER = 0.02  # probability of one mass more over that of one fewer, beforehand
_SAME = 0.02  # m: two ends nearer than this are one maximum, or nearer than two of its standard deviations
_ROUGH = 0.1  # of a mode's displacement: the search's model error, since masses act to first order only in its scans
_ROUNDS = 4
_NEAR = 30.0  # of chi-square over the best: what must have come to rest
_ENOUGH = 0.1  # of chi-square: rest
_LEAST_P = 1e-3  # of chi-square, over which something fits


@dataclass(frozen=True, eq=False, kw_only=True)
class MassChanges:
    """Located masses."""

    masses: tuple[MassChange, ...]  #: the most probable number of them, the largest first; none if nothing was added
    probability: FloatArray  #: (most + 1,) of no mass, one, two, ...; 0 where not tried [-]
    p_value: float  #: chance of a worse fit if this is what happened [-]

    @property
    def number(self) -> int:
        """The most probable number of masses."""
        return len(self.masses)


def locate_masses(reference: Reference, event: ModalMean, *, most: int = 3) -> MassChanges:
    """Locate masses that were added or removed together, and choose their number by evidence.

    None and one are as probable beforehand, each further one a fiftieth as probable as one fewer. Each must earn its
    five parameters (Laplace), so that one body is not taken for two near one another, or for itself and another where
    nothing moves and no data speak. The first that does not, where something fits, is the last that is tried.

    Parameters
    ----------
    reference : learnt before the change
    event : (n_tracks,) mean of the windows since the change
    most : largest number to try

    Raises
    ------
    ModalDataError
        If fewer than three modes can be compared, or what is compared cannot be right.
    """
    for error in MODEL_ERRORS:
        found = _counted(reference, event, most, error)
        if found.p_value >= FITS:
            break
    masses = [mass_change(part, error) for part in found.each()]
    return MassChanges(
        masses=tuple(sorted(masses, key=lambda change: -abs(change.mass))),
        probability=_shares(found.log_evidence, most + 1),
        p_value=found.p_value,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Counted:
    """Fits of none, one, two, ... masses."""

    single: Fit[AddedMass]
    sets: list[Fit[Bodies]]  #: of two, three, ...
    log_evidence: list[float]  #: of none, one, two, ...
    p_values: list[float]

    @property
    def best(self) -> int:
        return int(np.argmax(self.log_evidence))

    @property
    def p_value(self) -> float:
        return self.p_values[self.best]

    def each(self) -> list[Fit[AddedMass]]:
        """Return the fit of each mass of the best number."""
        if self.best < 2:
            return [self.single][: self.best]
        return _each(self.single.hypotheses.comparison, self.sets[self.best - 2])


def _counted(reference: Reference, event: ModalMean, most: int, error: float) -> _Counted:
    """Fit up to `most` masses with some model error."""
    data, rough = compare(reference, event, model_error=error), compare(reference, event, model_error=_ROUGH)
    grid = propose_added_mass(reference, data)
    nothing, single = fit(data, Nothing(comparison=data)), fit(data, grid)
    evidence = [nothing.log_evidence, single.log_evidence]
    p_values = [nothing.p_value, single.p_value]
    sets: list[Fit[Bodies]] = []
    for number in range(2, most + 1):
        sought = _settled(rough, starts(rough, grid, number, sets[-1] if sets else single))
        sets.append(_settled(data, replace(sought.hypotheses, start=sought.theta)))
        evidence.append(_log_evidence(sets[-1]) + (number - 1) * float(np.log(_FURTHER)))
        p_values.append(sets[-1].p_value)
        if evidence[-1] < evidence[-2] and max(p_values) > _LEAST_P:
            break
    return _Counted(single=single, sets=sets, log_evidence=evidence, p_values=p_values)


def _shares(evidence: list[float], n: int) -> FloatArray:
    """Return probabilities (n,), those of numbers that were not tried 0."""
    log = np.r_[evidence, np.full(n - len(evidence), -np.inf)]
    return np.asarray(np.exp(log - logsumexp(log)))


def _settled(data: Comparison, bodies: Bodies) -> Fit[Bodies]:
    """Fit sets of bodies until none moves on: one round of steps is enough near an end, not from a scan's places."""
    found = fit(data, bodies, refine=False)
    for _ in range(_ROUNDS):
        before, found = found, fit(data, replace(bodies, start=found.theta), refine=False)
        if (before.chi_square - found.chi_square)[found.chi_square < found.chi_square.min() + _NEAR].max() < _ENOUGH:
            break
    return found


def _positions(found: Fit[Bodies]) -> FloatArray:
    """Return where the bodies of each alternative ended (n_alternatives, n_bodies) [m]."""
    return found.hypotheses.place + found.theta.reshape(*found.hypotheses.place.shape, PER_BODY)[..., 0]


def _log_evidence(found: Fit[Bodies]) -> float:
    """Sum the evidence of separate maxima: starts that ended within one another's reach count once, the best."""
    ends, members = _positions(found), found.hypotheses.member
    variance = np.diagonal(found.covariance, axis1=1, axis2=2).reshape(*ends.shape, PER_BODY)[..., 0]
    reach = np.maximum(_SAME, 2 * np.sqrt(variance))
    kept: list[int] = []
    for row in np.argsort(-found.log_density):
        if not any(same_places(ends[row], members[row], ends[o], members[o], reach[o]) for o in kept):
            kept.append(int(row))
    return float(logsumexp((found.log_density + found.hypotheses.log_prior)[kept]))


def _each(data: Comparison, found: Fit[Bodies]) -> list[Fit[AddedMass]]:
    """Return each body of the best set with its own posterior over all positions, the others fitted along."""
    row, grid = int(np.argmax(found.log_density)), found.hypotheses.grid
    theta = found.theta[row]
    fits = []
    for k in range(found.hypotheses.n_bodies):
        own = theta[k * PER_BODY + 1 : (k + 1) * PER_BODY]
        free = replace(grid, start=np.tile(own, (len(grid.position), 1)))
        whole = fit(data, found.hypotheses.at(row, theta, k).beside(free))
        fits.append(whole.hypotheses.of_free(whole))
    return fits
