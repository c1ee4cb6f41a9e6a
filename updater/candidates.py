"""Causes fitted to the same data, alone and together, with the evidence for each.

Compositions are found step by step: every cause of the catalogue is tried beside the best so far, the promising ones
are fitted in turns, each over all its alternatives while the others give way in their parameters.
"""

import itertools
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from updater.causes.base import Cause
from updater.causes.catalogue import CATALOGUE, RARITY
from updater.causes.common_factor import CommonFactor
from updater.causes.composite import Beside, Chosen
from updater.causes.nothing import Nothing
from updater.comparison import Comparison
from updater.fit import Fit, fit, foreseen
from updater.prediction import prediction
from updater.reference import Reference
from updater.statistics import COMMON_STD

PRIOR_NOTHING = 0.5
_CLOSER = 3  # compositions that are fitted, of all that are foreseen to first order
_SIGNIFICANT = 3.0  # standard deviations of a drift that is kept
_MODES_EACH = 4  # frequencies that each cause that changes them must have, from the third cause on
_DATA_EACH = 8.0  # data of all kinds that each must have, from the second one on
_HOPELESS = 15.0  # of log evidence foreseen under the best: what is not fitted
_TWINS = 0.05  # of frequency, between modes that may be one, if their shapes are
_TWINS_MAC = 0.8
_LEAST_GAIN = 10.0  # of chi-square over a common drift, or over fewer causes: what gains less does nothing itself


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
    chi_square: float  #: of the best alternatives, priors included
    effective: bool = True  #: whether it does more than a drift common to all frequencies would

    @property
    def names(self) -> tuple[str, ...]:
        """Of the causes."""
        return tuple(c.cause.name for c in self.chosen)

    def earned(self, fewer: "Sequence[Candidate]") -> bool:
        """Tell whether all of its causes do something: a composition fits better than any of its parts does."""
        parts = [c for c in fewer if len(c.chosen) < len(self.chosen) and Counter(c.names) <= Counter(self.names)]
        return all(self.chi_square < part.chi_square - _LEAST_GAIN for part in parts)


