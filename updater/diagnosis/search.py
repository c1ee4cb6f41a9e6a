"""Diagnosis of a change, or of an error of the model: every cause of the catalogue is fitted and compared.

Laplace evidence with proper priors decides: a cause with many possible places must explain correspondingly more; no
change is one of the hypotheses. A cause is named at a posterior of 0.8. If a single one fits badly (chi-square p under
0.01), or a further one has a large predicted gain, combinations of up to three are tried, while the evidence grows. If
the best of them does not fit (p under 1e-3, of several together 0.03; of the frequencies alone a hundredth of that),
the diagnosis is unexplained. The search is first made with twice the error of a good model: with a larger tolerance,
first order misses less. The result is then evaluated and continued with the actual error, unless the evidence favours
the larger one. A poor reference permits a larger error: if the explanation then leaves several times the noise of
frequencies, others with smaller residuals are sought.

A body that was taken off, and that the structure file never had, was on while the baseline was measured: the model was
calibrated to modes with it and without its mass. All is then done once more with a model that has the body, until the
mass that is taken off is the mass that it has.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
from scipy.special import logsumexp

from updater.baseline import with_bodies_on
from updater.causes import (
    AddedMass,
    Cause,
    CommonFactor,
    LocalStiffness,
    Parametric,
    SelectedCause,
    hides,
    propose_one_sided_stiffness,
)
from updater.diagnosis.combinations import Compositions, common
from updater.diagnosis.further_modes import with_further_modes
from updater.diagnosis.held_out_gain import Gained
from updater.diagnosis.model_extension import agreeing, drift_beside, fixed
from updater.diagnosis.naming import (
    MIN_P,
    as_written,
    calibration_summary,
    modes_of,
    named_causes,
    oddest,
    rejected_causes,
)
from updater.diagnosis.next_measurement import next_measurement
from updater.diagnosis.schema import Diagnosis, Failed, Verdict
from updater.diagnosis.simplification import merged, significant_only
from updater.diagnosis.weighing import OF_THE_FILE, Candidate, EvidenceComparison, allowed_causes, ranked, say_nothing
from updater.diagnosis.written_gain import WindowModes, fit_of_compared, written_gain
from updater.errors import SelectionError
from updater.inference import MODEL_ERROR, Comparison, Fit, compare, fit, freedom_of_frequencies
from updater.modal_data import NOTHING_KNOWN, Circumstances, ModalMean
from updater.reference import Calibration, Reference
from updater.structure import Body, Structure, rounded, simplified, size

_SURE = 0.8  # posterior at which a cause is named
_DOUBTFUL = 0.01  # p value of a fit under which one more cause is tried
_WELL = 0.5  # p value from which on no other pair is sought, and no stretch about one axis is missed ...
_RIVAL = 60.0  # ... if its log evidence is so far above that of one factor on a stretch
_MIN_P_TOGETHER = 0.03  # of several causes: the best of hundreds of compositions must fit well, not just passably
_SAME = 0.5  # of log evidence: by how much fits that have come to rest at one place may differ
_MUCH = 8.0  # predicted log evidence above which another cause is tried despite a good fit
_ROUGHER = 2.0  # times the model error that a good model has, to search with
_LOG_ODDS_ROUGH = -3.0  # that a good model is wrong by that much
_WORTH_JUDGING, _MAX_JUDGED = 15.0, 6  # of log evidence under the best of the search; how many
_MAX_LEFT = 3.0  # times the residual of noise and a good model in frequencies: an explanation with more is refused
_SEEDS = 3  # best candidates to which another cause is added
_MAX = 3  # causes at once
_MAX_ROUNDS, _MASS_CONVERGED = 12, 0.01  # until the mass of a removed body changes by no more than this share ...
_PLACE_CONVERGED = 2e-3  # ... and its place by no more than this share of the structure's size
_MAX_OPEN = 5  # hypotheses that a next measurement is sought for
_STRETCH = "local_stiffness"
_MASSES = ("distributed_mass", "added_mass")
_STREWN = (
    "Mass changed at several places that these modes cannot resolve. Inspect the structure, or measure with more "
    "sensors and up to higher modes."
)
_WORN = (
    "Stiffness has changed along most of several members: corrosion, another material or other sections, of which a "
    "loss of stiffness alone is a part. Measure the members' sections, and correct the structure file."
)
_NOTHING = "None: the data agree with the reference."
_UNSTEADY = "The frequencies drift between windows. Record again while the structure is stationary."


@dataclass(frozen=True, eq=False)
class RecalibratedModel:
    """An inconsistent structure file with fitted parameters, which does not explain all measurements."""

    structure: Structure
    gained: Gained


@dataclass(frozen=True, eq=False)
class DiagnosisResult:
    """A diagnosis, with the model that it extends."""

    diagnosis: Diagnosis
    extended: Structure | None  #: structure with the causes; None if nothing is explained
    gained: Gained | None = None  #: gain of it, with its deviation
    parts: tuple[Fit[Cause], ...] = ()  #: the fit of each cause of the best explanation
    nearer: RecalibratedModel | None = None  #: recalibrated model of a file that is far off, if nothing is explained
    calibration: Calibration | None = None  #: calibration of `extended`, if not the reference's: with removed bodies on
    removed: tuple[Body, ...] = ()  #: bodies taken off that the structure file lacks, as they were on it


@dataclass(frozen=True, eq=False)
class _Case:
    """Data to be explained, and every cause fitted alone."""

    reference: Reference
    event: ModalMean
    data: Comparison
    singles: list[Candidate]  #: single causes as searched for
    weighing: EvidenceComparison
    measured: WindowModes
    heldout: WindowModes | None
    #: calibration of the structure file, if the reference's model has bodies that it lacks
    bare: Calibration | None = None


def diagnose(
    reference: Reference,
    event: ModalMean,
    *,
    heldout: ModalMean | None = None,
    every: ModalMean | None = None,
    heldout_every: ModalMean | None = None,
    circumstances: Circumstances = NOTHING_KNOWN,
    on_cause: Callable[[str], None] = say_nothing,
    only: Collection[str] = (),
    without: Collection[str] = (),
) -> DiagnosisResult:
    """Explain an event against a reference.

    Parameters
    ----------
    reference : of the structure as it was, or of the nominal model
    event : (n_tracks,) mean of the windows to explain
    heldout : (n_tracks,) mean of windows that the fit must not see, to measure the gain on
    every, heldout_every : (n_modes,) all modes of these windows, in any order; if not given those of the tracks
    circumstances : further knowledge of the event
    on_cause : called with the name of each cause before it is weighed
    only : names of the causes to which the search is limited; all of the catalogue if empty
    without : names of causes that are left out of it

    Raises
    ------
    ModalDataError
        If fewer than three modes can be compared.
    SelectionError
        If the catalogue has no cause of a name, or none of those that are left applies.
    """
    unused = None if heldout is None else WindowModes.of(heldout, heldout_every)
    return _diagnosed(
        reference,
        WindowModes.of(event, every),
        unused,
        None,
        circumstances=circumstances,
        on_cause=on_cause,
        only=only,
        without=without,
    )


def _diagnosed(
    reference: Reference,
    measured: WindowModes,
    unused: WindowModes | None,
    bare: Calibration | None,
    *,
    circumstances: Circumstances,
    on_cause: Callable[[str], None],
    only: Collection[str],
    without: Collection[str],
) -> DiagnosisResult:
    """Explain an event as `diagnose` does.

    Parameters
    ----------
    measured, unused : the event, and the modes of windows that the fit must not see
    bare : of the structure file, where the reference's model has bodies that it lacks
    """
    event = measured.event
    less = max(_ROUGHER / reference.doubt, 1.0) * MODEL_ERROR
    rough = compare(reference, event, circumstances=circumstances, model_error=less)
    plain = EvidenceComparison(reference, rough, on_cause, allowed=allowed_causes(only, without))
    if reference.filed is not None and OF_THE_FILE not in plain.causes:
        raise SelectionError(f"{OF_THE_FILE} cannot be left out: the structure file is too far from the measured modes")
    if not plain.causes:
        raise SelectionError(
            f"none of the chosen causes applies to this structure and these modes: {', '.join(plain.allowed)}"
        )
    singles = plain.singles(() if reference.filed is None else (OF_THE_FILE,))
    if not singles:
        raise RuntimeError(f"every cause has failed: {plain.faults.found}")
    search, singles = _one_sided(plain, singles)
    case = _Case(reference, event, search.data, singles, search, measured, unused, bare)
    if not circumstances.steady:
        return _refused("unexplained", case, singles[0].log_evidence, _UNSTEADY)
    if reference.filed is None and _nothing(search, singles):
        return _refused("nothing_to_explain", case, search.log_nothing, _NOTHING)
    alone = [c for c in singles if c.effective]
    found = _stepwise(search, ranked([*alone, *_beside_the_file(search, alone)]), rough=True)
    search, found = _one_sided_beside(search, found) if search is plain else _one_factor_beside(plain, search, found)
    case = replace(case, weighing=search)
    best = max((*singles, *found), key=lambda c: c.log_evidence)
    good = compare(reference, event, circumstances=circumstances, model_error=MODEL_ERROR / reference.doubt)
    if found and _fits(found[0]):
        case, found = _judged(case, found, compare(reference, event, circumstances=circumstances))

        def again(loaded: Reference) -> DiagnosisResult:
            given: dict[str, Any] = {"circumstances": circumstances, "only": only, "without": without}
            return _diagnosed(loaded, measured, unused, reference.calibration, on_cause=on_cause, **given)

        without_bodies = case.weighing.faults.attempt(
            "removed bodies that the file lacks", partial(_with_removed_bodies, case, found[0], again)
        )
        if without_bodies is not None:
            return without_bodies
        found = found if _within_noise(good, found[0]) else _closer(case, found, good)
        found = significant_only(case.weighing, [merged(case.weighing, found[0]), *found[1:]])
        if not found and reference.filed is None and case.weighing.nothing.p_value >= MIN_P:
            return _refused("nothing_to_explain", case, best.log_evidence, _NOTHING)
    if not found or not _fits(found[0]) or not _within_noise(good, found[0]):
        odd = found[0] if found else best
        nearer = reference.filed and case.weighing.faults.attempt("the file nearer to the logs", lambda: _nearer(case))
        refused = _refused("unexplained", case, best.log_evidence, oddest(case.data, odd.chosen))
        return replace(refused, nearer=nearer or None)
    if "distributed_mass" in found[0].names and sum(name in _MASSES for name in found[0].names) > 1:
        return _refused("unexplained", case, best.log_evidence, _STREWN)
    if _worn(found[0]):
        return _refused("unexplained", case, best.log_evidence, _WORN)
    return _explained(case, found, best.log_evidence)


def _worn(best: Candidate) -> bool:
    """Return whether stiffness has changed along most of several members: of two, or of one and of all together.

    A factor on all frequencies that only the modes show may be one on all stiffness, whatever it is named.
    """
    along = sum(isinstance(p.hypotheses, LocalStiffness) and p.hypotheses.along_most(p) for p in best.parts)
    of_all = any(isinstance(p.hypotheses, CommonFactor) and not p.hypotheses.informed for p in best.parts)
    return along + of_all > 1


def _one_sided(search: EvidenceComparison, singles: list[Candidate]) -> tuple[EvidenceComparison, list[Candidate]]:
    """Let a stretch's stiffness about either axis and in twist go apart where that may be likelier, and is."""
    common = next((c for c in singles if c.names == (_STRETCH,)), None)
    if common is None or search.nothing.p_value >= _WELL:
        return search, singles
    if singles[0].p_value >= _WELL and common.log_evidence < singles[0].log_evidence - _RIVAL:
        return search, singles
    apart = _let_apart(search)
    found = next(iter(apart.singles((_STRETCH,))), None)
    if found is None or found.log_evidence < common.log_evidence + _MUCH:
        return search, singles
    return apart, ranked([found, *(c for c in singles if c is not common)])


