"""How many masses were added, where, and how much: one to a few, the number chosen by evidence."""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from daq import FloatArray, IndexArray
from updater.causes.added_mass import AddedMass, propose_added_mass
from updater.causes.bodies import PER_BODY, Bodies
from updater.causes.nothing import Nothing
from updater.comparing import compare
from updater.comparison import Comparison
from updater.fit import Fit, fit, linearised
from updater.localization import FITS, MODEL_ERRORS, MassChange, mass_change
from updater.reanalysis import Effect
from updater.reference import Reference
from updater.statistics import ModalMean

_FURTHER = 0.02  # probability of one mass more over that of one fewer, beforehand
_STARTS = 6  # sets of places of each scan from which a fit begins
_KNOWN = 2  # sets of one mass fewer that a further mass is sought beside
_SCANNED = 5000  # sets of a scan that are looked at
_LEAST = 1e-6  # of the largest effect: what is less is none
_APART = 0.1  # m: two starts nearer than this in every place are one
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


@dataclass(frozen=True, eq=False, kw_only=True)
class Among:
    """One mass at any position, beside others that stay near where they are; all parameters are fitted together."""

    free: AddedMass
    others: Bodies  #: one alternative

    @property
    def prior_std(self) -> FloatArray:
        """Of all, those of the free mass first."""
        return np.concatenate([self.free.prior_std, self.others.prior_std])

    @property
    def lower(self) -> FloatArray:
        """Of all."""
        return self._beside(self.free.lower, self.others.lower)

    @property
    def start(self) -> FloatArray:
        """Of all."""
        return self._beside(self.free.start, self.others.start)

    def _beside(self, own: FloatArray, others: FloatArray) -> FloatArray:
        return np.concatenate([own, np.tile(others, (len(own), 1))], axis=1)

    @property
    def log_prior(self) -> FloatArray:
        """Of the free mass."""
        return self.free.log_prior

    @property
    def drifting(self) -> bool:
        """As with one mass."""
        return self.free.drifting

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return all masses together."""
        n = len(self.free.prior_std)
        others = self.others.effect(theta[:, n:], np.zeros(len(rows), np.intp))
        return self.free.effect(theta[:, :n], rows).then(others)

    def log_ratio(self, theta: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return those of all masses together."""
        n = len(self.free.prior_std)
        of_free = self.free.log_ratio(theta[:, :n], covariance[:, :n, :n])
        return of_free + self.others.log_ratio(theta[:, n:], covariance[:, n:, n:])

    def finer(self, log_density: FloatArray, theta: FloatArray) -> "Among | None":
        """Refine the free mass."""
        closer = self.free.finer(log_density, theta[:, : len(self.free.prior_std)])
        return None if closer is None else replace(self, free=closer)


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
        sought = _settled(rough, _starts(rough, grid, number, sets[-1] if sets else single))
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


def _starts(data: Comparison, grid: AddedMass, number: int, known: Fit[AddedMass] | Fit[Bodies]) -> Bodies:
    """Return sets of places to begin from, by scans in which further masses act to first order.

    Two scans, for what one misses the other finds: of all positions beside what one mass fewer came to, whose places
    and masses may give way; and, of two masses, of all pairs.
    """
    sets = [_best_beside(data, grid, _ends(grid, known))]
    if number == 2:
        sets.append(_best_pairs(data, grid))
    chosen = np.concatenate([_distinct(grid, found) for found in sets])
    rest, per_mass = _to_first_order(data, grid)
    start = np.zeros((len(chosen), number, PER_BODY))
    for row, rows in enumerate(chosen):
        start[row, :, 1] = np.linalg.lstsq(per_mass[rows].T, rest, rcond=None)[0]
    start[..., 1] = np.clip(start[..., 1], grid.lower[0, 0], grid.prior_std[0])
    return Bodies(
        grid=grid, member=grid.member[chosen], place=grid.position[chosen], start=start.reshape(len(chosen), -1)
    )


def _to_first_order(data: Comparison, grid: AddedMass) -> tuple[FloatArray, FloatArray]:
    """Return the whitened data (n_data,) and what a kilogram at each position does to them (n_positions, n_data)."""
    rest, slope = linearised(data, replace(grid, start=np.zeros(grid.start.shape)))
    return rest[0], -slope[:, :, 0]


def _best_pairs(data: Comparison, grid: AddedMass) -> IndexArray:
    """Return pairs of positions (n, 2), those that explain most first."""
    rest, per_mass = _to_first_order(data, grid)
    gram, along = per_mass @ per_mass.T, per_mass @ rest
    own = np.diag(gram) + _LEAST * np.diag(gram).max()
    determinant = np.maximum(own[:, None] * own - gram**2, _LEAST * own[:, None] * own)
    gain = (along[:, None] ** 2 * own - 2 * along[:, None] * along * gram + along**2 * own[:, None]) / determinant
    first, second = np.triu_indices(len(own), 1)
    order = np.argsort(-gain[first, second])[:_SCANNED]
    return np.column_stack([first, second])[order]


