"""Several causes together: found step by step, each step sought widely and followed until it rests.

Every cause of the catalogue is added to the best so far, to first order. The most probable combinations are fitted in
turns, each cause over all its alternatives while the parameters of the others are fitted too. Turns end where no single
cause changes its alternative. Each cause of the best is then also put at its next place, and a rare cause is replaced
by a common one with a similar effect.
"""

import itertools
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes import (
    CATALOGUE,
    CONNECTIONS,
    Cause,
    CommonFactor,
    JointHypothesis,
    SelectedCause,
    has_unobserved_mode,
)
from updater.diagnosis.places import next_place
from updater.diagnosis.weighing import ERRS, HOPELESS, Candidate, EvidenceComparison, at_most, ranked
from updater.inference import Fit, fit, foreseen, pulls

_MAX = 300  # alternatives of a cause that are looked at; of more, evenly many
_MIN = 1.0  # chi-square by a step of one prior standard deviation: smaller effects explain nothing
_ALIKE = 1e-6  # relative to the product of two squares, the determinant of similar effects: one of them is sufficient
_FARTHEST = 3.0  # prior standard deviations that a fit begins from


@dataclass(frozen=True, eq=False)
class _Columns:
    """Effect of a unit of each parameter of each alternative on the data, without a drift common to all frequencies."""

    names: list[str]  #: names of the causes
    effect: FloatArray  #: (n, n_data) whitened
    precision: FloatArray  #: (n,) of the priors
    log_prior: FloatArray  #: (n,) of the alternatives and their causes
    cause: IndexArray  #: (n,)
    row: IndexArray  #: (n,) alternative
    parameter: IndexArray  #: (n,)
    rest: FloatArray  #: (n_data,) whitened, that nothing but a drift leaves


def likeliest_pair(weighing: EvidenceComparison) -> tuple[SelectedCause, SelectedCause] | None:
    """Return the two alternatives that explain most together, as they do to first order; None if there are no two."""
    columns = _columns(weighing)
    if columns is None:
        return None
    gram, score = columns.effect @ columns.effect.T, columns.effect @ columns.rest
    square = np.diagonal(gram) + columns.precision
    product = np.outer(square, square)
    determinant = product - gram**2
    cross = np.outer(score**2, square)
    gain = (cross + cross.T - 2 * np.outer(score, score) * gram) / np.maximum(determinant, _ALIKE * product)
    evidence = gain / 2 + columns.log_prior[:, None] + columns.log_prior
    same = (columns.cause[:, None] == columns.cause) & (columns.row[:, None] == columns.row)
    evidence[same | (determinant < _ALIKE * product)] = -np.inf
    one, other = (int(k) for k in np.unravel_index(np.argmax(evidence), evidence.shape))
    if evidence[one, other] == -np.inf:
        return None
    both = [one, other]
    normal = gram[np.ix_(both, both)] + np.diag(columns.precision[both])
    first, second = np.linalg.solve(normal, score[both]).tolist()
    return _begun(weighing, columns, one, first), _begun(weighing, columns, other, second)