def _one_sided_beside(search: EvidenceComparison, found: list[Candidate]) -> tuple[EvidenceComparison, list[Candidate]]:
    """Allow a factor per axis in the best combination with a stretch, or with another, if more probable."""
    if not found or search.instead:
        return search, found
    apart = _let_apart(search)
    several = Compositions(apart)
    fitted = [several.coordinate_fit(chosen) for chosen in _with_stretch(apart, found)]
    other = max((c for c in fitted if c is not None), key=lambda c: c.log_evidence, default=None)
    if other is None:
        return search, found
    stretched = [c for c in found if sorted(c.names) == sorted(other.names)]
    if other.log_evidence < max(c.log_evidence for c in stretched or found) + _MUCH:
        return search, found
    return apart, ranked([other, *(c for c in found if c not in stretched[:1])])


def _with_stretch(apart: EvidenceComparison, found: list[Candidate]) -> list[tuple[SelectedCause, ...]]:
    """Return combinations with a stretch with separate axes; the last cause is fitted first.

    If one cause alone does not fit, nor several, and none of these is a stretch, one is tried together with the best.
    """
    common = next((c for c in found if len(c.chosen) > 1 and c.names.count(_STRETCH) == 1), None)
    tried = []
    if common is not None and common.log_evidence >= found[0].log_evidence - _RIVAL:
        tried.append(tuple(sorted(common.chosen, key=lambda c: c.cause.name == _STRETCH)))
    alone = next((c for c in found if len(c.chosen) == 1 and not _hidden(c)), None)
    stretch = apart.causes.get(_STRETCH)
    if alone is None or stretch is None or alone.names == (_STRETCH,):
        return tried
    if alone.p_value < _DOUBTFUL and found[0].p_value < _WELL and _STRETCH not in found[0].names:
        tried.append((*alone.chosen, SelectedCause(stretch, 0, np.zeros(len(stretch.prior_std)))))
    return tried


