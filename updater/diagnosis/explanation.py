"""Diagnosis of a change, or of an error of the model: every cause of the catalogue is fitted and compared.

Laplace evidence with proper priors decides: a cause with many possible places must explain correspondingly more; no
change is one of the hypotheses. A cause is named at a posterior of 0.8. If the best explanation does not fit (p under
1e-3, of several causes together 0.03; of the frequencies alone a hundredth of that), the diagnosis is unexplained.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from daq import IndexArray
from updater.causes import CATALOGUE, AddedMass, CommonFactor, LocalStiffness, SelectedCause, Springs, effect_of
from updater.diagnosis.case import Case, DiagnosisResult, RecalibratedModel
from updater.diagnosis.combinations import Compositions, common
from updater.diagnosis.gain import (
    Gained,
    WindowModes,
    calibrated_model,
    compared_rows,
    differs_from_predicted,
    fit_of_written,
    read_back,
    written_gain,
)
from updater.diagnosis.model_extension import (
    agreeing,
    as_reported,
    drift_beside,
    extended_structure,
    with_further_modes,
)
from updater.diagnosis.naming import (
    MIN_P,
    as_written,
    calibration_summary,
    each_once,
    mass_tests_of,
    misfit,
    modes_of,
    named_causes,
    rejected_causes,
    shares,
    with_other_connections,
    with_place_names,
)
from updater.diagnosis.next_measurement import next_measurement, smallest_changes
from updater.diagnosis.relaxation import (
    relaxed_alone,
    relaxed_beside,
    relaxed_with_body,
    unrelaxed_beside,
    with_relaxed_form,
)
from updater.diagnosis.revised_reference import (
    is_lacked,
    removed_bodies,
    with_removed_bodies,
    with_unchanged_springs,
)
from updater.diagnosis.schema import Cause, Diagnosis, Failed, NextMeasurement, Separation, SmallestChange, Verdict
from updater.diagnosis.search import (
    beside_the_file,
    closer,
    evenly_refined,
    exchanged,
    fits,
    judged,
    nothing_changed,
    stepwise,
    with_learned_error,
    with_open_places,
    with_two_bodies,
    with_unlisted_bodies,
    within_noise,
)
from updater.diagnosis.simplification import is_significant, merged, only_needed, significant_only
from updater.diagnosis.weighing import (
    DOUBTFUL,
    SURE,
    Candidate,
    EvidenceComparison,
    Faults,
    OnCause,
    allowed_causes,
    ranked,
    say_nothing,
)
from updater.errors import SelectionError
from updater.fe import Model
from updater.inference import MODEL_ERROR, Comparison, compare, errors_of_unmeasured, mixing_of
from updater.modal_data import NOTHING_KNOWN, Circumstances, KnownMass, Mixing, ModalMean, OpeningEvidence
from updater.reference import Calibration, ModelFit, Reference
from updater.validation import opening_evidence, opens_significantly

_ROUGHER = 2.0  # times the model error that a good model has, to search with
_WORTH = 10.0  # of log evidence: another cause, its place and size; below the best, losses tested with the signals
_PROBABLE = 3.0  # of log evidence: an explanation that is farther below the likeliest has less than 5 %
_FAR = 2.0  # times the mean shift of the compared modes: a larger one of another mode is not expected
_CLOSE = 0.1  # of ln f, between modes that errors of the model turn into each other by more than measured shapes err
_MAX_OPEN = 5  # hypotheses that a next measurement is sought for
_DRIFT = "global_stiffness"  # cause that represents a drift of all frequencies in the extended model
_KNOWN_MASS = "added_mass"  # cause whose positions are those of a known mass


def diagnose(
    reference: Reference,
    event: ModalMean,
    *,
    heldout: ModalMean | None = None,
    every: ModalMean | None = None,
    heldout_every: ModalMean | None = None,
    circumstances: Circumstances = NOTHING_KNOWN,
    on_cause: OnCause = say_nothing,
    only: Collection[str] = (),
    without: Collection[str] = (),
) -> DiagnosisResult:
    """Explain an event against a reference.

    Parameters
    ----------
    reference : of the structure as it was, or of the nominal model
    event : (n_tracks,) mean of the windows to explain
    heldout : (n_tracks,) mean of windows that the fit does not use, to measure the gain on
    every, heldout_every : (n_modes,) all modes of these windows, in any order; if not given those of the tracks
    circumstances : further knowledge of the event
    on_cause : called before each fit with its causes, and how many fits of the same kind are done and planned
    only : names of the causes to which the search is limited; all of the catalogue if empty
    without : names of causes that are left out of it

    Raises
    ------
    ModalDataError
        If fewer than three modes can be compared.
    SelectionError
        If the catalogue has no cause of a name, or none of those that are left applies.
    """
    kept = None if heldout is None else WindowModes.of(heldout, heldout_every)

    def answer(known_masses: tuple[KnownMass, ...]) -> DiagnosisResult:
        known = replace(circumstances, known_masses=known_masses)
        return _Question(reference, WindowModes.of(event, every), kept, known, on_cause, only, without).answer()

    return _with_agreeing_masses(circumstances.known_masses, answer)


def _with_agreeing_masses(
    masses: tuple[KnownMass, ...], answer: Callable[[tuple[KnownMass, ...]], DiagnosisResult]
) -> DiagnosisResult:
    """Return the answer without those records with a known mass that no cause explains together with the others.

    The structure may have changed between the records, or mass or place may be wrong. Such a record is compared with
    the answer, which it does not determine.

    Parameters
    ----------
    masses : records with a known mass
    answer : diagnosis with such records
    """
    found = answer(masses)
    if not masses or found.diagnosis.verdict != "unexplained":
        return found
    alone = answer(tuple(replace(mass, is_evidence=False) for mass in masses))
    if alone.diagnosis.verdict == "unexplained":
        return found
    agree = [test.p_value >= MIN_P for test in alone.diagnosis.mass_tests]
    if not any(agree):
        return alone
    some = answer(tuple(replace(mass, is_evidence=own) for mass, own in zip(masses, agree, strict=True)))
    return alone if some.diagnosis.verdict == "unexplained" else some


@dataclass(frozen=True, eq=False)
class _Question:
    """An event to be explained, and the causes that may explain it."""

    reference: Reference
    measured: WindowModes  #: of the event
    heldout: WindowModes | None  #: modes of windows that the fit does not use
    circumstances: Circumstances
    on_cause: OnCause
    only: Collection[str]
    without: Collection[str]
    bare: Calibration | None = None  #: of the structure file, where the reference's model has bodies that it lacks

    def answer(self) -> DiagnosisResult:
        """Explain the event: by single causes, joint causes, a revised reference, and then by the fewest causes."""
        plain, assumed = self._compared()
        search, singles = relaxed_alone(plain, self._singles(plain))
        if opening := _opening(plain, self.measured.event, self.circumstances, singles):
            return replace(self, circumstances=replace(self.circumstances, opening=opening)).answer()
        case = Case(
            search.reference, self.measured.event, search.data, singles, search, self.measured, self.heldout, self.bare
        )
        good = self._compared_with(self.reference, MODEL_ERROR / self.reference.model_error_factor)
        unchanged = self.reference.nominal is None and (self.reference.of_file or within_noise(good, ()))
        if refused := self._refused_alone(case, unchanged=unchanged):
            return refused
        mixing = plain.faults.attempt(
            "modes that were not measured", partial(_mixing, case.reference, plain.data, singles[0])
        )
        if mixing is not None and singles[0].p_value < DOUBTFUL:
            return self._again(mixing)
        case, found = _jointly(plain, case)
        best = max((*singles, *found), key=lambda c: c.log_evidence)
        if found and fits(found[0]):
            if assumed is not None:
                case = self._with_learned_error(case, found[0], assumed)
            case, found = judged(case, found, self._compared_with(case.reference))
            found = evenly_refined(case.weighing, exchanged(case.weighing, found))
            if mixing is not None and _several_are_probable(found):
                return self._again(mixing)
            if revised := self._revised(case, found[0], good):
                return revised
            found, needed = _with_fewest(case, found, good)
            if not needed and unchanged and case.weighing.nothing.p_value >= MIN_P:
                return _refused("nothing_to_explain", case, best.log_evidence, "no_change")
        if not found or not fits(found[0]) or not within_noise(good, found[0].chosen):
            return _unexplained(case, found[0] if found else best, best.log_evidence)
        if _strewn(found[0]):
            return _refused("unexplained", case, best.log_evidence, "scattered_mass")
        if _worn(found[0]):
            return _refused("unexplained", case, best.log_evidence, "widespread_stiffness")
        return _with_displaced_modes(case, found, good, best.log_evidence)

    def _again(self, mixing: Mixing) -> DiagnosisResult:
        """Return the answer with the errors of modes that were not measured."""
        return replace(self, circumstances=replace(self.circumstances, mixing=mixing)).answer()

    def _compared(self) -> tuple[EvidenceComparison, float | None]:
        """Return the causes to compare.

        A structure file has the error of modes with which its own parameters agree with the measured ones. If that is
        no larger than assumed, their log evidence is returned too.
        """
        plain = self._searched(self.reference, allowed_causes(self.only, self.without))
        of_the_file = _of_the_file_alone(plain) if self.reference.of_file else []
        if not of_the_file:
            if self.reference.nominal is not None and not plain.of_the_file:
                name = next(name for name, entry in CATALOGUE.items() if entry.of_the_file)
                raise SelectionError(
                    f"{name} cannot be left out: the structure file is too far from the measured modes"
                )
            return plain, None
        learned, evidence = with_learned_error(self.reference, self.measured.event, self.circumstances, of_the_file[0])
        plain = replace(self._searched(learned, plain.allowed), faults=plain.faults)
        return plain, evidence if learned is self.reference else None

    def _searched(self, reference: Reference, allowed: Collection[str]) -> EvidenceComparison:
        """Return the causes compared with twice the error of a good model, unless the reference's is larger."""
        less = max(_ROUGHER / reference.model_error_factor, 1.0) * MODEL_ERROR
        return EvidenceComparison(reference, self._compared_with(reference, less), self.on_cause, allowed=allowed)

    def _compared_with(self, reference: Reference, model_error: float = MODEL_ERROR) -> Comparison:
        return compare(reference, self.measured.event, circumstances=self.circumstances, model_error=model_error)

    def _singles(self, plain: EvidenceComparison) -> list[Candidate]:
        """Return every cause fitted alone."""
        if not plain.causes:
            raise SelectionError(
                f"none of the chosen causes applies to this structure and these modes: {', '.join(plain.allowed)}"
            )
        singles = plain.singles(() if self.reference.nominal is None else plain.of_the_file)
        if not singles:
            raise RuntimeError(f"every cause has failed: {plain.faults.found}")
        return singles

    def _refused_alone(self, case: Case, *, unchanged: bool) -> DiagnosisResult | None:
        """Return an answer that needs no joint causes; None if there is a change to explain.

        Parameters
        ----------
        unchanged : whether the modes agree with the reference within their noise
        """
        best, of_file = case.singles[0].log_evidence, self.reference.of_file
        if not self.circumstances.steady:
            return _refused("unexplained", case, best, "unsteady")
        if unchanged and nothing_changed(case.weighing, case.singles):
            return _refused("nothing_to_explain", case, case.weighing.log_nothing, "no_change")
        if self.reference.nominal is None and not (of_file or self.reference.fits_baseline):
            return _refused("unexplained", case, best, "unfit_model")
        return None

    def _with_learned_error(self, case: Case, best: Candidate, assumed: float) -> Case:
        """Return a case with the error of modes of the best causes, if that is much more probable than the assumed."""
        learned, evidence = with_learned_error(self.reference, self.measured.event, self.circumstances, best)
        if evidence <= assumed + _WORTH:
            return case
        return replace(case, reference=learned, weighing=replace(case.weighing, reference=learned))

    def _revised(self, case: Case, best: Candidate, good: Comparison) -> DiagnosisResult | None:
        """Return the answer with another reference: with bodies that were removed, or springs that did not change."""

        def again(bare: Calibration | None, reference: Reference) -> DiagnosisResult:
            known = replace(self.circumstances, mixing=None)  # it is of the modes of this reference
            return replace(self, reference=reference, circumstances=known, bare=bare).answer()

        needed = only_needed(case.weighing, best, partial(_accepted, good))  # a body that is not needed shows no error
        revisions = {
            "removed bodies": partial(with_removed_bodies, case, needed, partial(again, self.reference.calibration)),
            "unchanged connections": partial(with_unchanged_springs, case, best, partial(again, None)),
        }
        revised = (case.weighing.faults.attempt(what, revision) for what, revision in revisions.items())
        return next((found for found in revised if found is not None), None)


