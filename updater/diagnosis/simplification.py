"""Simpler forms of an explanation: two stretches as one, and no cause that is not needed."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from updater.causes import CATALOGUE, Cause, JointHypothesis, LocalStiffness, Sized
from updater.diagnosis.combinations import Compositions
from updater.diagnosis.weighing import Candidate, EvidenceComparison, ranked, shown_by_signals
from updater.inference import Fit, fit
from updater.quantities import SIGNIFICANT

_MANY = 3  # causes from which on not every combination of fewer causes was fitted


@dataclass(frozen=True, kw_only=True)
class _Stretch:
    """One stretch as it is reported."""

    member: str
    start: float  #: [m]
    stop: float  #: [m]
    end_std: float  #: standard deviation of either end [m]
    loss: float
    loss_std: float

    def touches(self, other: "_Stretch") -> bool:
        """Return whether the ends meet, or the stretches overlap, within two standard deviations."""
        gap = max(self.start, other.start) - min(self.stop, other.stop)
        return self.member == other.member and gap < SIGNIFICANT * float(np.hypot(self.end_std, other.end_std))

    def agrees(self, other: "_Stretch") -> bool:
        """Return whether the losses are the same within two standard deviations."""
        return abs(self.loss - other.loss) < SIGNIFICANT * float(np.hypot(self.loss_std, other.loss_std))


def merged(weighing: EvidenceComparison, candidate: Candidate) -> Candidate:
    """Return a candidate with stretches that touch and agree refitted as one, where that is likelier.

    Parameters
    ----------
    weighing : the data and the causes' prior probabilities
    candidate : causes fitted together
    """
    stretches = [
        (k, _reported(part.hypotheses, part))
        for k, part in enumerate(candidate.parts)
        if isinstance(part.hypotheses, LocalStiffness)
    ]
    for (i, first), (j, second) in itertools.combinations(stretches, 2):
        if first.touches(second) and first.agrees(second):
            span = min(first.start, second.start), max(first.stop, second.stop)
            found = _refitted(weighing, candidate, (i, j), span)
            if found.log_evidence > candidate.log_evidence:
                return merged(weighing, found)
    return candidate


def _reported(cause: LocalStiffness, part: Fit[Cause]) -> _Stretch:
    where, found = cause.where(part), cause.parameters(part)
    member = next(m for m in cause.cells.members if m.name == where.member)
    middle = float(np.linalg.norm(np.subtract(where.position or member.start, member.start)))
    half = found["extent"].value / 2
    return _Stretch(
        member=member.name,
        start=middle - half,
        stop=middle + half,
        end_std=float(np.hypot(where.position_std or 0.0, found["extent"].std / 2)),
        loss=found["loss"].value,
        loss_std=found["loss"].std,
    )


def _refitted(
    weighing: EvidenceComparison, candidate: Candidate, pair: tuple[int, int], span: tuple[float, float]
) -> Candidate:
    """Return the candidate with one stretch over a span [m] in the place of two, the others fitted along."""
    kept = candidate.chosen[pair[0]]
    stretches = candidate.parts[pair[0]].hypotheses
    assert isinstance(stretches, LocalStiffness)
    whole = stretches.over(kept.row, kept.theta, *span)
    others = tuple(c for k, c in enumerate(candidate.chosen) if k not in pair)
    beside: JointHypothesis[Cause] = JointHypothesis(whole, others)
    found = fit(weighing.data, beside, refine=False)
    parts = tuple(p for k, p in enumerate(candidate.parts) if k not in pair)
    return weighing.joint_candidate(found, beside.best(found), (beside.of_free(found), *parts))


def only_needed(
    weighing: EvidenceComparison, candidate: Candidate, is_accepted: Callable[[Candidate], bool]
) -> Candidate:
    """Return a candidate of more than two causes without a cause that reduces its evidence, the others fitted again.

    The search adds causes to a first one that another one may replace later: then a cause that was needed next to the
    first one may no longer be. Parameters of a file are not left out.

    Parameters
    ----------
    weighing : the data and the causes' prior probabilities
    candidate : causes fitted together
    is_accepted : whether a fit is good enough to be named
    """
    several, needed = Compositions(weighing), candidate
    while len(candidate.chosen) >= _MANY and len(needed.chosen) > 1:
        removable = [k for k, name in enumerate(needed.names) if not CATALOGUE[name].of_the_file]
        rest = [needed.chosen[:k] + needed.chosen[k + 1 :] for k in removable]
        fitted = [several.likely_fit(chosen, needed.log_evidence) for chosen in rest]
        fewer = [c for c in fitted if c is not None and c.log_evidence > needed.log_evidence and is_accepted(c)]
        if not fewer:
            break
        needed = max(fewer, key=lambda c: c.log_evidence)
    return needed


def is_significant(part: Fit[Any]) -> bool:
    """Return whether a cause differs from no change by two standard deviations, or by the signals.

    A cause without a size does.
    """
    cause = part.hypotheses
    return not isinstance(cause, Sized) or cause.deviations(part) > SIGNIFICANT or shown_by_signals(part)


def significant_only(weighing: EvidenceComparison, found: list[Candidate]) -> list[Candidate]:
    """Return the candidates of which every cause is significant, and the best one without its causes of zero size.

    Parameters of a file that are of zero size together remain where the other causes have no size without them.

    Parameters
    ----------
    weighing : the data and causes
    found : the likeliest first
    """
    kept = [c for c in found if all(map(is_significant, c.parts))]
    if kept and kept[0] is found[0]:
        return kept
    rest = tuple(c for c, part in zip(found[0].chosen, found[0].parts, strict=True) if is_significant(part))
    fewer = Compositions(weighing).coordinate_fit(rest) if rest else None
    if fewer is None or not all(map(is_significant, fewer.parts)):
        needed = all(CATALOGUE[p.hypotheses.name].of_the_file or is_significant(p) for p in found[0].parts)
        return [found[0], *kept] if needed else kept
    return ranked([fewer, *(c for c in kept if sorted(c.names) != sorted(fewer.names))])