def _one_factor_beside(
    plain: EvidenceComparison, search: EvidenceComparison, found: list[Candidate]
) -> tuple[EvidenceComparison, list[Candidate]]:
    """Return to one factor if another cause explains the part that the separate axes had to explain."""
    apart = found[0] if found else None
    if apart is None or len(apart.chosen) == 1 or apart.names.count(_STRETCH) != 1:
        return search, found
    beside = sorted(apart.chosen, key=lambda c: c.cause.name == _STRETCH)
    other = Compositions(plain).coordinate_fit(tuple(beside))
    if other is None or apart.log_evidence >= other.log_evidence + _MUCH:
        return search, found
    return plain, ranked([other, *(c for c in found if c is not apart)])


def _let_apart(search: EvidenceComparison) -> EvidenceComparison:
    return replace(search, instead={_STRETCH: propose_one_sided_stiffness})


def _nothing(weighing: EvidenceComparison, singles: list[Candidate]) -> bool:
    """Return whether nothing has changed: no change fits, and no cause is much more probable."""
    everything = [weighing.log_nothing, *(c.log_evidence for c in singles if c.effective)]
    share = weighing.log_nothing - float(logsumexp(np.array(everything)))
    return share >= np.log(1 - _SURE) and weighing.nothing.p_value >= MIN_P


