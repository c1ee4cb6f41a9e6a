"""Location of one to a few added or removed masses, their number by evidence."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaln, logsumexp, ndtr, softmax

from daq import FloatArray, IndexArray
from updater.causes import PER_BODY, AddedMass, Bodies, JointHypothesis, Nothing, propose_added_mass
from updater.inference import Comparison, Fit, compare, fit
from updater.localization.one_mass import FITS, MODEL_ERRORS, MassChange, mass_change
from updater.localization.starting_sets import same_places, starts
from updater.modal_data import ModalMean
from updater.reference import Reference

_SAME = 0.02  # m: two ends nearer than this are one maximum, or nearer than two of its standard deviations
_ROUGH = 0.1  # of a mode's displacement: the search's model error, since masses act to first order only in its scans
_ROUNDS = 4
_NEAR = 30.0  # chi-square over the best: sets that must have converged
_NEGLIGIBLE = 5.0  # of log density under the best: sets of places that add nothing to the evidence
_ENOUGH = 0.1  # of chi-square: rest


@dataclass(frozen=True, eq=False, kw_only=True)
class MassChanges:
    """Located masses."""

    masses: tuple[MassChange, ...]  #: the most probable number of them, the largest first; none if nothing was added
    probability: FloatArray  #: (most + 1,) of no mass, one, two, ... [-]
    p_value: float  #: probability of a worse fit if this is true [-]

    @property
    def number(self) -> int:
        """The most probable number of masses."""
        return len(self.masses)


def locate_masses(reference: Reference, event: ModalMean, *, most: int = 3) -> MassChanges:
    """Locate masses that were added or removed together, and compare their possible numbers by evidence.

    Bodies are assumed to come independently of one another, anywhere on the structure, and one to be as probable as
    none. Their number then has a Poisson distribution of mean one beforehand: two are half as probable as one, three
    a third as probable as two. A further body that does not show, since it is small or near a support, costs the
    evidence only a factor of about two, so that a number less than `most` is rarely stated with more than 0.9.

    Parameters
    ----------
    reference : learned before the change
    event : (n_tracks,) mean of the windows since the change
    most : largest number to try

    Raises
    ------
    ModalDataError
        If fewer than three modes can be compared, or the input is invalid.
    """
    for error in MODEL_ERRORS:
        found = _counted(reference, event, most, error)
        if found.p_value >= FITS:
            break
    masses = [mass_change(part, error) for part in found.each()]
    return MassChanges(
        masses=tuple(sorted(masses, key=lambda change: -abs(change.mass))),
        probability=np.asarray(softmax(found.log_evidence)),
        p_value=found.p_value,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Counted:
    """Fits of none, one, two, ... masses."""

    single: Fit[AddedMass]
    sets: list[Fit[Bodies]]  #: sets of two, three, ... bodies
    log_evidence: list[float]  #: log evidence of none, one, two, ..., with their prior probabilities
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
    unchanged = data.trusting(0.0)  # the error is one of predicted changes: no change is predicted without any
    nothing, single = fit(unchanged, Nothing(comparison=unchanged)), fit(data, grid)
    evidence = [nothing.log_evidence, single.log_evidence]
    p_values = [nothing.p_value, single.p_value]
    sets: list[Fit[Bodies]] = []
    for number in range(2, most + 1):
        sought = _settled(rough, starts(rough, grid, number, sets[-1] if sets else single))
        sets.append(_settled(data, replace(sought.hypotheses, start=sought.theta)))
        evidence.append(_log_evidence(data, sets[-1]))
        p_values.append(sets[-1].p_value)
    return _Counted(single=single, sets=sets, log_evidence=evidence, p_values=p_values)


def _settled(data: Comparison, bodies: Bodies) -> Fit[Bodies]:
    """Fit sets of bodies until none moves on: one round of steps is enough near an end, not from a scan's places."""
    found = fit(data, bodies, refine=False)
    for _ in range(_ROUNDS):
        before, found = found, fit(data, replace(bodies, start=found.theta), refine=False)
        if (before.chi_square - found.chi_square)[found.chi_square < found.chi_square.min() + _NEAR].max() < _ENOUGH:
            break
    return found


def _position_std(found: Fit[Bodies]) -> FloatArray:
    """Return the standard deviations (n_alternatives, n_bodies) of the positions [m]."""
    variance = np.diagonal(found.covariance, axis1=1, axis2=2)
    return np.asarray(np.sqrt(variance.reshape(*found.hypotheses.place.shape, PER_BODY)[..., 0]))


def _positions(found: Fit[Bodies]) -> FloatArray:
    """Return where the bodies of each alternative ended (n_alternatives, n_bodies) [m]."""
    return found.hypotheses.place + found.theta.reshape(*found.hypotheses.place.shape, PER_BODY)[..., 0]


def _log_evidence(data: Comparison, found: Fit[Bodies]) -> float:
    """Return the log evidence of a number of bodies, with its Poisson prior.

    The position of the least certain body is summed over; those of the others enter by Laplace's approximation, because
    the density of a body with little effect is far from a Gaussian. Sets of places whose other bodies are within one
    another's reach count once. Of n bodies the others have (n - 1)! orders, which the prior of Bodies counts; 1 / n! of
    the Poisson distribution leaves one of them, as does the choice of the body that is summed over.
    """
    ends, members, std = _positions(found), found.hypotheses.member, _position_std(found)
    loosest = np.argmax(std, axis=1)
    others = [np.delete(np.arange(ends.shape[1]), k) for k in loosest]
    kept: list[int] = []
    for row in np.argsort(-found.log_density).tolist():
        if found.log_density[row] < found.log_density.max() - _NEGLIGIBLE:
            break
        if not any(_holds(ends[row], members[row], ends[o], members[o], std[o], others[o]) for o in kept):
            kept.append(row)
    sums = [_summed(data, found, row, int(loosest[row])).log_evidence for row in kept]
    inside = [_log_share_inside(found, row, ends[row], std[row], others[row]) for row in kept]
    return float(logsumexp(np.add(sums, inside)) - gammaln(ends.shape[1]))


def _holds(
    ends: FloatArray, members: IndexArray, other: FloatArray, of_other: IndexArray, std: FloatArray, fixed: IndexArray
) -> bool:
    """Return whether a set of places (n,) without one of them is the `fixed` places of another set, in some order."""
    reach = np.maximum(_SAME, 2 * std[fixed])
    return any(
        same_places(np.delete(ends, k), np.delete(members, k), other[fixed], of_other[fixed], reach)
        for k in range(len(ends))
    )


def _log_share_inside(found: Fit[Bodies], row: int, ends: FloatArray, std: FloatArray, bodies: IndexArray) -> float:
    """Return the log share of the Gaussian positions of some bodies that lies on their members."""
    members = found.hypotheses.grid.reference.structure.member
    length = np.array([members[m].length for m in found.hypotheses.member[row, bodies].tolist()])
    at, scale = ends[bodies], std[bodies]
    return float(np.log(ndtr((length - at) / scale) - ndtr(-at / scale)).sum())


def _summed(data: Comparison, found: Fit[Bodies], row: int, body: int) -> Fit[JointHypothesis[AddedMass]]:
    """Fit one body of a set at all positions, from no mass on, the others along."""
    theta, grid = found.theta[row], found.hypotheses.grid
    own = theta[body * PER_BODY + 1 : (body + 1) * PER_BODY] * [0.0, 1.0, 1.0, 1.0]
    free = replace(grid, start=np.tile(own, (len(grid.position), 1)))
    return fit(data, found.hypotheses.at(row, theta, body).beside(free))


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
