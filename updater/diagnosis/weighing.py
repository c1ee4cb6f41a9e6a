"""Causes of the catalogue fitted to the same data, each alone, with the evidence for each."""

import logging
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from daq import FloatArray
from daq.bounded_text import meant
from updater.causes import (
    CATALOGUE,
    Cause,
    JointHypothesis,
    MayOpen,
    Nothing,
    Propose,
    SelectedCause,
    joint_opening,
    prediction,
)
from updater.errors import SelectionError
from updater.inference import Comparison, Fit, evaluate, fit, refined_fit
from updater.quantities import SIGNIFICANT
from updater.reference import Reference

T = TypeVar("T")
JointKey = tuple[Comparison, Cause, tuple[Hashable, ...]]  #: data, the free cause, and the alternatives of the others
_log = logging.getLogger(__name__)


class Faults:
    """Faults found so far in one diagnosis, by the cause or the causes in which they occurred."""

    def __init__(self) -> None:
        self._found: dict[str, str] = {}

    @property
    def found(self) -> Mapping[str, str]:
        """Type and message of the first fault of each."""
        return self._found

    def attempt(self, what: str, function: Callable[[], T]) -> T | None:
        """Return the result of a function; record a fault in it and return None.

        Parameters
        ----------
        what : name of the cause, or names of the causes, that the function evaluates
        function : computation; a cause may be any distribution's, which may raise anything
        """
        try:
            return function()
        except Exception as error:  # noqa: BLE001 - a fault of any kind costs this cause alone
            text = f"{type(error).__name__}: {' '.join(str(error).split())}"
            if what not in self._found:
                _log.warning("internal error, %s is not considered: %s", what, text)
                _log.debug("", exc_info=True)
            self._found.setdefault(what, text)
            return None


PRIOR_NOTHING = 0.5
#: probability that every parameter of a structure file is right within the deviations of measured modes: models that
#: were never compared with their structure are off by per cents, and modes are measured to a fraction of one
PRIOR_FILE_IS_RIGHT = 0.01
SURE = 0.8  #: posterior at which a cause is named
DOUBTFUL = 0.01  #: p value of a fit under which one more cause is tried
WELL = 0.5  #: p value from which on no other pair is sought, and no relaxed form
MUCH = 8.0  #: log evidence above which a relaxed form, or with faces a further cause, is tried despite a good fit
HOPELESS = 15.0  #: predicted log evidence below the best: causes that are not considered further ...
ERRS = 0.2  #: ... and relative to the predicted gain of the best: error of first order
N_SEEDS = 3  #: best candidates to which another cause is added
_FEW = 16  # alternatives that are refined at next to no cost
_NEIGHBOURING = 100.0  # of chi-square above that of the known fit, where a fit may begin at the parameters of another
_TWINS = 0.05  # of frequency, between modes that may be one, if their shapes are
_TWINS_MAC = 0.8
_EQUAL = 0.02  # log evidence between causes that the data do not distinguish
_MIN_GAIN = 10.0  # chi-square relative to a common drift, or to fewer causes: a smaller gain is not an effect


def allowed_causes(only: Collection[str] = (), without: Collection[str] = ()) -> tuple[str, ...]:
    """Return the names of the catalogue's causes that are considered, in its order.

    Parameters
    ----------
    only : names to which the search is limited; all causes if empty
    without : names that are left out

    Raises
    ------
    SelectionError
        If the catalogue has no cause of a name, or none is left.
    """
    for name in (*only, *without):
        if name not in CATALOGUE:
            raise SelectionError(
                f"no cause is named {name!r}{meant(name, CATALOGUE)}; the causes are {', '.join(CATALOGUE)}"
            )
    allowed = tuple(name for name in CATALOGUE if (not only or name in only) and name not in without)
    if not allowed:
        raise SelectionError("no cause is left to consider")
    return allowed


#: called before each fit with its causes, and how many fits of the same kind are done and planned
OnCause = Callable[[Sequence[str], int, int], None]


def say_nothing(names: Sequence[str], done: int, planned: int) -> None:
    """Ignore which causes are fitted."""
    del names, done, planned


