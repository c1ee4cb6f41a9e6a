"""What has changed, or what the model gets wrong: every cause of the catalogue fitted to the same data and weighed.

Laplace evidence with proper priors chooses (a cause that can be anywhere must earn its freedom); nothing at all is one
of the hypotheses. A cause is named at a posterior of 0.8; what no single one fits (chi-square p under 1e-3) is tried
with two together, and if that does not fit either the diagnosis says so and names nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from scipy.special import logsumexp

from updater.causes.base import Cause
from updater.causes.catalogue import CATALOGUE
from updater.causes.composite import Beside, Chosen
from updater.causes.nothing import Nothing
from updater.circumstances import NOTHING_KNOWN, Circumstances
from updater.comparison import Comparison, compare
from updater.fit import Fit, fit
from updater.reference import Reference
from updater.statistics import ModalMean
from updater.structure import Structure
from updater.verdict import Diagnosis, Verdict
from updater.wording import gain_of, modes_of, named_causes, rejected_causes

_SURE = 0.8  # posterior at which a cause is named
_LEAST_P = 1e-3  # of chi-square, under which a fit is none
_PRIOR_NOTHING = 0.5
_SEEDS = 3  # single causes that a second one is tried beside
_CLOSER = 5  # pairs that are looked at more closely


@dataclass(frozen=True, eq=False)
class Explained:
    """A diagnosis, with the model that it extends."""

    diagnosis: Diagnosis
    extended: Structure | None  #: with the causes written in; None where nothing is explained


@dataclass(frozen=True, eq=False)
class Candidate:
    """One cause, or several together, fitted."""

    chosen: tuple[Chosen, ...]  #: the best alternative of each
    parts: tuple[Fit[Cause], ...]  #: the fit of each, the others' uncertainty included
    log_evidence: float  #: with the prior of the causes
    p_value: float

    @property
    def names(self) -> tuple[str, ...]:
        """Of the causes."""
        return tuple(c.cause.name for c in self.chosen)


def diagnose(
    reference: Reference,
    event: ModalMean,
    *,
    heldout: ModalMean | None = None,
    circumstances: Circumstances = NOTHING_KNOWN,
) -> Explained:
    """Explain an event against a reference.

    Parameters
    ----------
    reference : of the structure as it was, or of the nominal model
    event : (n_tracks,) mean of the windows to explain
    heldout : (n_tracks,) mean of windows that the fit must not see, to measure the gain on
    circumstances : what else is known of the event

    Raises
    ------
    ValueError
        If fewer than three modes can be compared.
    """
    data = compare(reference, event, circumstances=circumstances)
    nothing = fit(data, Nothing(comparison=data))
    log_nothing = nothing.log_evidence + float(np.log(_PRIOR_NOTHING))
    singles = _singles(reference, data)
    best = max(log_nothing, singles[0].log_evidence)
    if log_nothing - _log_sum([log_nothing, *(c.log_evidence for c in singles)]) >= np.log(1 - _SURE):
        return _refused("nothing_to_explain" if nothing.p_value >= _LEAST_P else "unexplained", data, singles, best)
    found = singles
    if singles[0].p_value < _LEAST_P:
        found = _pairs(reference, data, singles[:_SEEDS])
    if found[0].p_value < _LEAST_P:
        return _refused("unexplained", data, singles, best)
    return _explained(reference, data, found, singles, compare(reference, heldout) if heldout else None)


def _log_sum(values: Sequence[float]) -> float:
    return float(logsumexp(np.array(values)))


def _singles(reference: Reference, data: Comparison) -> list[Candidate]:
    """Fit every cause alone, the best first."""
    prior = float(np.log((1 - _PRIOR_NOTHING) / len(CATALOGUE)))
    found = []
    for propose in CATALOGUE.values():
        cause = propose(reference, data)
        if cause is not None:
            whole = fit(data, cause)
            best = Chosen(whole.hypotheses, whole.best, whole.theta[whole.best])
            found.append(Candidate((best,), (whole,), whole.log_evidence + prior, whole.p_value))
    return sorted(found, key=lambda c: -c.log_evidence)


def _pairs(reference: Reference, data: Comparison, seeds: Sequence[Candidate]) -> list[Candidate]:
    """Fit every cause beside each of the seeds, the best of them more closely; two of one kind are two."""
    forth = []
    for seed in seeds:
        for propose in CATALOGUE.values():
            second = propose(reference, data)
            if second is not None:
                forth.append((seed, fit(data, Beside(second, seed.chosen), refine=False)))
    forth.sort(key=lambda pair: -pair[1].log_evidence)
    found: dict[tuple[str, ...], Candidate] = {}
    for seed, beside in forth[:_CLOSER]:
        pair = _pair(reference, data, seed, beside)
        key = tuple(sorted(pair.names))
        if key not in found or found[key].log_evidence < pair.log_evidence:
            found[key] = pair
    best, *others = sorted(found.values(), key=lambda c: -c.log_evidence)
    return [_once_more(reference, data, best), *others]


def _pair(reference: Reference, data: Comparison, seed: Candidate, beside: Fit[Beside[Cause]]) -> Candidate:
    """Fit the first cause's alternatives beside the second's best, then the second's beside the first's."""
    prior = 2 * float(np.log((1 - _PRIOR_NOTHING) / len(CATALOGUE)))
    first = cast(Cause, CATALOGUE[seed.names[0]](reference, data))
    back = fit(data, Beside(first, beside.hypotheses.best(beside)[:1]))
    second = cast(Cause, CATALOGUE[beside.hypotheses.free.name](reference, data))
    forth = fit(data, Beside(second, back.hypotheses.best(back)[:1]))
    parts = back.hypotheses.of_free(back), forth.hypotheses.of_free(forth)
    return Candidate(tuple(reversed(forth.hypotheses.best(forth))), parts, forth.log_evidence + prior, forth.p_value)


def _once_more(reference: Reference, data: Comparison, pair: Candidate) -> Candidate:
    """Fit the first of two beside the second again, whose place has become finer since."""
    first = cast(Cause, CATALOGUE[pair.names[0]](reference, data))
    again = fit(data, Beside(first, pair.chosen[1:]))
    return replace(pair, chosen=again.hypotheses.best(again), parts=(again.hypotheses.of_free(again), *pair.parts[1:]))


def _refused(verdict: Verdict, data: Comparison, singles: list[Candidate], best: float) -> Explained:
    diagnosis = Diagnosis(
        verdict=verdict,
        causes=(),
        rejected=rejected_causes(singles, (), best),
        modes=modes_of(data, None),
        gain=None,
        next_measurement="None: the data are what the reference says."
        if verdict == "nothing_to_explain"
        else "A longer log, and more sensors: none of the known causes, nor two together, explains the data.",
    )
    return Explained(diagnosis, None)


def _explained(
    reference: Reference,
    data: Comparison,
    found: list[Candidate],
    singles: list[Candidate],
    heldout: Comparison | None,
) -> Explained:
    """Name the causes that hold 0.8 of the posterior, those that the data cannot separate as one."""
    named, sure = named_causes(data, found, _SURE)
    best = found[0]
    extended = reference.calibration.structure
    for part in sorted(best.chosen, key=lambda c: c.cause.place_free):  # a factor on everything comes last
        extended = part.cause.extend(extended, part.row, part.theta)
    accepted = {name for cause in named for name in (cause.cause, *cause.cannot_be_told_from)}
    settings: dict[str, Any] = {"verdict": "explained" if sure else "ambiguous"}
    diagnosis = Diagnosis(
        causes=named,
        rejected=rejected_causes(singles, accepted, best.log_evidence),
        modes=modes_of(data, best.chosen),
        gain=gain_of(heldout or data, best.chosen, heldout=heldout is not None),
        next_measurement=" ".join(dict.fromkeys(c.cause.advice for c in best.chosen)),
        **settings,
    )
    return Explained(diagnosis, extended)