def _mixing(reference: Reference, data: Comparison, best: Candidate) -> Mixing | None:
    """Return the modes of the reference as the likeliest single cause mixes them.

    None if errors of modes that were not measured are negligible for the compared ones, or already considered.

    Errors of the model turn modes into each other that are close after the change. A mode that was not measured is
    assumed to shift as the others do. If the cause shifts it farther, it may be much closer to one of them. If the
    cause mixes it with a compared mode, the error of its frequency is an error of both.
    """
    if data.circumstances.mixing is not None:
        return None
    mixing = mixing_of(data, effect_of(best.chosen), reference.paired, reference.calibration.unmeasured_std)
    now = np.log(data.frequency[data.paired]) + data.log_ratio
    apart = np.abs((np.log(data.frequency) + mixing.shifts)[:, None] - now).min(1)
    far = np.abs(mixing.shifts) > _FAR * np.abs(data.log_ratio).mean()
    far[data.paired] = False
    close = far & (apart < _CLOSE)
    mixing = replace(mixing, shifts=np.where(close, mixing.shifts, np.nan))
    return mixing if close.any() or _exceeds_assumed(reference, data, mixing) else None


def _several_are_probable(found: Sequence[Candidate]) -> bool:
    """Return whether an explanation of several causes is not much less probable than the likeliest one."""
    return any(len(c.chosen) > 1 for c in found if c.log_evidence > found[0].log_evidence - _PROBABLE)