@dataclass(frozen=True, eq=False)
class Candidate:
    """One cause, or several together, fitted."""

    chosen: tuple[SelectedCause, ...]  #: the best alternative of each
    parts: tuple[Fit[Cause], ...]  #: the fit of each, the others' uncertainty included
    log_evidence: float  #: log evidence with the prior of the causes
    p_value: float
    chi_square: float  #: chi-square of the best alternatives, priors included
    effective: bool = True  #: whether its effect exceeds that of a drift common to all frequencies

    @property
    def names(self) -> tuple[str, ...]:
        """Of the causes."""
        return tuple(c.cause.name for c in self.chosen)

    @property
    def misfit(self) -> float:
        """Chi-square beyond its expected value."""
        return max(self.chi_square - self.parts[0].freedom, 0.0)

    @property
    def at_most(self) -> float:
        """Largest log evidence that it is assumed to reach with further alternatives."""
        return at_most(self.log_evidence, self.chi_square, self.parts[0].freedom)

    def earned(self, fewer: "Sequence[Candidate]") -> bool:
        """Return whether all of its causes have an effect: a combination fits better than any of its parts."""
        parts = [c for c in fewer if len(c.chosen) < len(self.chosen) and Counter(c.names) <= Counter(self.names)]
        return all(self.chi_square < part.chi_square - _MIN_GAIN for part in parts)


def _same_alternatives(one: Cause, other: Cause) -> bool:
    """Return whether two proposals of a cause differ at most in where the fits of their alternatives begin."""
    arrays, others = (
        {name: values for name, values in vars(cause).items() if isinstance(values, np.ndarray) and name != "start"}
        for cause in (one, other)
    )
    return type(one) is type(other) and all(
        others[name] is arrays[name] or np.array_equal(others[name], arrays[name])
        for name in arrays.keys() & others.keys()  # either may have cached arrays that follow from those of both
    )


def at_most(log_evidence: float, chi_square: float, freedom: float) -> float:
    """Return the largest log evidence that a fit is assumed to reach with further alternatives.

    They may reduce the misfit by a share: refined alternatives exceeded it in one of 3391 fits of single causes.
    """
    return log_evidence + HOPELESS + ERRS * max(chi_square - freedom, 0.0) / 2


def shown_by_signals(part: Fit[Cause]) -> bool:
    """Return whether the signals show a loss of stiffness that opens and closes; it may be too small for the modes.

    Two standard deviations are a log likelihood ratio of two.
    """
    return bool(_by_signals(part)[part.best] > SIGNIFICANT**2 / 2)


def _by_signals(part: Fit[Cause]) -> FloatArray:
    """Return the log likelihood ratio (n_alternatives,) of opening and closing to none by the signals."""
    cause, n = part.hypotheses, len(part.theta)
    return cause.opening(part.theta, np.arange(n)) if isinstance(cause, MayOpen) else np.zeros(n)


def evidence_of_signals(candidate: Candidate) -> list[float]:
    """Return the log evidence that the signals add to that of the modes for each cause, 0 if it cannot open and close.

    That of the candidate is the largest of the losses of stiffness.
    """
    found = []
    for part in candidate.parts:
        by_modes = part.log_density - joint_opening(part, [other for other in candidate.parts if other is not part])
        alone, both = (replace(part, log_density=one) for one in (by_modes, by_modes + _by_signals(part)))
        found.append(both.log_evidence - alone.log_evidence if isinstance(part.hypotheses, MayOpen) else 0.0)
    return found


def ranked(found: Sequence[Candidate]) -> list[Candidate]:
    """Return the most probable first; indistinguishable ones in their given order, independent of rounding."""
    order = sorted(range(len(found)), key=lambda k: -found[k].log_evidence)
    steps = np.diff([-found[k].log_evidence for k in order], prepend=-np.inf) > _EQUAL
    group = dict(zip(order, np.cumsum(steps).tolist(), strict=True))
    return [found[k] for k in sorted(order, key=lambda k: (group[k], k))]


