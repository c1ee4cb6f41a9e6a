"""Causes fitted to the same data, alone and together, with the evidence for each.

Compositions are found step by step: every cause of the catalogue is tried beside the best so far, the promising ones
are fitted in turns, each over all its alternatives while the others give way in their parameters.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from updater.causes.base import Cause
from updater.causes.catalogue import CATALOGUE
from updater.causes.composite import Beside, Chosen
from updater.causes.nothing import Nothing
from updater.comparison import Comparison
from updater.fit import Fit, fit
from updater.reference import Reference

PRIOR_NOTHING = 0.5
_CLOSER = 5  # compositions that are looked at more closely
_LEAST_GAIN = 10.0  # of chi-square over a common drift alone: a localized cause that gains less does nothing itself


def say_nothing(name: str) -> None:
    """Ignore which cause is being weighed."""
    del name


@dataclass(frozen=True, eq=False)
class Candidate:
    """One cause, or several together, fitted."""

    chosen: tuple[Chosen, ...]  #: the best alternative of each
    parts: tuple[Fit[Cause], ...]  #: the fit of each, the others' uncertainty included
    log_evidence: float  #: with the prior of the causes
    p_value: float
    effective: bool = True  #: whether it does more than a drift common to all frequencies would

    @property
    def names(self) -> tuple[str, ...]:
        """Of the causes."""
        return tuple(c.cause.name for c in self.chosen)


@dataclass(frozen=True, eq=False)
class Weighing:
    """The catalogue's causes for one reference and one set of data.

    Parameters
    ----------
    on_cause : called with the name of each cause before it is weighed
    """

    reference: Reference
    data: Comparison
    on_cause: Callable[[str], None] = field(default=say_nothing)

    @cached_property
    def causes(self) -> Mapping[str, Cause]:
        """Those that have alternatives here, by name."""
        proposed = {name: propose(self.reference, self.data) for name, propose in CATALOGUE.items()}
        return {name: cause for name, cause in proposed.items() if cause is not None}

    @cached_property
    def nothing(self) -> Fit[Nothing]:
        """What it is if nothing has changed."""
        return fit(self.data, Nothing(comparison=self.data))

    @cached_property
    def log_nothing(self) -> float:
        """Log evidence for that, with its prior."""
        return self.nothing.log_evidence + float(np.log(PRIOR_NOTHING))

    @cached_property
    def _drift(self) -> float:
        """Chi-square if all frequencies have drifted alike and nothing else has changed."""
        return float(fit(self.data, Nothing(comparison=self.data, drifting=True)).chi_square[0])

    @property
    def log_prior(self) -> float:
        """Log probability of each cause."""
        return float(np.log((1 - PRIOR_NOTHING) / len(CATALOGUE)))

    def singles(self) -> list[Candidate]:
        """Fit every cause alone, the best first."""
        found = []
        for name, cause in self.causes.items():
            self.on_cause(name)
            whole = fit(self.data, cause)
            best = Chosen(whole.hypotheses, whole.best, whole.theta[whole.best])
            effective = not cause.drifting or bool(whole.chi_square.min() < self._drift - _LEAST_GAIN)
            evidence = whole.log_evidence + self.log_prior
            found.append(Candidate((best,), (whole,), evidence, whole.p_value, effective))
        return sorted(found, key=lambda c: -round(c.log_evidence, 2))  # equals stay in the catalogue's order

    def further(self, seeds: Sequence[Candidate]) -> list[Candidate]:
        """Fit every cause beside each of the seeds, the best of them more closely; two of one kind are two."""
        forth = [(seed, self._beside(seed, name, cause)) for seed in seeds for name, cause in self.causes.items()]
        forth.sort(key=lambda pair: -pair[1].log_evidence)
        found: dict[tuple[str, ...], Candidate] = {}
        for _, beside in forth[:_CLOSER]:
            together = self._settled(beside.hypotheses.best(beside))
            key = tuple(sorted(together.names))
            if key not in found or found[key].log_evidence < together.log_evidence:
                found[key] = together
        best, *others = sorted(found.values(), key=lambda c: -c.log_evidence)
        again = self._settled(best.chosen)
        return [again if again.log_evidence > best.log_evidence else best, *others]

    def _beside(self, seed: Candidate, name: str, cause: Cause) -> Fit[Beside[Cause]]:
        self.on_cause(" and ".join((*seed.names, name)))
        return fit(self.data, Beside(cause, seed.chosen), refine=False)

    def _settled(self, chosen: tuple[Chosen, ...]) -> Candidate:
        """Fit all alternatives of each cause beside the best of the others, the last one first."""
        parts: list[Fit[Cause]] = []
        for _ in chosen:
            *others, last = chosen
            found = fit(self.data, Beside(self.causes[last.cause.name], tuple(others)))
            chosen = found.hypotheses.best(found)
            parts.insert(0, found.hypotheses.of_free(found))
        # the last fit sums over one cause's alternatives; the others count with those they leave open, not with one
        open_ones = sum(float(np.log(part.probability[part.best])) for part in parts[1:])
        evidence = found.log_evidence - open_ones + len(chosen) * self.log_prior
        return Candidate(chosen, tuple(parts), evidence, found.p_value)