@dataclass(frozen=True, eq=False)
class Promise:
    """Several causes together, of which the last has not been fitted yet."""

    chosen: tuple[Chosen, ...]
    log_evidence: float  #: foreseen to first order, what its parameters cost left out


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

    @cached_property
    def _new_for_certain(self) -> bool:
        """Tell whether a new mode is no old one that identification took for two: near it, and of its shape."""
        data = self.data
        if data.new is None:
            return False
        now = np.log(data.frequency[data.paired]) + data.log_ratio
        near = np.abs(data.new.log_frequency[:, None] - now) < _TWINS
        alike = (data.new.shape @ data.shape.T) ** 2 > _TWINS_MAC
        return bool((~(near & alike).any(1)).all())

    def log_prior(self, name: str) -> float:
        """Return the log probability of a cause."""
        whole = sum(RARITY.get(each, 1.0) for each in CATALOGUE)
        return float(np.log((1 - PRIOR_NOTHING) * RARITY.get(name, 1.0) / whole))

    def drift_beside(self, chosen: Sequence[Chosen]) -> tuple[Chosen, ...]:
        """Return the drift common to all frequencies that chosen causes leave, as a factor on stiffness.

        It is a nuisance, which nobody names; a model that is to agree with the next record has it all the same. None
        where it is not significant, or where the causes have a common factor already.
        """
        factor = self.causes.get("global_stiffness")
        if not isinstance(factor, CommonFactor) or any(isinstance(c.cause, CommonFactor) for c in chosen):
            return ()
        if not any(c.cause.drifting for c in chosen):
            return ()
        rest = self.data.log_ratio - prediction(self.data, chosen).log_ratio[0]
        ones, off = self.data.plain.matrix.sum(1), self.data.plain.matrix @ rest
        precision = float(ones @ ones) + COMMON_STD**-2
        drift = float(ones @ off) / precision
        if abs(drift) < _SIGNIFICANT / np.sqrt(precision):
            return ()
        return (Chosen(factor, 0, np.array([(drift - factor.centre) / factor.spread])),)

    def singles(self) -> list[Candidate]:
        """Fit every cause alone, the best first."""
        found = []
        for name, cause in self.causes.items():
            self.on_cause(name)
            whole = fit(self.data, cause)
            best = Chosen(whole.hypotheses, whole.best, whole.theta[whole.best])
            effective = not cause.drifting or bool(whole.chi_square.min() < self._drift - _LEAST_GAIN)
            if self._new_for_certain and prediction(self.data, (best,)).new_frequency.size:
                effective = True  # its mode is measured: that is more than any drift does
            evidence = whole.log_evidence + self.log_prior(name)
            found.append(
                Candidate((best,), (whole,), evidence, whole.p_value, float(whole.chi_square.min()), effective)
            )
        return sorted(found, key=lambda c: -round(c.log_evidence, 2))  # equals stay in the catalogue's order

    def promising(self, seeds: Sequence[Candidate]) -> list[Promise]:
        """Foresee to first order what each cause would gain beside each of the seeds, the best first."""
        found = [
            self._promise(seed, name, cause)
            for seed in seeds
            for name, cause in self.causes.items()
            if not (cause.drifting and self._full(seed)) and not self._said_already(seed, cause)
        ]
        return sorted(found, key=lambda p: -p.log_evidence)

    @cached_property
    def _same_factor(self) -> list[Cause]:
        """Makers of a factor on all frequencies that nothing tells apart; the first one stands for all."""
        return [c for c in self.causes.values() if isinstance(c, CommonFactor) and not c.informed]

    def _said_already(self, seed: Candidate, cause: Cause) -> bool:
        """Tell whether a cause is a factor on all frequencies that another one stands for, or the seed has one."""
        if not isinstance(cause, CommonFactor):
            return False
        return cause in self._same_factor[1:] or any(isinstance(c.cause, CommonFactor) for c in seed.chosen)

    def _with_other_makers(self, found: Sequence[Candidate]) -> list[Candidate]:
        """Return candidates and the same with each other maker of a common factor in the place of the first."""
        every = list(found)
        for candidate, other in itertools.product(found, self._same_factor[1:]):
            first = self._same_factor[0]
            if first.name in candidate.names:
                chosen = tuple(replace(c, cause=other) if c.cause is first else c for c in candidate.chosen)
                parts = tuple(replace(p, hypotheses=other) if p.hypotheses is first else p for p in candidate.parts)
                every.append(replace(candidate, chosen=chosen, parts=parts))
        return every

    def _full(self, seed: Candidate) -> bool:
        """Tell whether one more cause that changes frequencies would have as many parameters as there are data."""
        most = min(max(2, len(self.data.log_ratio) // _MODES_EACH), max(1, int(self.data.freedom / _DATA_EACH)))
        return sum(c.cause.drifting for c in seed.chosen) >= most

    def _promise(self, seed: Candidate, name: str, cause: Cause) -> Promise:
        self.on_cause(" and ".join((*seed.names, name)))
        n_own = len(cause.prior_std)
        theta = np.concatenate([np.zeros(n_own), *(c.theta for c in seed.chosen)])
        beside: Beside[Cause] = Beside(cause, seed.chosen)
        cost = -foreseen(self.data, beside, theta, n_own)
        gain = 0.5 * (seed.chi_square - cost) + cause.log_prior
        row = int(np.argmax(gain))
        evidence = seed.log_evidence + float(gain[row]) + self.log_prior(name)
        return Promise((*seed.chosen, Chosen(cause, row, np.zeros(n_own))), evidence)

    def together(self, promises: Sequence[Promise]) -> list[Candidate]:
        """Fit the best of what was foreseen; two causes of one kind are two."""
        found: dict[tuple[str, ...], Candidate] = {}
        for promise in promises[: _CLOSER + 2 - len(promises[0].chosen)]:
            if promise.log_evidence < promises[0].log_evidence - _HOPELESS:
                break
            fitted = self._settled(promise.chosen)
            key = tuple(sorted(fitted.names))
            if key not in found or found[key].log_evidence < fitted.log_evidence:
                found[key] = fitted
        best, *others = sorted(found.values(), key=lambda c: -c.log_evidence)
        again = self._settled(best.chosen)
        return self._with_other_makers([again if again.log_evidence > best.log_evidence else best, *others])

    def _settled(self, chosen: tuple[Chosen, ...]) -> Candidate:
        """Fit all alternatives of each cause beside the best of the others, the last one first."""
        parts: list[Fit[Cause]] = []
        for _ in chosen:
            *others, last = chosen
            found = fit(self.data, Beside(self.causes[last.cause.name], tuple(others), fresh=True))
            chosen = found.hypotheses.best(found)
            parts.insert(0, found.hypotheses.of_free(found))
        # the last fit sums over one cause's alternatives; the others count with those they leave open, not with one
        open_ones = sum(float(np.log(part.probability[part.best])) for part in parts[1:])
        evidence = found.log_evidence - open_ones + sum(self.log_prior(c.cause.name) for c in chosen)
        return Candidate(chosen, tuple(parts), evidence, found.p_value, float(found.chi_square.min()))