@dataclass(frozen=True, eq=False)
class EvidenceComparison:
    """The catalogue's causes for one reference and one set of data.

    Parameters
    ----------
    on_cause : called before each fit with its causes, and how many fits of the same kind are done and planned
    instead : makers of causes that replace those of the catalogue
    allowed : names of the causes that are considered
    faults : collects failures; a cause that has failed alone is not considered further
    proposed : causes made so far, by their data and label
    fitted : first alternatives of causes fitted alone so far, by label
    first : fits of a cause's first alternatives with those of others so far, by data, cause and effects of the others
    joint : fits of refined alternatives, by those of the first
    neighbours : fits of first alternatives, by names and types of the others and of the cause
    """

    reference: Reference
    data: Comparison
    on_cause: OnCause = field(default=say_nothing)
    instead: Mapping[str, Propose[Cause]] = field(default_factory=dict)
    allowed: Collection[str] = field(default_factory=lambda: CATALOGUE)
    faults: Faults = field(default_factory=Faults)
    proposed: dict[tuple[Comparison, str], Cause | None] = field(default_factory=dict, repr=False)
    fitted: dict[str, Fit[Cause]] = field(default_factory=dict, repr=False)
    first: dict[JointKey, Fit[JointHypothesis[Cause]]] = field(default_factory=dict, repr=False)
    joint: dict[Fit[JointHypothesis[Cause]], Fit[JointHypothesis[Cause]]] = field(default_factory=dict, repr=False)
    neighbours: dict[tuple[Hashable, ...], list[Fit[JointHypothesis[Cause]]]] = field(default_factory=dict, repr=False)

    @property
    def causes(self) -> Mapping[str, Cause]:
        """Those that have alternatives here, by name."""
        every = {name: self.cause(name) for name in CATALOGUE if name in self.allowed}
        return {name: cause for name, cause in every.items() if cause is not None}

    def cause(self, name: str) -> Cause | None:
        """Return a cause; None if it is not considered, has no alternatives here, or has failed."""
        key = self.data, self.label(name)
        if name not in self.allowed or key[1] in self.faults.found:
            return None
        if key not in self.proposed:
            propose = self.instead.get(name, CATALOGUE[name].propose)
            self.proposed[key] = self.faults.attempt(key[1], partial(propose, self.reference, self.data))
        return self.proposed[key]

    def label(self, name: str) -> str:
        """Return the name of a cause, marked if its maker is not that of the catalogue."""
        return f"{name} (another form)" if name in self.instead else name

    @property
    def of_the_file(self) -> list[str]:
        """Names of the considered causes that are errors of the structure file: of many places, each a little."""
        return [name for name in self.causes if CATALOGUE[name].of_the_file]

    @property
    def common_forms(self) -> list[str]:
        """Names of the considered causes that are common forms of rare ones."""
        forms = {entry.common_form for entry in CATALOGUE.values()}
        return [name for name in self.causes if name in forms]

    @cached_property
    def nothing(self) -> Fit[Nothing]:
        """Fit of no change."""
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
        """Return whether a new mode is not an old one that identification split in two: near it, with its shape."""
        data = self.data
        if data.new is None:
            return False
        now = np.log(data.frequency[data.paired]) + data.log_ratio
        near = np.abs(data.new.log_frequency[:, None] - now) < _TWINS
        alike = (data.new.shape @ data.shape.T) ** 2 > _TWINS_MAC
        return bool((~(near & alike).any(1)).all())

    def log_prior(self, name: str) -> float:
        """Return the log probability of a cause."""
        if CATALOGUE[name].of_the_file:
            return float(np.log(PRIOR_NOTHING * (1 - PRIOR_FILE_IS_RIGHT) / PRIOR_FILE_IS_RIGHT))
        whole = sum(entry.rarity for entry in CATALOGUE.values() if not entry.of_the_file)
        return float(np.log((1 - PRIOR_NOTHING) * CATALOGUE[name].rarity / whole))

    def joint_candidate(
        self, found: Fit[JointHypothesis[Cause]], chosen: tuple[SelectedCause, ...], parts: tuple[Fit[Cause], ...]
    ) -> Candidate:
        """Return causes fitted together, with their evidence.

        The fit sums over the alternatives of the first cause. Each other counts with those that it leaves open.

        Parameters
        ----------
        found : fit of the first cause's alternatives with the others
        chosen : the best alternative of each
        parts : the fit of each, the others' uncertainty included
        """
        open_ones = sum(float(np.log(part.probability[part.best])) for part in parts[1:])
        evidence = found.log_evidence - open_ones + sum(self.log_prior(c.cause.name) for c in chosen)
        return Candidate(chosen, parts, evidence, found.p_value, float(found.chi_square.min()))

    def singles(self, only: Sequence[str] = ()) -> list[Candidate]:
        """Fit every cause alone, or only some, the best first; one that fails is left out.

        Refined alternatives are fitted of causes that may become likely, and of those that others are added to.
        """
        found = self.first_fits(only)
        for number in range(len(found)):
            best = max(found, key=lambda c: c.log_evidence)
            one = found[number]
            if number < N_SEEDS or len(one.parts[0].theta) <= _FEW or one.at_most > best.log_evidence:
                refined = self.refined(one)
                found[number] = one if refined is None else refined
        return ranked(found)

    def first_fits(self, only: Sequence[str] = ()) -> list[Candidate]:
        """Fit the first alternatives of every cause alone, or only of some, the best first."""
        found = []
        causes = [(name, cause) for name, cause in self.causes.items() if not only or name in only]
        for done, (name, cause) in enumerate(causes):
            self.on_cause((name,), done, len(causes))
            found.append(self.faults.attempt(self.label(name), partial(self._single, name, cause)))
        return ranked([candidate for candidate in found if candidate is not None])

    def refined(self, single: Candidate) -> Candidate | None:
        """Fit refined alternatives of a cause alone, as of its first fit; None if that fails."""
        (name,), (first,) = single.names, single.parts
        return self.faults.attempt(self.label(name), lambda: self._candidate(name, refined_fit(self.data, first)))

    def known_start(self, cause: Cause) -> FloatArray | None:
        """Return the parameters of a cause's alternatives fitted alone to these or other data; None if there are none.

        A cause may have other alternatives for other data: then they are not known.
        """
        known = self.fitted.get(self.label(cause.name))
        return known.theta if known is not None and _same_alternatives(known.hypotheses, cause) else None

    def first_beside(self, free: Cause, others: tuple[SelectedCause, ...]) -> Fit[JointHypothesis[Cause]]:
        """Fit the first alternatives of a cause together with one alternative of each other cause.

        The parameters of the others only begin the fit: where it was made before with the same alternatives, as in the
        last turn of a search, it is not repeated.
        """
        key = self.data, free, tuple(other.alternative for other in others)
        if key not in self.first:
            together = JointHypothesis(free, others, start_neutral=bool(others))
            kinds = tuple((cause.name, type(cause)) for cause in (*(other.cause for other in others), free))
            known = self.neighbours.setdefault(kinds, [])
            start = self._neighbouring(together, known) if others else self.known_start(free)
            self.first[key] = fit(self.data, together, refine=False, start=start)
            known.append(self.first[key])
        return self.first[key]

    def fit_beside(self, free: Cause, others: tuple[SelectedCause, ...]) -> Fit[JointHypothesis[Cause]]:
        """Fit all alternatives of a cause, refined ones afterwards, as `first_beside` does the first ones."""
        first = self.first_beside(free, others)
        if first not in self.joint:
            self.joint[first] = refined_fit(self.data, first)
        return self.joint[first]

    def _neighbouring(
        self, together: JointHypothesis[Cause], known: Sequence[Fit[JointHypothesis[Cause]]]
    ) -> FloatArray | None:
        """Return the parameters of a fit with similar others or data, at which the fit of all alternatives may begin.

        The others' parameters differ from one alternative to the next as they did there. None where the best of no
        known fit remains about as good.
        """
        alike = [found for found in known if _same_alternatives(found.hypotheses.free, together.free)]
        if not alike:
            return None
        n_own, lower = len(together.free.prior_std), together.lower
        others = np.concatenate([c.theta for c in together.chosen])
        best = np.array([found.best for found in alike])
        begun = np.array([np.append(found.theta[found.best, :n_own], others) for found in alike])
        cost = evaluate(self.data, together, np.maximum(begun, lower[best]), best).cost  # of all known fits at once
        usable = cost < np.array([found.chi_square.min() for found in alike]) + _NEIGHBOURING
        if not usable.any():
            return None
        nearest = alike[int(np.argmin(np.where(usable, cost, np.inf)))]
        start = nearest.theta.copy()
        start[:, n_own:] += others - nearest.theta[nearest.best, n_own:]
        return np.maximum(start, lower)

    def _single(self, name: str, cause: Cause) -> Candidate:
        """Fit the first alternatives of one cause alone."""
        first = self.fitted[self.label(name)] = fit(self.data, cause, refine=False)
        return self._candidate(name, first)

    def _candidate(self, name: str, whole: Fit[Cause]) -> Candidate:
        """Return one cause alone, fitted."""
        cause = whole.hypotheses
        best = SelectedCause(cause, whole.best, whole.theta[whole.best])
        effective = not cause.drifting or bool(whole.chi_square.min() < self._drift - _MIN_GAIN)
        if self._new_for_certain and prediction(self.data, (best,)).new_frequency.size:
            effective = True  # its mode is measured: that is more than any drift does
        effective |= shown_by_signals(whole)
        evidence = whole.log_evidence + self.log_prior(name)
        if np.isnan(evidence):
            raise FloatingPointError("the log evidence is not a number")
        return Candidate((best,), (whole,), evidence, whole.p_value, float(whole.chi_square.min()), effective)