def _columns(weighing: EvidenceComparison) -> _Columns | None:
    data = replace(weighing.data, plain=weighing.data.drifting)  # sensors, too, together with a drift
    names: list[str] = []
    parts = []
    for name, cause in weighing.causes.items():
        std, n = cause.prior_std, len(cause.log_prior)
        if has_unobserved_mode(cause) or isinstance(cause, CommonFactor) or not len(std):
            continue
        rows = np.arange(0, n, -(-n // _MAX))
        rest, effect = pulls(data, cause, rows)
        at, parameter = np.nonzero((effect**2).sum(1) * std**2 > _MIN)
        prior = cause.log_prior[rows[at]] + weighing.log_prior(name)
        parts.append(
            (effect[at, :, parameter], std[parameter] ** -2, prior, np.full(len(at), len(names)), rows[at], parameter)
        )
        names.append(name)
    if not parts:
        return None
    effect, precision, prior, number, row, parameter = (np.concatenate(each) for each in zip(*parts, strict=True))
    return _Columns(names, effect, precision, prior, number, row, parameter, -rest)


def _begun(weighing: EvidenceComparison, columns: _Columns, number: int, strength: float) -> SelectedCause:
    cause, row = weighing.causes[columns.names[columns.cause[number]]], int(columns.row[number])
    theta, at = cause.neutral_start[row].copy(), int(columns.parameter[number])
    theta[at] = strength
    reach = _FARTHEST * cause.prior_std
    return SelectedCause(cause, row, np.maximum(np.clip(theta, -reach, reach), cause.lower[row]))


_MANY = 100  # alternatives of which every second one is predicted to first order
_CLOSER = 3  # pairs that are fitted, of all that are predicted to first order; one fewer of more causes
_LATER = 2  # pairs after these that are fitted too
_MODES_EACH = 4  # frequencies that each cause that changes them must have, from the third cause on; ...
_OF_SHAPE = 0.5  # ... the shape of a mode counts as half a frequency: places are determined by shapes as well
_DATA_EACH = 2  # data of all kinds that each must have, from the second one on: a place and a size
_LIKELIEST = 2  # causes that are tried with two bodies
_FURTHER = 3  # more pairs that are fitted where none of these fits
_TURNS, _STILL = 3, 1.0  # times that all are fitted again, while log evidence grows by more than this
_NEXT = 8.0  # of log density under a cause's best place: another one that is tried


@dataclass(frozen=True, eq=False)
class PredictedCandidate:
    """Several causes together, of which the last has not been fitted yet."""

    chosen: tuple[SelectedCause, ...]
    log_evidence: float  #: log evidence predicted to first order, without the prior volume of its parameters
    fewer: float  #: log evidence without the one that has not been fitted

    @property
    def names(self) -> tuple[str, ...]:
        """Of the causes."""
        return tuple(c.cause.name for c in self.chosen)


def _error(predicted: PredictedCandidate) -> float:
    """Return the error of first order that a predicted log evidence may have."""
    return HOPELESS + ERRS * max(predicted.log_evidence - predicted.fewer, 0.0)


def common(names: Sequence[str]) -> list[str]:
    """Return names of causes in order, each rare one as its common form."""
    return sorted(CATALOGUE[name].common_form or name for name in names)


def _is_hopeless(fitted: Candidate, known: Sequence[Candidate]) -> bool:
    """Return whether a fit cannot come within reach of another one, however it is refined.

    Refinement moves causes to other places, which is what `at_most` bounds: the log evidence, and 15 and a fifth of
    half the misfit in addition.
    """
    return any(fitted.at_most < other.log_evidence for other in known)


@dataclass(frozen=True, eq=False)
class Compositions:
    """Several of the weighed causes at once."""

    weighing: EvidenceComparison

    def rank_by_linear_prediction(self, seeds: Sequence[Candidate]) -> list[PredictedCandidate]:
        """Predict to first order the gain of each cause in addition to each of the seeds, the best first.

        Oscillators without a measured mode are left out: they explain too much of other misfits.
        """
        seeds = [s for s in seeds if not any(has_unobserved_mode(c.cause) for c in s.chosen)]
        tried = [
            (seed, name, cause)
            for seed in itertools.chain(seeds, *(self._at_next_place(seed) for seed in seeds if len(seed.chosen) == 1))
            for name, cause in self.weighing.causes.items()
            if not has_unobserved_mode(cause) and not self._is_full(seed, cause) and not self._is_included(seed, cause)
        ]
        found = []
        for done, (seed, name, cause) in enumerate(tried):
            names = (*seed.names, name)
            self.weighing.on_cause(names, done, len(tried))
            found.append(self.weighing.faults.attempt(" and ".join(names), partial(self._promise, seed, name, cause)))
        return sorted((p for p in found if p is not None), key=lambda p: -p.log_evidence)

    def at_once(self, only: Collection[str] | None = None, *, known: Sequence[Candidate] = ()) -> list[Candidate]:
        """Fit the two causes that explain most together to first order, wherever the one that does alone may be.

        A rare cause among them is exchanged for the common one that acts much like it, too.

        Parameters
        ----------
        only : names of the causes to which the pair is limited; None: all that are considered
        known : other pairs; a fit that cannot exceed them is not refined (`_is_hopeless`)
        """
        allowed = [name for name in self.weighing.causes if only is None or name in only]
        weighing = self.weighing if only is None else replace(self.weighing, allowed=allowed)
        pair = self.weighing.faults.attempt("a pair of causes to first order", partial(likeliest_pair, weighing))
        found = None if pair is None else self.converged_fit(pair, known)
        if found is None:
            return []
        others = self._alike(found) if only is None and not _is_hopeless(found, known) else []
        alike = [self.converged_fit(chosen, known) for chosen in others]
        return ranked([found, *(other for other in alike if other is not None)])

    def with_two_bodies(self, singles: Sequence[Candidate]) -> list[Candidate]:
        """Fit the most probable causes that are no bodies, each with two bodies, all from their neutral starts.

        A cause that is sought alone, or with one body, may converge far from its place. Here the last body is sought
        over all places first, while the others are at their first places with parameters that are fitted too; then the
        others in turn.
        """
        body = next((self.weighing.cause(name) for name in self.weighing.common_forms), None)
        if body is None:
            return []
        rare = {body.name, *(name for name in self.weighing.causes if CATALOGUE[name].common_form)}
        others = [c.chosen[0].cause for c in singles if c.names[0] not in rare]
        permitted = [one for one in others if not has_unobserved_mode(one) and 2 + one.drifting <= self.most_drifting]
        found = []
        for other in permitted[:_LIKELIEST]:
            chosen = tuple(map(SelectedCause.begun, (body, other, body)))
            found.append(self.converged_fit(chosen))
        return [c for c in found if c is not None]

    def exchanged(self, best: Candidate) -> list[Candidate]:
        """Fit the best explanation with each cause in turn exchanged for another one.

        A cause that was added first may imitate two others, of which only one is then found in addition (sequential
        replacement: Miller, A. (2002). Subset selection in regression, 2nd ed., section 3.5). What cannot exceed the
        best one is not fitted.
        """
        found = []
        for number, one in enumerate(best.chosen):
            if CATALOGUE[one.cause.name].of_the_file:
                continue
            rest = self.coordinate_fit(best.chosen[:number] + best.chosen[number + 1 :])
            promises = [] if rest is None else self.rank_by_linear_prediction([rest])
            worth = [
                p
                for p in promises
                if sorted(p.names) != sorted(best.names) and p.log_evidence + _error(p) >= best.log_evidence
            ]
            if worth:
                found += self._fitted(self._worth_fitting(worth), [best])
        return found

    @cached_property
    def _same_factor(self) -> list[Cause]:
        """Makers of indistinguishable factors on all frequencies; the first one represents all."""
        return [c for c in self.weighing.causes.values() if isinstance(c, CommonFactor) and not c.informed]

    def _is_included(self, seed: Candidate, cause: Cause) -> bool:
        """Return whether a cause is a factor on all frequencies that is represented already.

        A file that is off may be so in all its stiffness: that is one, and it is off once.
        """
        of_the_file = any(CATALOGUE[name].of_the_file for name in seed.names)
        if CATALOGUE[cause.name].of_the_file:
            return of_the_file
        if not isinstance(cause, CommonFactor):
            return False
        has_one = of_the_file or any(isinstance(c.cause, CommonFactor) for c in seed.chosen)
        return has_one or cause in self._same_factor[1:]

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

    def of_the_file_alone(self, found: Candidate) -> bool:
        """Return whether all causes are parameters of a file, and feet or joints that are softer than these permit."""
        of_the_file = self.weighing.of_the_file
        return any(n in of_the_file for n in found.names) and all(
            n in of_the_file or n in CONNECTIONS for n in found.names
        )

    def _is_full(self, seed: Candidate, cause: Cause) -> bool:
        """Return whether one more cause that changes frequencies would have as many parameters as data.

        Feet and joints together with parameters of a file are errors of the file, which are not counted.
        """
        counted = [c for c in seed.chosen if c.cause.drifting]
        return cause.drifting and len(counted) >= self.most_drifting and not self.of_the_file_alone(seed)

    @property
    def most_drifting(self) -> int:
        """Number of causes that change frequencies which the data determine."""
        data = self.weighing.data
        n_modes = len(data.log_ratio) + _OF_SHAPE * np.count_nonzero(data.shaped)
        return int(min(max(2, n_modes // _MODES_EACH), max(1, data.freedom // _DATA_EACH)))

    def _promise(self, seed: Candidate, name: str, cause: Cause) -> PredictedCandidate | None:
        n_own = len(cause.prior_std)
        theta = np.concatenate([np.zeros(n_own), *(c.theta for c in seed.chosen)])
        beside: JointHypothesis[Cause] = JointHypothesis(cause, seed.chosen)
        rows = np.flatnonzero(np.isfinite(beside.log_prior))
        rows = rows[:: 2 if len(rows) > _MANY else 1]  # those in between are similar, and are fitted afterwards
        if not len(rows):
            return None
        cost = -foreseen(self.weighing.data, beside, theta, n_own, rows)
        gain = 0.5 * (seed.chi_square - cost) + cause.log_prior[rows]
        best = int(np.argmax(gain))
        row, evidence = int(rows[best]), seed.log_evidence + float(gain[best]) + self.weighing.log_prior(name)
        return PredictedCandidate(
            (*seed.chosen, SelectedCause(cause, row, np.zeros(n_own))), evidence, seed.log_evidence
        )

    def together(self, promises: Sequence[PredictedCandidate]) -> list[Candidate]:
        """Fit the best predictions; two causes of one kind are two, and failing ones are left out."""
        return self._fitted(self._worth_fitting(promises))

    def later(self, promises: Sequence[PredictedCandidate], fitted: Sequence[Candidate]) -> list[Candidate]:
        """Fit the best predictions after those of `together`, where others than these causes are fitted.

        The error of first order may exceed what separates the predictions.
        """
        tried, fits = [sorted(c.names) for c in fitted], self._worth_fitting(promises)
        left = [p for p in promises[: len(fits) + _LATER] if p not in fits and self._is_near(promises[0], p)]
        most = max((c.log_evidence for c in fitted), default=-np.inf)
        found = [self.likely_fit(p.chosen, most) for p in left if sorted(p.names) not in tried]
        return [again for c in found if c is not None and (again := self._refit_until_converged(c)) is not None]

    def further(self, promises: Sequence[PredictedCandidate], known: Sequence[Candidate]) -> list[Candidate]:
        """Fit the best of those left out by `together`, each with other causes: the error of first order may be larger.

        A body at a position that compensates for an adjacent stretch reduces the predicted effect of that stretch.

        Parameters
        ----------
        promises : all predictions, the best first
        known : other fits; fits that cannot exceed them are not refined
        """
        tried = [common(p.names) for p in self._worth_fitting(promises)]
        others: dict[tuple[str, ...], PredictedCandidate] = {}
        for promise in promises:
            names = common(promise.names)
            if names == sorted(promise.names) and names not in tried and promise.log_evidence > promise.fewer:
                others.setdefault(tuple(names), promise)
        return self._fitted(list(others.values())[:_FURTHER], known) if others else []

    def _fitted(self, promises: Sequence[PredictedCandidate], known: Sequence[Candidate] = ()) -> list[Candidate]:
        """Return the fits of predictions, the best also with its causes at other places and with similar causes.

        Parameters
        ----------
        promises : predictions, the best first
        known : other fits; where these cannot be exceeded, the best of the predictions is not refined
        """
        found: dict[tuple[str, ...], Candidate] = {}

        def keep(fitted: Candidate | None) -> None:
            if fitted is None:
                return
            key = tuple(sorted(fitted.names))
            if key not in found or found[key].log_evidence < fitted.log_evidence:
                found[key] = fitted

        for done, promise in enumerate(promises):
            self.weighing.on_cause(promise.names, done, len(promises))
            keep(self.likely_fit(promise.chosen, max((c.log_evidence for c in found.values()), default=-np.inf)))
        if not found:
            return []
        best = max(found.values(), key=lambda c: c.log_evidence)
        if _is_hopeless(best, known):
            return self._with_other_makers(sorted(found.values(), key=lambda c: -c.log_evidence))
        keep(self._refit_until_converged(best))
        for other in self._at_next_place(best):
            keep(self.converged_fit(other.chosen))
        tried = None
        while tried is not (best := max(found.values(), key=lambda c: c.log_evidence)):
            tried = best
            for chosen in self._alike(best):
                keep(self.converged_fit(chosen))
        return self._with_other_makers(sorted(found.values(), key=lambda c: -c.log_evidence))

    def _worth_fitting(self, promises: Sequence[PredictedCandidate]) -> list[PredictedCandidate]:
        """Return the predictions that may exceed the best one within the error of first order.

        And that of common causes alone, where the best has rare ones.
        """
        best = promises[0]
        few = [p for p in promises[: _CLOSER + 2 - len(best.chosen)] if self._is_near(best, p)]
        plain = common(best.names)
        return few + [p for p in promises if common(p.names) == sorted(p.names) == plain and p not in few][:1]

    @staticmethod
    def _is_near(best: PredictedCandidate, other: PredictedCandidate) -> bool:
        """Return whether a prediction may exceed the best one within the error of first order."""
        return other.log_evidence >= best.log_evidence - _error(best)

    def converged_fit(self, chosen: tuple[SelectedCause, ...], known: Sequence[Candidate] = ()) -> Candidate | None:
        """Return causes fitted in turn, and again while the fit improves; None where the first fit fails.

        Parameters
        ----------
        chosen : causes, with the parameters from which their fit begins
        known : other fits; where these cannot be exceeded, causes are fitted once
        """
        return self._refit_until_converged(self.coordinate_fit(chosen), known)

    def _refit_until_converged(self, fitted: Candidate | None, known: Sequence[Candidate] = ()) -> Candidate | None:
        """Refit each cause with the others at their present values while the fit improves and may exceed others."""
        if fitted is None or _is_hopeless(fitted, known):
            return fitted
        for _ in range(_TURNS):
            again = self.coordinate_fit(fitted.chosen)
            if again is None:
                return fitted
            if again.log_evidence < fitted.log_evidence + _STILL:
                return max(fitted, again, key=lambda c: c.log_evidence)
            fitted = again
        return fitted

    def _at_next_place(self, fitted: Candidate) -> list[Candidate]:
        """Return the same with each cause in turn at its next place, which fits in turns do not reach."""
        found = []
        room = _NEXT + ERRS * fitted.misfit / 2
        for number, part in enumerate(fitted.parts):
            row = next_place(part, room)
            if row is not None:
                moved = SelectedCause(part.hypotheses, row, part.theta[row])
                less = float(part.log_density[part.best] - part.log_density[row])
                found.append(
                    replace(
                        fitted,
                        chosen=(moved, *fitted.chosen[:number], *fitted.chosen[number + 1 :]),
                        log_evidence=fitted.log_evidence - less,
                        chi_square=float(part.chi_square[row]),
                    )
                )
        return found

    def _alike(self, fitted: Candidate) -> list[tuple[SelectedCause, ...]]:
        """Return the causes with a common one in the place of a rare one that acts much like it."""
        found = []
        for number, one in enumerate(fitted.chosen):
            other = self.weighing.cause(CATALOGUE[one.cause.name].common_form)
            if other is not None:
                others = fitted.chosen[:number] + fitted.chosen[number + 1 :]
                found.append((*others, SelectedCause.begun(other)))
        return found

    def likely_fit(self, chosen: tuple[SelectedCause, ...], log_evidence: float) -> Candidate | None:
        """Return causes fitted in turn; None if the first of these fits is far below a log evidence, or one fails."""
        *others, last = chosen
        free = self.weighing.cause(last.cause.name)
        if free is None:
            return None
        names = " and ".join(self.weighing.label(c.cause.name) for c in chosen)
        first = self.weighing.faults.attempt(names, lambda: self.weighing.first_beside(free, tuple(others)))
        if first is None:
            return None
        prior = sum(self.weighing.log_prior(c.cause.name) for c in chosen)
        # places that the others leave open count, too: at most all of their alternatives
        prior -= sum(float(c.cause.log_prior[c.row]) for c in others)
        reached = at_most(first.log_evidence + prior, float(first.chi_square.min()), first.freedom)
        return self.coordinate_fit(chosen) if reached > log_evidence else None

    def coordinate_fit(self, chosen: tuple[SelectedCause, ...]) -> Candidate | None:
        """Return causes fitted in turn, all alternatives of each with the best of the others, the last one first.

        None where a fit fails.
        """
        names = " and ".join(self.weighing.label(c.cause.name) for c in chosen)
        return self.weighing.faults.attempt(names, partial(self._settled, chosen))

    def _settled(self, chosen: tuple[SelectedCause, ...]) -> Candidate:
        parts: list[Fit[Cause]] = []
        for _ in chosen:
            *others, last = chosen
            free = self.weighing.cause(last.cause.name)
            if free is None:
                raise KeyError(last.cause.name)
            found = self.weighing.fit_beside(free, tuple(others))
            chosen = found.hypotheses.best(found)
            parts.insert(0, found.hypotheses.of_free(found))
        return _with_known_evidence(self.weighing.joint_candidate(found, chosen, tuple(parts)))

    def fit_from(self, found: Candidate) -> Candidate | None:
        """Return an explanation fitted again from its own parameters, with its own alternatives of the first cause.

        None where the fit fails.
        """
        names = " and ".join(self.weighing.label(name) for name in found.names)
        return self.weighing.faults.attempt(names, partial(self._from, found))

    def _from(self, found: Candidate) -> Candidate:
        (_, *others), (part, *rest) = found.chosen, found.parts
        together = JointHypothesis(part.hypotheses, tuple(others))
        beside = np.concatenate([np.zeros(0), *(c.theta for c in others)])
        start = np.hstack([part.theta, np.tile(beside, (len(part.theta), 1))])
        again = fit(self.weighing.data, together, refine=False, start=start)
        parts = together.of_free(again), *rest
        return _with_known_evidence(self.weighing.joint_candidate(again, together.best(again), parts))


def _with_known_evidence(candidate: Candidate) -> Candidate:
    if np.isnan(candidate.log_evidence):
        raise FloatingPointError("the log evidence is not a number")
    return candidate