def _exceeds_assumed(reference: Reference, data: Comparison, mixing: Mixing) -> bool:
    """Return whether errors by modes that were not measured exceed all those assumed, of a frequency or of a shape."""
    errors = errors_of_unmeasured(reference, data.tracks, data.channels, mixing, data.base)
    of_frequency = (errors.log_frequency**2).sum(1) / np.diag(data.frequency_covariance)
    of_shape = np.concatenate([errors.shape.transpose(0, 2, 1), errors.sensors], axis=2)
    chi_square = ((data.shape_whitener @ of_shape) ** 2).sum((1, 2))
    assumed = (len(data.channels) - 1) / data.overdispersion  # expected chi-square of a shape
    return bool((np.maximum(of_frequency, chi_square / assumed) > 1).any())


def _jointly(plain: EvidenceComparison, case: Case) -> tuple[Case, list[Candidate]]:
    """Return the joint causes that are more probable than their parts, and the case as they were weighed."""
    alone = [c for c in case.singles if c.effective]
    search, found = stepwise(case.weighing, ranked([*alone, *beside_the_file(case.weighing, alone)]), rough=True)
    search, found = relaxed_beside(search, found) if not search.instead else unrelaxed_beside(plain, search, found)
    search, found = relaxed_with_body(search, found)
    search, found = with_two_bodies(plain, search, case.singles, found)
    return replace(case, weighing=search), found