def _beside_the_file(weighing: EvidenceComparison, singles: list[Candidate]) -> list[Candidate]:
    """Return causes in addition to a file with small errors in many places, however well one cause fits.

    Causes of the file come first: otherwise changes would be mistaken for similar causes.
    """
    several = Compositions(weighing)
    promises = several.rank_by_linear_prediction([c for c in singles if c.names == (OF_THE_FILE,)])
    return [c for c in several.together(promises) if c.earned(singles)] if promises else []


def _of_the_file(weighing: EvidenceComparison) -> bool:
    """Return whether the question is about the errors of a structure file: in many places, each a little."""
    return OF_THE_FILE in weighing.causes


def _fits(best: Candidate) -> bool:
    return best.p_value >= (MIN_P if len(best.chosen) == 1 else _MIN_P_TOGETHER)


def _within_noise(good: Comparison, best: Candidate) -> bool:
    """Return whether the frequencies are left no farther off than several times noise and the error of a good model.

    A poor reference permits larger residuals of a fit. They may be the reference's error, or another cause.

    Parameters
    ----------
    good : the event, compared with the error of a good model
    """
    found = fit(good, fixed(good, best.chosen))
    off = found.off_frequencies[0]
    return bool(off @ off <= _MAX_LEFT**2 * max(freedom_of_frequencies(good, found), 1.0))


def _closer(case: _Case, found: list[Candidate], good: Comparison) -> list[Candidate]:
    """Return explanations that leave no more than noise, several causes included; those given if there are none.

    They are sought with the error of a good model, and compared and fitted with the actual one.

    Parameters
    ----------
    good : the event, compared with the error of a good model
    """
    weighing = replace(case.weighing, data=good)
    sought = _stepwise(weighing, _again(weighing, found), rough=False)
    closer = [c for c in sought if _within_noise(good, c)][:_MAX_JUDGED]
    again = [Compositions(case.weighing).coordinate_fit(c.chosen) for c in closer]
    return ranked([fitted for fitted in again if fitted is not None]) or found


