"""One cause at two places: two hypotheses where neither place holds the posterior by itself."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from daq import FloatArray
from updater.candidates import Candidate
from updater.causes.base import Cause, Placed
from updater.elsewhere import another_place
from updater.fit import BoolArray, Fit


def by_place(found: Sequence[Candidate], sure: float) -> list[Candidate]:
    """Return the candidates, each once for every place that one of its causes may be at, the likeliest first.

    A body that is left or right of a symmetric column, a prop under the one arm or the other: the mean of both is
    neither, and the likelier one is a guess.

    Parameters
    ----------
    sure : share of the posterior from which on one place stands for all
    """
    every = [split for candidate in found for split in _split(candidate, sure)]
    return sorted(every, key=lambda c: -round(c.log_evidence, 2))  # equals stay in their order


def _split(candidate: Candidate, sure: float) -> list[Candidate]:
    found = [candidate]
    for number, part in enumerate(candidate.parts):
        chosen = _places(part)
        total = sum(share for share, _ in chosen)
        if chosen and chosen[0][0] < sure * total:
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
    least = another_place(cause.reference.calibration.structure)
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