def _accepted(good: Comparison, candidate: Candidate) -> bool:
    """Return whether a candidate fits, also with the error of a good model."""
    return fits(candidate) and within_noise(good, candidate.chosen)


def _with_fewest(case: Case, found: list[Candidate], good: Comparison) -> tuple[list[Candidate], bool]:
    """Return the candidates without causes that are not needed, and whether they are more probable than no change."""
    found = found if within_noise(good, found[0].chosen) else closer(case, found, good)
    leading = only_needed(case.weighing, merged(case.weighing, found[0]), partial(_accepted, good))
    fewer = len(leading.chosen) < len(found[0].chosen)
    rest = [c for c in found[1:] if not (fewer and sorted(c.names) == sorted(leading.names))]
    found = significant_only(case.weighing, [leading, *rest])
    less = max((c.log_evidence for c in found), default=float("-inf"))
    return found, less >= min(leading.log_evidence, case.weighing.log_nothing)


def _unexplained(case: Case, odd: Candidate, best: float) -> DiagnosisResult:
    """Return an answer that names no cause because the best one does not fit."""
    faults = case.weighing.faults
    nearer = case.reference.nominal and faults.attempt("the file nearer to the logs", lambda: _nearer(case))
    refused = _refused("unexplained", case, best, misfit(case.reference, case.data, odd.chosen), odd.chosen)
    return replace(refused, nearer=nearer or None)