def _judged(case: _Case, found: list[Candidate], data: Comparison) -> tuple[_Case, list[Candidate]]:
    """Evaluate the result of a search again, and continue it, with the actual model error.

    The original result is kept if the evidence favours the larger model error of the search.

    Parameters
    ----------
    data : with that error
    """
    weighing = replace(case.weighing, data=data)
    again = _again(weighing, found)
    if not again:
        return case, found
    weighing, judged = _one_sided_beside(weighing, _stepwise(weighing, again, rough=False))
    evidence, searched = (
        judged[0].log_evidence + data.log_det_of_shapes,
        found[0].log_evidence + case.data.log_det_of_shapes,
    )
    if evidence < searched + _LOG_ODDS_ROUGH:
        return case, found
    return replace(case, data=data, weighing=weighing), judged


def _again(weighing: EvidenceComparison, found: list[Candidate]) -> list[Candidate]:
    """Return the best of a search, fitted to other data.

    Two bodies are also fitted where mass is distributed, and next to a stretch that may be two other causes, as well as
    other starting causes.
    """
    several = Compositions(weighing)
    near = [c for c in found if c.log_evidence > found[0].log_evidence - _WORTH_JUDGING][:_MAX_JUDGED]
    if _hidden(near[0]):
        near += [c for c in found if not _hidden(c) and c not in near][: _SEEDS - 1]
    again = ranked([fitted for fitted in (several.coordinate_fit(c.chosen) for c in near) if fitted is not None])
    free = bool(again) and _free(weighing, again[0])
    if free:
        others = [c for c in found if _STRETCH not in c.names and not _hidden(c) and c not in near][: _SEEDS - 1]
        again += [fitted for fitted in (several.coordinate_fit(c.chosen) for c in others) if fitted is not None]
    if free or any(c.names == ("distributed_mass",) for c in again):
        again += several.at_once(("added_mass",))
    return ranked(again)


def _stepwise(weighing: EvidenceComparison, found: list[Candidate], *, rough: bool) -> list[Candidate]:
    """Return single causes and, if a further one promises a large gain, combinations while the evidence grows.

    Parameters
    ----------
    rough : whether it is sufficient that the result is no misfit, whatever a further cause would gain
    """
    several = Compositions(weighing)
    for number in range(1, _MAX):
        as_many = [c for c in found if len(c.chosen) == number]
        seeds = as_many[:_SEEDS]
        seeds += [c for c in as_many[_SEEDS:] if sorted(c.names) == common(seeds[0].names)]
        doubted = found[0].p_value < _DOUBTFUL or _hidden(found[0]) or _free(weighing, found[0])
        if not seeds or len(found[0].chosen) < number or (rough and found[0].p_value >= _DOUBTFUL):
            break
        if len(found[0].chosen) > number and not doubted:
            break
        promises = several.rank_by_linear_prediction(seeds if doubted else seeds[:1])
        if not promises or (not doubted and promises[0].log_evidence < found[0].log_evidence + _MUCH):
            break
        more = several.together(promises)
        if number == 1 and not any(c.p_value >= _WELL for c in more) and not _of_the_file(weighing):
            more += [c for c in several.at_once() if not any(_as_good(m, c) for m in more)]
            if not any(c.p_value >= _DOUBTFUL for c in more):
                more += several.further(promises)
        more = [c for c in more if c.earned(found)]
        found = ranked([*found, *more])
    return found


def _free(weighing: EvidenceComparison, found: Candidate) -> bool:
    """Return whether it is a stretch with separate axes and a mediocre fit: it has as many parameters as two causes."""
    return bool(weighing.instead) and found.names == (_STRETCH,) and found.p_value < _WELL


def _as_good(one: Candidate, other: Candidate) -> bool:
    """Return whether one contains the causes of another and is not worse: most often it is the same."""
    return sorted(one.names) == sorted(other.names) and one.log_evidence > other.log_evidence - _SAME


def _hidden(found: Candidate) -> bool:
    """Return whether it has an oscillator with an unmeasured mode, which may absorb other effects."""
    return any(hides(c.cause) for c in found.chosen)


def _refused(verdict: Verdict, case: _Case, best: float, advice: str) -> DiagnosisResult:
    diagnosis = Diagnosis(
        verdict=verdict,
        causes=(),
        rejected=rejected_causes(case.singles, (), best, unchanged=verdict == "nothing_to_explain"),
        modes=modes_of(case.reference, case.event, case.data),
        gain=None,
        calibration=calibration_summary(case.reference),
        next_measurement=advice,
        failed=_failed(case),
    )
    return DiagnosisResult(diagnosis, None)


