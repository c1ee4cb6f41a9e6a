"""Starting points for fits of several masses: scans to first order."""

import itertools
from dataclasses import replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes import PER_BODY, AddedMass, Bodies
from updater.inference import Comparison, Fit, linearised

_STARTS = 6  # sets of places of each scan from which a fit begins
_KNOWN = 2  # sets of one mass fewer to which a further mass is added
_SCANNED = 5000  # sets of a scan that are looked at
_MIN = 1e-6  # relative to the largest effect: less is zero
_APART = 0.1  # m: two starts nearer than this in every place are one


def starts(data: Comparison, grid: AddedMass, number: int, known: Fit[AddedMass] | Fit[Bodies]) -> Bodies:
    """Return sets of places to begin from, by scans in which further masses act to first order.

    Two scans, because each finds cases that the other misses: of all positions added to the result with one mass fewer,
    whose places and masses may change; and, for two masses, of all pairs.

    Parameters
    ----------
    data : to explain
    grid : positions of one mass
    number : masses in a set, two at least
    known : result with one mass fewer
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
    """Return the whitened data (n_data,) and the effect of a kilogram at each position (n_positions, n_data)."""
    rest, slope = linearised(data, replace(grid, start=np.zeros(grid.start.shape)))
    return rest[0], -slope[:, :, 0]


def _best_pairs(data: Comparison, grid: AddedMass) -> IndexArray:
    """Return pairs of positions (n, 2), those that explain most first."""
    rest, per_mass = _to_first_order(data, grid)
    gram, along = per_mass @ per_mass.T, per_mass @ rest
    own = np.diag(gram) + _MIN * np.diag(gram).max()
    determinant = np.maximum(own[:, None] * own - gram**2, _MIN * own[:, None] * own)
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
        rest, slope = linearised(data, others.beside(free))
        basis = np.linalg.qr(slope[0, :, n:])[0]
        left, per_mass = rest[0] - basis @ (basis.T @ rest[0]), slope[:, :, 0]
        beside = per_mass - (per_mass @ basis) @ basis.T
        size = np.maximum((beside**2).sum(1), _MIN * (per_mass**2).sum(1).max())
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
        if not any(same_places(*places, grid.position[o], grid.member[o], np.full(len(rows), _APART)) for o in chosen):
            chosen.append(rows)
        if len(chosen) == _STARTS:
            break
    return np.array(chosen)


def same_places(
    one: FloatArray, of_one: IndexArray, other: FloatArray, of_other: IndexArray, reach: FloatArray
) -> bool:
    """Return whether two sets of places are the same in some order.

    Parameters
    ----------
    one, other : (n,) distances from the members' starts [m]
    of_one, of_other : (n,) the members
    reach : (n,) of the other's places: smaller distances are the same place [m]
    """
    orders = (list(order) for order in itertools.permutations(range(len(one))))
    return any(bool((of_one == of_other[o]).all() and (np.abs(one - other[o]) < reach[o]).all()) for o in orders)