def _opening(
    weighing: EvidenceComparison, event: ModalMean, circumstances: Circumstances, singles: Sequence[Candidate]
) -> Mapping[str, OpeningEvidence]:
    """Return the evidence of the signals for probable losses of stiffness that open and close; empty if none does.

    Empty, too, if it is part of the circumstances.
    """
    if circumstances.opening or circumstances.signals is None or weighing.reference.nominal is not None:
        return {}
    signals = circumstances.signals

    def evidence() -> Mapping[str, OpeningEvidence]:
        every = [with_relaxed_form(weighing, c) for c in singles]  # a crack is most often in one plane
        most = max(weighing.log_nothing, *(c.log_evidence for c in every))
        if not opens_significantly(event, [c.parts[0] for c in every if c.log_evidence > most - _WORTH], signals):
            return {}
        return opening_evidence(event, [c.parts[0] for c in every], signals)  # places of all losses are compared

    return weighing.faults.attempt("the evidence of the signals", evidence) or {}


def _of_the_file_alone(weighing: EvidenceComparison) -> list[Candidate]:
    """Return the errors of the structure file, fitted alone."""
    names = [name for name in weighing.allowed if CATALOGUE[name].of_the_file]
    return replace(weighing, allowed=names).singles()


def _strewn(best: Candidate) -> bool:
    """Return whether a rare cause occurs with another one of its common form: mass at many places."""
    rare = {CATALOGUE[name].common_form for name in best.names} - {""}
    return any(common(best.names).count(name) > 1 for name in rare)


def _worn(best: Candidate) -> bool:
    """Return whether stiffness has changed along most of several members: of two, or of one and of all together.

    A factor on all frequencies that only the modes show may be one on all stiffness, whatever it is named. With two
    changes of stiffness at single places in addition, it is one way of many to describe sections that are thinner
    throughout.
    """
    changes = [p.hypotheses for p in best.parts]
    along = sum(isinstance(p.hypotheses, LocalStiffness) and p.hypotheses.along_most(p) for p in best.parts)
    of_all = any(isinstance(cause, CommonFactor) and not cause.informed for cause in changes)
    at_places = sum(isinstance(cause, LocalStiffness | Springs) for cause in changes)
    return along + of_all > 1 or (of_all and at_places > 1)


def _refused(
    verdict: Verdict, case: Case, best: float, advice: NextMeasurement, odd: Sequence[SelectedCause] = ()
) -> DiagnosisResult:
    """Return an answer that names no cause.

    Parameters
    ----------
    best : log evidence of the best causes
    odd : the best causes, where they do not fit
    """
    unchanged = verdict == "nothing_to_explain"
    diagnosis = Diagnosis(
        verdict=verdict,
        causes=(),
        modes=modes_of(case.reference, case.event, case.data),
        gain=None,
        calibration=calibration_summary(case.reference),
        failed=_failed(case),
        smallest_changes=_smallest(case, ()) if unchanged else (),
        mass_tests=mass_tests_of(case.data, odd) if odd or unchanged else (),
    )
    rejected = rejected_causes(case.singles, (), best, unchanged=unchanged)
    return DiagnosisResult(diagnosis, None, rejected, advice)


def _failed(case: Case) -> tuple[Failed, ...]:
    """Return the parts left out because of internal faults."""
    return tuple(Failed(part=name, error=text) for name, text in case.weighing.faults.found.items())


def _nearer(case: Case) -> RecalibratedModel:
    """Return an inconsistent file with its best-fitting parameters alone."""
    (chosen,) = case.singles[0].chosen
    written = chosen.cause.extend(case.reference.file.structure, chosen.row, chosen.theta)
    return RecalibratedModel(written, _gained(case, [chosen], read_back(written)))


def _gained(case: Case, chosen: Sequence[SelectedCause], written: Model, known: ModelFit | None = None) -> Gained:
    before = calibrated_model(case.bare or case.reference.file.calibration)
    return written_gain(case.reference, case.data, case.measured, case.heldout, chosen, (before, written), known)


