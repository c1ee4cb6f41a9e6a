"""Causes of zero size: found, but within two standard deviations of no change."""

from typing import Any

from updater.candidates import Candidate, Weighing, ranked
from updater.causes.base import Sized
from updater.compositions import Compositions
from updater.fit import Fit
from updater.quantities import SIGNIFICANT


def is_significant(part: Fit[Any]) -> bool:
    """Return whether a cause differs from no change by two standard deviations; one without a size does."""
    cause = part.hypotheses
    return not isinstance(cause, Sized) or cause.deviations(part) > SIGNIFICANT


def significant_only(weighing: Weighing, found: list[Candidate]) -> list[Candidate]:
    """Return the candidates of which every cause is significant, and the best one without its causes of zero size.

    Parameters
    ----------
    weighing : the data and causes
    found : the likeliest first
    """
    kept = [c for c in found if all(map(is_significant, c.parts))]
    if kept and kept[0] is found[0]:
        return kept
    rest = tuple(c for c, part in zip(found[0].chosen, found[0].parts, strict=True) if is_significant(part))
    fewer = Compositions(weighing).settled(rest) if rest else None
    if fewer is None or not all(map(is_significant, fewer.parts)):
        return kept
    return ranked([fewer, *(c for c in kept if sorted(c.names) != sorted(fewer.names))])
