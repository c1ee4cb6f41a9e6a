"""Places of causes: one cause at two places, and a body's place together with that of another cause.

Two places are two hypotheses where neither holds the posterior by itself. Causes that are fitted in turn have each the
posterior of their places for one place of the other: too narrow where they resemble each other, as a body and a loss of
stiffness next to it. Together they may be moved along a ridge that no turn follows.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from scipy.special import logsumexp

from daq import FloatArray, IndexArray
from updater.causes import AddedMass, Cause, JointHypothesis, Placed, SelectedCause, Stretches
from updater.diagnosis.weighing import Candidate, EvidenceComparison
from updater.inference import BoolArray, Fit
from updater.structure import Structure

_FAR = 0.05  # of the structure's largest extent, from where on a place is another one
_ALL = 0.99  # of the posterior: one place represents all
_ASIDE = 4  # times as far on the same member: nearer alternatives are one broad maximum's


def another_place(structure: Structure) -> float:
    """Return how far apart places are two [m]."""
    ends = np.array([end for member in structure.member for end in (member.point(0.0), member.point(member.length))])
    return _FAR * float(np.linalg.norm(np.ptp(ends, axis=0)))


def next_place(part: Fit[Cause], within: float) -> int | None:
    """Return the best alternative at another place than the best one, None if none is nearly as likely.

    Parameters
    ----------
    part : fit of one cause
    within : of log density under the best
    """
    cause = part.hypotheses
    if not isinstance(cause, Placed):
        return None
    log = part.log_density + cause.log_prior
    points = cause.points(part)
    away = np.linalg.norm(points - points[part.best], axis=1)
    far = away > _ASIDE * another_place(cause.reference.structure)
    likely = np.flatnonzero(far & (log > log[part.best] - within))
    return int(likely[np.argmax(log[likely])]) if len(likely) else None


def by_place(found: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates, each once for every place that one of its causes may be at, the likeliest first.

    A body that is left or right of a symmetric column, a prop under the one arm or the other: the mean of both is
    neither, and the likelier one is a guess with its own probability.
    """
    every = [split for candidate in found for split in _split(candidate)]
    return sorted(every, key=lambda c: -round(c.log_evidence, 2))  # equals stay in their order


def _split(candidate: Candidate) -> list[Candidate]:
    found = [candidate]
    for number, part in enumerate(candidate.parts):
        chosen = _places(part)
        total = sum(share for share, _ in chosen)
        if chosen and chosen[0][0] < _ALL * total:
            found = [_at(c, number, part.only(inside), share / total) for c in found for share, inside in chosen]
    return found


def _at(candidate: Candidate, number: int, part: Fit[Cause], share: float) -> Candidate:
    """Return a candidate with one of its causes at one place, which has a share of its posterior."""
    chosen, parts = list(candidate.chosen), list(candidate.parts)
    chosen[number] = SelectedCause(part.hypotheses, part.best, part.theta[part.best])  # of the fit's own places
    parts[number] = part
    evidence = candidate.log_evidence + float(np.log(share))
    return replace(candidate, chosen=tuple(chosen), parts=tuple(parts), log_evidence=evidence)


def _places(part: Fit[Cause]) -> list[tuple[float, BoolArray]]:
    """Return the posterior of places that are far apart, the likeliest first, and which alternatives (n,) are there."""
    cause = part.hypotheses
    if not isinstance(cause, Placed):
        return []
    least = another_place(cause.reference.structure)
    found: list[tuple[FloatArray, FloatArray]] = []
    for inside in cause.by_place(part):
        where = cause.where(part.only(inside > 0))
        position = np.array(where.position if where and where.position else cause.points(part)[np.argmax(inside)])
        near = next((k for k, (_, other) in enumerate(found) if np.linalg.norm(position - other) < least), None)
        if near is None:
            found.append((inside, position))
        else:
            found[near] = found[near][0] + inside, found[near][1]
    return sorted(((float(inside.sum()), inside > 0) for inside, _ in found), key=lambda place: -place[0])