def _with_displaced_modes(case: Case, found: list[Candidate], good: Comparison, searched: float) -> DiagnosisResult:
    """Name the causes, fitted also to modes that only they identify; without these where they then do not fit.

    The others are fitted without these modes: the log evidence of the best remains what it was.

    Parameters
    ----------
    good : the event, compared with the error of a good model
    searched : as of `_explained`
    """

    def refitted() -> tuple[Comparison, Candidate]:
        more = _with_further_modes(case, case.data, best.chosen, displaced=lost)
        if more is case.data:
            return more, best
        faults = Faults()  # a cause that fails here has not failed before
        again = Compositions(replace(case.weighing, data=more, faults=faults)).coordinate_fit(best.chosen)
        if again is None:
            raise RuntimeError("; ".join(faults.found.values()))
        return (more, replace(again, log_evidence=best.log_evidence)) if _accepted(good, again) else (case.data, best)

    best, lost = found[0], np.setdiff1d(case.reference.paired, case.data.paired)
    data = case.data
    if data.nominal is None:  # else the model was recalibrated to these very modes
        data, best = case.weighing.faults.attempt("modes that moved far", refitted) or (data, best)
    if data is not case.data:
        answer = _explained(case, [best, *found[1:]], data, good, searched)
        if answer.diagnosis.verdict != "unexplained":
            return answer
    return _explained(case, found, case.data, good, searched)


def _significant(
    weighing: EvidenceComparison, found: list[Candidate], best: Candidate, is_accepted: Callable[[Candidate], bool]
) -> list[Candidate]:
    """Return explanations nearly as probable as the best one, of which not all causes are significant, that fit.

    Parameters
    ----------
    found : explanations as the search gives them
    best : one of them, with open places
    is_accepted : whether a fit is good enough to be named
    """
    rest = tuple(c for c, part in zip(best.chosen, best.parts, strict=True) if is_significant(part))
    fewer = Compositions(weighing).coordinate_fit(rest) if rest else None
    others = [c for c in found if sorted(c.names) != sorted(best.names)]
    near = [c for c in (fewer, *others) if c is not None and c.log_evidence > best.log_evidence - _WORTH]
    return ranked([c for c in near if all(map(is_significant, c.parts)) and is_accepted(c)])


def _explained(
    case: Case, found: list[Candidate], data: Comparison, good: Comparison, searched: float
) -> DiagnosisResult:
    """Name the causes that hold 0.8 of the posterior, those that the data cannot separate as one.

    A cause that is significant at the best place of another one may not be with that place open.

    Parameters
    ----------
    data : that the best is fitted to: of `case`, or with further modes
    good : the event, compared with the error of a good model
    searched : log evidence of the best, as `case.singles` have theirs
    """
    wider = replace(case, data=data, weighing=replace(case.weighing, data=data))
    opened = with_open_places(wider, found)
    best = opened[0]
    if not all(map(is_significant, best.parts)):
        if fewer := _significant(case.weighing, found, best, partial(_accepted, good)):
            return _explained(case, fewer, case.data, good, searched)
        return _refused("unexplained", case, searched, "insignificant", best.chosen)
    found = with_unlisted_bodies(wider, opened)
    best = found[0]
    named, sure, left_open = named_causes(case.data, found, SURE, case.weighing.log_nothing)
    chosen, data = _with_all_modes(case, data, agreeing(data, best.chosen))
    chosen = as_reported(data, chosen, best)
    chosen = (*chosen, *drift_beside(data, chosen, case.weighing.cause(_DRIFT)))
    calibration = case.reference.file.calibration
    taken = [] if case.bare is None else removed_bodies(chosen)
    removed = [(one, body) for one, body in taken if case.bare and is_lacked(case.bare, calibration, body)]
    if case.bare is not None:  # written without the bodies that the file lacks, once they are taken off
        structure = calibration.structure.model_copy(update={"body": case.bare.structure.body})
        calibration = replace(calibration, structure=structure, nominal=case.bare.nominal)
    others = [c for c in chosen if not any(c is one for one, _ in removed)]
    extended = extended_structure(calibration, others, best.parts)
    if any(CATALOGUE[name].of_the_file for name in best.names):
        named = each_once(tuple(as_written(cause, extended, calibration.nominal) for cause in named))
    named = tuple(with_place_names(cause, case.reference.structure) for cause in named)
    named = tuple(_with_others(case, cause, left_open) for cause in named)
    accepted = {name for cause in named for name in (cause.cause, *cause.cannot_be_told_from)}
    faults = case.weighing.faults
    written: ModelFit | None = None
    gained: Gained | None = None
    model = faults.attempt("the written model", partial(read_back, extended))
    if model is not None:
        fitted = partial(fit_of_written, case.reference, case.data, case.measured, model, chosen)
        written = faults.attempt("the modes of the written model", fitted)
    compared = None if written is None else written.only(compared_rows(case.data, case.measured))
    if compared is not None and differs_from_predicted(case.reference, case.data, compared, chosen):
        return _refused("unexplained", case, searched, "other_model")
    if model is not None:
        gained = faults.attempt("the gain", partial(_gained, case, chosen, model, written))
    if gained and gained.is_worse:
        return _refused("unexplained", case, searched, "worse_model")
    decisive = None if sure else faults.attempt("the next measurement", lambda: _next(case, left_open))
    diagnosis = Diagnosis(
        verdict="explained" if sure else "ambiguous",
        causes=named,
        modes=modes_of(
            case.reference,
            case.event,
            case.data,
            compared,
        ),
        gain=gained.gain if gained and gained.significant else None,
        calibration=calibration_summary(case.reference),
        failed=_failed(case),
        smallest_changes=_smallest(case, best.chosen),
        mass_tests=mass_tests_of(case.data, best.chosen),
    )
    return DiagnosisResult(
        diagnosis,
        extended,
        rejected_causes(case.singles, accepted, searched, found),
        decisive or tuple(dict.fromkeys(c.cause.advice for c in best.chosen)),
        gained,
        best.parts,
        calibration=calibration if case.bare else None,
        removed=tuple(body for _, body in removed),
    )