def _failed(case: _Case) -> tuple[Failed, ...]:
    """Return the parts left out because of internal faults."""
    return tuple(Failed(part=name, error=text) for name, text in case.weighing.faults.found.items())


def _nearer(case: _Case) -> RecalibratedModel:
    """Return an inconsistent file with its best-fitting parameters alone."""
    (chosen,) = case.singles[0].chosen
    written = chosen.cause.extend(case.reference.file.structure, chosen.row, chosen.theta)
    return RecalibratedModel(written, _gained(case, [chosen], written))


def _gained(case: _Case, chosen: Sequence[SelectedCause], written: Structure) -> Gained:
    before = (case.bare or case.reference.file.calibration).structure
    return written_gain(case.reference, case.data, case.measured, case.heldout, chosen, (before, written))


def _explained(case: _Case, found: list[Candidate], searched: float) -> DiagnosisResult:
    """Name the causes that hold 0.8 of the posterior, those that the data cannot separate as one.

    Parameters
    ----------
    searched : log evidence of the best, as `case.singles` have theirs
    """
    named, sure, left_open = named_causes(case.data, found, _SURE)
    best = found[0]
    chosen, data = _with_all_modes(case, agreeing(case.data, best.chosen))
    chosen = (*chosen, *drift_beside(data, chosen, case.weighing.causes.get("global_stiffness")))
    calibration = case.reference.file.calibration
    removed = [] if case.bare is None else [r for r in _removed(chosen) if _lacked(case.bare, calibration, r[1])]
    if case.bare is not None:  # written without the bodies that the file lacks, once they are taken off
        structure = calibration.structure.model_copy(update={"body": case.bare.structure.body})
        calibration = replace(calibration, structure=structure, nominal=case.bare.nominal)
    others = [c for c in chosen if not any(c is one for one, _ in removed)]
    extended = _extended(calibration, others, best.parts)
    if OF_THE_FILE in best.names:
        named = tuple(as_written(cause, extended) for cause in named)
    accepted = {name for cause in named for name in (cause.cause, *cause.cannot_be_told_from)}
    settings: dict[str, Any] = {"verdict": "explained" if sure else "ambiguous"}
    faults = case.weighing.faults
    fit = faults.attempt(
        "the modes of the written model",
        lambda: fit_of_compared(case.reference, case.data, case.measured, extended, chosen),
    )
    gained = faults.attempt("the gain", lambda: _gained(case, chosen, extended))
    decisive = None if sure else faults.attempt("the next measurement", lambda: _next(case, left_open))
    diagnosis = Diagnosis(
        causes=named,
        rejected=rejected_causes(case.singles, accepted, searched),
        modes=modes_of(case.reference, case.event, case.data, fit),
        gain=gained.gain if gained and gained.significant else None,
        calibration=calibration_summary(case.reference),
        next_measurement=decisive or " ".join(dict.fromkeys(c.cause.advice for c in best.chosen)),
        failed=_failed(case),
        **settings,
    )
    return DiagnosisResult(
        diagnosis,
        extended,
        gained,
        best.parts,
        calibration=calibration if case.bare else None,
        removed=tuple(body for _, body in removed),
    )


def _with_all_modes(case: _Case, chosen: tuple[SelectedCause, ...]) -> tuple[tuple[SelectedCause, ...], Comparison]:
    """Return causes as they agree with all modes that were measured, those included that the baseline lacks."""

    def refitted() -> tuple[tuple[SelectedCause, ...], Comparison]:
        more = with_further_modes(case.data, case.event, case.measured.every, chosen)
        return (chosen if more is case.data else agreeing(more, chosen)), more

    if case.data.filed is not None:  # the model was recalibrated to these very modes
        return chosen, case.data
    return case.weighing.faults.attempt("modes that the reference lacks", refitted) or (chosen, case.data)


