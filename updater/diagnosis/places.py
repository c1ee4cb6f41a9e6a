"""One cause at two places: two hypotheses where neither place holds the posterior by itself."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes import Cause, Placed
from updater.diagnosis.weighing import Candidate
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
    chosen[number] = replace(chosen[number], row=part.best, theta=part.theta[part.best])
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
        position = np.array(where.position if where else ())
        near = next((k for k, (_, other) in enumerate(found) if np.linalg.norm(position - other) < least), None)
        if near is None:
            found.append((inside, position))
        else:
            found[near] = found[near][0] + inside, found[near][1]
    return sorted(((float(inside.sum()), inside > 0) for inside, _ in found), key=lambda place: -place[0])


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