def _with_others(case: Case, cause: Cause, left_open: Sequence[Candidate]) -> Cause:
    """Return a cause with the changes of connections like its own since the reference; a file has no such state."""
    if case.reference.of_file:
        return cause
    structure = case.reference.structure
    found = case.weighing.faults.attempt(
        "the other connections", lambda: with_other_connections(cause, case.data, left_open, structure)
    )
    return found or cause


def _smallest(case: Case, chosen: Sequence[SelectedCause]) -> tuple[SmallestChange, ...]:
    """Return the smallest changes that would have been seen, if only errors of a whole structure file are accepted."""
    if not case.reference.of_file or not all(c.cause.place_free for c in chosen):
        return ()
    plain = replace(case.weighing, instead={})
    if not chosen:  # the parameters of the file remain uncertain, although none differs from it
        chosen = [
            SelectedCause(cause, 0, cause.start[0]) for name, cause in plain.causes.items() if name in plain.of_the_file
        ]
    found = plain.faults.attempt(
        "the smallest changes", lambda: smallest_changes(plain.data, plain.causes, tuple(chosen))
    )
    return found or ()


def _with_all_modes(
    case: Case, data: Comparison, chosen: tuple[SelectedCause, ...]
) -> tuple[tuple[SelectedCause, ...], Comparison]:
    """Return causes as they agree with all modes that were measured, those included that the baseline lacks."""

    def refitted() -> tuple[tuple[SelectedCause, ...], Comparison]:
        more = _with_further_modes(case, data, chosen)
        return (chosen if more is data else agreeing(more, chosen)), more

    if case.data.nominal is not None:  # the model was recalibrated to these very modes
        return chosen, data
    return case.weighing.faults.attempt("modes that the reference lacks", refitted) or (chosen, data)


def _with_further_modes(
    case: Case, data: Comparison, chosen: tuple[SelectedCause, ...], *, displaced: IndexArray | None = None
) -> Comparison:
    """Return data with further measured modes, as `with_further_modes`."""
    reference, every = case.reference, case.measured.every
    model_std, error = reference.calibration.frequency_error.std, MODEL_ERROR * reference.model_error_factor
    return with_further_modes(data, model_std, error, case.event, every, chosen, displaced=displaced)


def _next(case: Case, left_open: list[Candidate]) -> Separation | None:
    """Return the measurements that would decide between the remaining hypotheses; None if there is only one."""
    if len(left_open) < 2:
        return None
    considered = left_open[:_MAX_OPEN]
    bodies = case.weighing.cause(_KNOWN_MASS)
    return next_measurement(
        case.reference,
        case.event,
        case.data,
        bodies if isinstance(bodies, AddedMass) else None,
        [c.chosen for c in considered],
        shares(considered),
    )