_SAME_WIDTH = 1.5  # of log density two deviations aside, of 2 of a Gaussian: a ridge is wider by 15 % at most
_BELOW = 6.0  # of log density under the best: a scan ends
_MAX_SCANNED = 60  # places of a body
_UNLIKELY = 1e-4  # probability of a place that is left out
_PARTS = 4  # into which a step between places that are fitted is divided
_TWO = 2  # causes that have a place
_WORTH_A_SCAN = 0.01  # probability of a place from which a scan starts


def along_ridges(weighing: EvidenceComparison, candidate: Candidate) -> Candidate:
    """Return two causes with the posterior of both places together, where one is a body and the places correlate.

    The other cause is fitted with the body at one place after the other, as far as they are likely.
    """
    placed = [number for number, part in enumerate(candidate.parts) if isinstance(part.hypotheses, Placed)]
    for number, other in (placed, placed[::-1]) if len(placed) == _TWO else ():
        candidate = _along_ridge(weighing, candidate, number, other)
    return candidate


def _along_ridge(weighing: EvidenceComparison, candidate: Candidate, number: int, other: int) -> Candidate:
    """Return a candidate with the body `number` and the cause `other` at all their places together."""
    part, free = candidate.parts[number], weighing.cause(candidate.chosen[other].cause.name)
    body = part.hypotheses
    if not isinstance(body, AddedMass) or not isinstance(free, AddedMass | Stretches):
        return candidate
    places = [place for place in body.posterior(part).places if place.probability > _WORTH_A_SCAN]
    distances = [body.posterior(part).distance(place) for place in places]
    grid = body.everywhere({place.member for place in places}, distances[0][1])
    rest = tuple(c for k, c in enumerate(candidate.chosen) if k not in {number, other})
    found: dict[int, Fit[JointHypothesis[Cause]]] = {}

    def density(row: int) -> float:
        if row not in found:
            begun = part.theta[body.nearest(int(grid.member[row]), float(grid.position[row]))]
            at = SelectedCause(grid, row, begun)
            found[row] = weighing.fit_beside(free, (at, *rest))
        return found[row].log_evidence

    starts = [grid.nearest(place.member, mean) for place, (mean, _) in zip(places, distances, strict=True)]
    aside = [row for row in (starts[0] - 2, starts[0] + 2) if grid.is_on(row, places[0].member)]
    if all(density(row) < density(starts[0]) - _SAME_WIDTH for row in aside):
        return candidate
    for start, step in itertools.product(starts, (-1, 1)):
        row = start
        while grid.is_on(row, int(grid.member[start])) and len(found) < _MAX_SCANNED:
            if density(row) < max(fit.log_evidence for fit in found.values()) - _BELOW:
                break
            row += step
    return _of_all_places(weighing, candidate, number, other, grid, found)


def _of_all_places(
    weighing: EvidenceComparison,
    candidate: Candidate,
    number: int,
    other: int,
    grid: AddedMass,
    found: Mapping[int, Fit[JointHypothesis[Cause]]],
) -> Candidate:
    """Return a candidate with the sum over the places of a body.

    Parameters
    ----------
    number, other : of the body and of the other cause in the candidate
    grid : places of the body
    found : fits of the other cause, by the place of the body
    """
    log = np.array([one.log_evidence for one in found.values()])
    share = np.exp(log - logsumexp(log))
    rows = [row for row, own in zip(found, share.tolist(), strict=True) if own > _UNLIKELY]
    best = found[max(rows, key=lambda row: found[row].log_evidence)]
    chosen, parts = list(candidate.chosen), list(candidate.parts)
    selected = best.hypotheses.best(best)
    chosen[other], chosen[number] = selected[:2]
    rest = [k for k in range(len(chosen)) if k not in {number, other}]
    for k, one in zip(rest, selected[2:], strict=True):
        chosen[k] = one
    parts[number] = _of_body(grid, {row: found[row] for row in rows})
    parts[other] = _of_other({row: found[row] for row in rows}, best)
    evidence = float(logsumexp(log)) + sum(weighing.log_prior(name) for name in candidate.names)
    evidence -= sum(float(np.log(parts[k].probability[parts[k].best])) for k in rest)
    chi_square = min(float(one.chi_square.min()) for one in found.values())
    return replace(
        candidate,
        chosen=tuple(chosen),
        parts=tuple(parts),
        log_evidence=evidence,
        p_value=best.p_value,
        chi_square=chi_square,
    )