def _best_beside(data: Comparison, grid: AddedMass, sets: tuple[IndexArray, Bodies]) -> IndexArray:
    """Return sets of known positions (n, k) with any one more (n * n_positions, k + 1), those that explain most first.

    Parameters
    ----------
    sets : the known positions (n, k), and the bodies there
    """
    positions, bodies = sets
    free = replace(grid, start=np.zeros(grid.start.shape))
    n = len(grid.prior_std)
    found, gains = [], []
    for row, rows in enumerate(positions):
        others = bodies.at(row, bodies.start[row], None)
        rest, slope = linearised(data, Among(free=free, others=others))
        basis = np.linalg.qr(slope[0, :, n:])[0]
        left, per_mass = rest[0] - basis @ (basis.T @ rest[0]), slope[:, :, 0]
        beside = per_mass - (per_mass @ basis) @ basis.T
        size = np.maximum((beside**2).sum(1), _LEAST * (per_mass**2).sum(1).max())
        gains.append((beside @ left) ** 2 / size - left @ left)
        found.append(np.column_stack([np.tile(rows, (len(per_mass), 1)), np.arange(len(per_mass))]))
    order = np.argsort(-np.concatenate(gains))[:_SCANNED]
    return np.concatenate(found)[order]


def _ends(grid: AddedMass, found: Fit[AddedMass] | Fit[Bodies]) -> tuple[IndexArray, Bodies]:
    """Return the nearest grid positions (n, k) to where the best fits of one mass or of sets ended, and the bodies."""
    best = np.argsort(-found.log_density)[:_KNOWN]
    known = found.hypotheses
    if isinstance(known, Bodies):
        bodies = replace(known, member=known.member[best], place=known.place[best], start=found.theta[best])
    else:
        best = best[:1]
        start = np.concatenate([np.zeros((1, 1)), found.theta[best]], axis=1)
        bodies = Bodies(grid=grid, member=known.member[best][:, None], place=known.position[best][:, None], start=start)
    ends = bodies.place + bodies.start.reshape(*bodies.place.shape, PER_BODY)[..., 0]
    away = np.abs(grid.position - ends[..., None]) + 1e3 * (grid.member != bodies.member[..., None])
    return np.argmin(away, axis=-1), bodies


def _distinct(grid: AddedMass, sets: IndexArray) -> IndexArray:
    """Return the first sets of places that differ from one another."""
    chosen: list[IndexArray] = []
    for rows in sets:
        places = grid.position[rows], grid.member[rows]
        if not any(_same(*places, grid.position[o], grid.member[o], np.full(len(rows), _APART)) for o in chosen):
            chosen.append(rows)
        if len(chosen) == _STARTS:
            break
    return np.array(chosen)


def _near(grid: AddedMass, one: IndexArray, other: IndexArray, reach: float) -> bool:
    """Tell whether two sets of positions are the same in some order."""
    return any(
        bool(
            (grid.member[one] == grid.member[o]).all() and (np.abs(grid.position[one] - grid.position[o]) < reach).all()
        )
        for o in (other[list(order)] for order in itertools.permutations(range(len(other))))
    )


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
        if not any(_same(ends[row], members[row], ends[o], members[o], reach[o]) for o in kept):
            kept.append(int(row))
    return float(logsumexp((found.log_density + found.hypotheses.log_prior)[kept]))


def _same(one: FloatArray, of_one: IndexArray, other: FloatArray, of_other: IndexArray, reach: FloatArray) -> bool:
    orders = (list(order) for order in itertools.permutations(range(len(one))))
    return any(bool((of_one == of_other[o]).all() and (np.abs(one - other[o]) < reach[o]).all()) for o in orders)


def _each(data: Comparison, found: Fit[Bodies]) -> list[Fit[AddedMass]]:
    """Return each body of the best set with its own posterior over all positions, the others fitted along."""
    row, grid = int(np.argmax(found.log_density)), found.hypotheses.grid
    theta = found.theta[row]
    fits = []
    for k in range(found.hypotheses.n_bodies):
        own = theta[k * PER_BODY + 1 : (k + 1) * PER_BODY]
        free = replace(grid, start=np.tile(own, (len(grid.position), 1)))
        whole = fit(data, Among(free=free, others=found.hypotheses.at(row, theta, k)))
        n = len(own)
        part = Fit(
            hypotheses=whole.hypotheses.free,
            theta=whole.theta[:, :n],
            covariance=whole.covariance[:, :n, :n],
            chi_square=whole.chi_square,
            log_density=whole.log_density,
            freedom=whole.freedom,
        )
        fits.append(part)
    return fits