def _with_removed_bodies(
    case: _Case, best: Candidate, diagnosed: Callable[[Reference], DiagnosisResult]
) -> DiagnosisResult | None:
    """Return the explanation by a model that had removed bodies, which the structure file lacks, in the baseline.

    None where no such body was removed, or where that model does not explain the event by its removal.

    Parameters
    ----------
    best : the explanation by the model without the bodies
    diagnosed : explains the same event with another reference
    """
    if case.bare is not None or case.reference.filed is not None or not case.reference.calibration.fitted:
        return None
    unlisted = [c.cause.unlisted(c.row, c.theta) for c in best.chosen if isinstance(c.cause, AddedMass)]
    bodies = [body for body in unlisted if body is not None]
    loaded, chosen = None, best.chosen
    for _ in range(_MAX_ROUNDS if bodies else 0):
        loaded = with_bodies_on(case.reference, bodies, shaped=bool(case.data.shaped.any()))
        if loaded is None:
            return None
        data = compare(loaded, case.event, circumstances=case.data.circumstances)
        fitted = _likelier_alone(Compositions(replace(case.weighing, reference=loaded, data=data)), chosen)
        removed = [body for _, body in _removed(fitted.chosen)] if fitted else []
        if fitted is None or len(removed) != len(bodies):
            return None
        chosen, before = fitted.chosen, sorted(bodies, key=attrgetter("at"))
        bodies = sorted(removed, key=attrgetter("at"))
        if all(_same(a, b, size(loaded.structure)) for a, b in zip(bodies, before, strict=True)):
            break
    found = diagnosed(loaded) if loaded else None
    return found if found and found.removed else None


def _likelier_alone(several: Compositions, chosen: tuple[SelectedCause, ...]) -> Candidate | None:
    """Return the causes fitted together, or the bodies among them alone if these are likelier.

    Other causes found may have compensated for the calibration without the bodies.
    """
    bodies = tuple(c for c in chosen if isinstance(c.cause, AddedMass))
    fitted = [several.coordinate_fit(each) for each in dict.fromkeys((bodies, chosen))]
    return max((c for c in fitted if c is not None), key=lambda c: c.log_evidence, default=None)


def _same(one: Body, other: Body, length: float) -> bool:
    """Return whether two estimates of a body have come to rest."""
    moved = float(np.linalg.norm(np.subtract(one.at, other.at)))
    return abs(one.mass / other.mass - 1) < _MASS_CONVERGED and moved < _PLACE_CONVERGED * length


def _lacked(bare: Calibration, loaded: Calibration, body: Body) -> bool:
    """Return whether the body of a loaded model that is nearest to a removed one is not in the structure file."""
    apart = [float(np.linalg.norm(np.subtract(one.at, body.at))) for one in loaded.structure.body]
    return int(np.argmin(apart)) >= len(bare.structure.body)


def _removed(chosen: Sequence[SelectedCause]) -> list[tuple[SelectedCause, Body]]:
    """Return the causes that take off bodies which the model of the reference has, and these."""
    bodies = [(c, c.cause.removed(c.row, c.theta)) for c in chosen if isinstance(c.cause, AddedMass)]
    return [(c, body) for c, body in bodies if body is not None]


def _extended(calibration: Calibration, chosen: Sequence[SelectedCause], parts: Sequence[Fit[Cause]]) -> Structure:
    """Return a calibrated structure with causes written in."""
    extended = calibration.structure
    acting = chosen[::-1]  # the last named acts first: a gain on exchanged channels is another's
    for part in sorted(acting, key=_turn):
        extended = part.cause.extend(extended, part.row, part.theta)
    return _as_known(calibration, extended, parts)


def _as_known(calibration: Calibration, extended: Structure, parts: Sequence[Fit[Cause]]) -> Structure:
    """Return an extended structure without springs and welds that have no effect, rounded to its accuracy."""
    std = calibration.physical_std()
    for part in parts:
        if isinstance(part.hypotheses, Parametric):
            std |= part.hypotheses.physical_std(part)
    knobs = calibration.knobs
    return rounded(simplified(extended, knobs), knobs, std)


def _turn(chosen: SelectedCause) -> int:
    """Return the order in which a cause is written: errors of the file first, a factor on everything last."""
    return 0 if chosen.cause.name == OF_THE_FILE else 1 + chosen.cause.place_free


def _next(case: _Case, left_open: list[Candidate]) -> str:
    """Return the measurement that would decide between the remaining hypotheses; empty if there is only one."""
    if len(left_open) < 2:
        return ""
    bodies = case.weighing.causes.get("added_mass")
    return next_measurement(
        case.reference,
        case.event,
        case.data,
        bodies if isinstance(bodies, AddedMass) else None,
        [c.chosen for c in left_open[:_MAX_OPEN]],
    )