def _of_body(grid: AddedMass, found: Mapping[int, Fit[JointHypothesis[Cause]]]) -> Fit[Cause]:
    """Return the fit of a body at its places, whatever the other cause is: means and deviations over it.

    Between two places that were fitted, next to each other on the grid, values are interpolated.
    """
    rows = np.array(sorted(found))
    fits = [found[row] for row in rows.tolist()]
    begin = len(fits[0].hypotheses.free.prior_std)
    own = slice(begin, begin + len(grid.prior_std))
    theta = np.array([one.probability @ one.theta[:, own] for one in fits])
    covariance = np.array(
        [
            np.einsum("p,pij->ij", one.probability, one.covariance[:, own, own])
            + (one.probability * (off := one.theta[:, own] - mean).T) @ off
            for one, mean in zip(fits, theta, strict=True)
        ]
    )
    log_density = np.array([one.log_evidence for one in fits]) - grid.log_prior[rows]
    fine, nearer = grid.between(rows, _PARTS)

    def at_each(values: FloatArray) -> FloatArray:
        return np.tensordot(nearer, values, 1)

    return Fit(
        hypotheses=fine,
        theta=at_each(theta),
        covariance=at_each(covariance),
        chi_square=at_each(np.array([one.chi_square.min() for one in fits])),
        log_density=at_each(log_density),
        freedom=fits[0].freedom,
        frequency_residual=np.zeros((len(nearer), fits[0].frequency_residual.shape[1])),
    )


def _of_other(found: Mapping[int, Fit[JointHypothesis[Cause]]], best: Fit[JointHypothesis[Cause]]) -> Fit[Cause]:
    """Return the fit of the other cause, wherever the body is; of a body, which is scanned itself, of the best."""
    fits = [one.hypotheses.of_free(one) for one in found.values()]
    kinds = [one.hypotheses for one in fits if isinstance(one.hypotheses, Stretches)]
    if not kinds:
        return best.hypotheses.of_free(best)
    at = [one.hypotheses.chosen[0] for one in found.values()]
    prior = [float(one.cause.log_prior[one.row]) for one in at]
    return Fit(
        hypotheses=kinds[0].joined(kinds),
        theta=np.concatenate([one.theta for one in fits]),
        covariance=np.concatenate([one.covariance for one in fits]),
        chi_square=np.concatenate([one.chi_square for one in fits]),
        log_density=np.concatenate([one.log_density + own for one, own in zip(fits, prior, strict=True)]),
        freedom=fits[0].freedom,
        frequency_residual=np.concatenate([one.frequency_residual for one in fits]),
    )


_NOTHING = 1e-300


@dataclass(frozen=True, eq=False, kw_only=True)
class Density:
    """A cause's posterior over places, in order along each member."""

    cause: str
    member: tuple[str, ...]  #: (n,) of each place
    position: FloatArray  #: (n, 3) [m]
    density: FloatArray  #: (n,) [1/m]


@runtime_checkable
class _Along(Protocol):
    """Alternatives that are positions along members."""

    @property
    def member(self) -> IndexArray: ...

    @property
    def position(self) -> FloatArray: ...

    @property
    def weight(self) -> FloatArray: ...


def densities(structure: Structure, parts: Sequence[Fit[Cause]]) -> tuple[Density, ...]:
    """Return the posterior over places of each accepted cause whose alternatives are positions.

    Parameters
    ----------
    structure : that was diagnosed
    parts : the fit of each accepted cause
    """
    return tuple(_density(structure, part, part.hypotheses) for part in parts if isinstance(part.hypotheses, _Along))


def _density(structure: Structure, part: Fit[Cause], along: _Along) -> Density:
    members = [structure.member[int(i)] for i in along.member]
    return Density(
        cause=part.hypotheses.name,
        member=tuple(member.name for member in members),
        position=np.array([member.point(s) for member, s in zip(members, along.position.tolist(), strict=True)]),
        density=np.maximum(part.probability / along.weight, _NOTHING),
    )
