"""Search for the causes of an event: singles, then combinations while the evidence grows.

If a single cause fits badly (chi-square p under 0.01), or a further one has a large predicted gain, combinations of up
to three are tried. The search is first made with twice the error of a good model: with a larger tolerance, first order
misses less. The result is then evaluated and continued with the actual error, unless the evidence favours the larger
one. A poor reference permits a larger error: if the explanation then leaves several times the noise of frequencies,
others with smaller residuals are sought.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.special import chdtri, logsumexp

from daq import FloatArray
from updater.causes import CATALOGUE, LocalStiffness, ModelParameters, SelectedCause, Springs, covariance_with_unlisted
from updater.diagnosis.case import Case
from updater.diagnosis.combinations import Compositions, common
from updater.diagnosis.model_extension import fixed
from updater.diagnosis.naming import MIN_P, WORTH_NAMING, separation
from updater.diagnosis.places import along_ridges
from updater.diagnosis.relaxation import is_hidden, is_relaxed_doubtful, relaxed_beside
from updater.diagnosis.weighing import DOUBTFUL, MUCH, N_SEEDS, SURE, WELL, Candidate, EvidenceComparison, ranked
from updater.inference import Comparison, compare, fit, freedom_of_frequencies
from updater.modal_data import Circumstances, ModalMean
from updater.reference import Reference

_MIN_P_TOGETHER = 0.03  # of several causes: the best of hundreds of compositions must fit well, not just passably
_SAME = 0.5  # of log evidence: by how much fits that have come to rest at one place may differ
_LOG_ODDS_ROUGH = -3.0  # that a good model is wrong by as much as the search assumes
_WORTH_JUDGING, _MAX_JUDGED = 15.0, 6  # of log evidence under the best of the search; how many
# of predicted log evidence gained, above which another cause is tried despite a good fit: 20 times as probable. In 76
# draws of one cause the largest gain predicted for a second one is -0.3
_WORTH_ADDING = 3.0
_MAX_LEFT = 3.0  # times the residual of noise and a good model in frequencies: an explanation with more is refused
_USUAL = 0.05  # probability of a residual of noise and a good model's error alone, which is not refused
_NO_EFFECT = 5.0  # of log evidence lost by a second body: 7 to 9 where there is none, measured in 32 draws of one body
# of the assumed error of a model's own modes: half of its variance. Half a per cent of a gain and as much by a position
# are 0.71 times the error of shapes
_LESS = 0.71
_MASSES = {"added_mass", "distributed_mass"}  # causes that are masses
_LOST = 50.0  # of chi-square: a fit that is worse than the known one has ended elsewhere
_MAX = 3  # causes at once, in addition to the parameters of a file
# squared distance, in standard deviations, of predictions of one explanation that is found twice: turns of a fit end
# where log evidence grows by less than half of it
_SAME_PREDICTION = 2.0
_SAME_PLACE, _ROUNDING = 3.0, 1e-6  # standard deviations between places of a cause that is found twice; and in m
_NEARLY = 4.0  # of log evidence below the best: a share of 2 %, which refinement may increase to one worth naming
_EXCHANGED = 3  # causes from which one of them is exchanged: pairs are sought from several single causes


def nothing_changed(weighing: EvidenceComparison, singles: list[Candidate]) -> bool:
    """Return whether nothing has changed: no change fits, and no cause is much more probable."""
    everything = [weighing.log_nothing, *(c.log_evidence for c in singles if c.effective)]
    share = weighing.log_nothing - float(logsumexp(np.array(everything)))
    return share >= np.log(1 - SURE) and weighing.nothing.p_value >= MIN_P


def beside_the_file(weighing: EvidenceComparison, singles: list[Candidate]) -> list[Candidate]:
    """Return causes in addition to a file with small errors in many places, however well one cause fits.

    Causes of the file come first: otherwise changes would be mistaken for similar causes.
    """
    several = Compositions(weighing)
    promises = several.rank_by_linear_prediction([c for c in singles if CATALOGUE[c.names[0]].of_the_file])
    return [c for c in several.together(promises) if c.earned(singles)] if promises else []


def fits(best: Candidate) -> bool:
    """Return whether an explanation fits all data."""
    return best.p_value >= (MIN_P if len(best.chosen) == 1 else _MIN_P_TOGETHER)


def within_noise(good: Comparison, chosen: Sequence[SelectedCause]) -> bool:
    """Return whether the residual of the frequencies is at most several times that of noise and a good model's error.

    A poor reference permits larger residuals of a fit. They may be the reference's error, or another cause. Where the
    parameters take nearly all degrees of freedom of the frequencies, the expected residual is nearly zero. A residual
    that noise alone exceeds in 5 % of cases is then no reason to refuse.

    Parameters
    ----------
    good : the event, compared with the error of a good model
    chosen : causes with their parameters; none: no change
    """
    found = fit(good, fixed(good, chosen))
    off = found.frequency_residual[0]
    expected = _MAX_LEFT**2 * max(freedom_of_frequencies(good, found), 1.0)
    return bool(off @ off <= max(expected, chdtri(len(off), _USUAL)))


def closer(case: Case, found: list[Candidate], good: Comparison) -> list[Candidate]:
    """Return explanations that leave no more than noise, several causes included; those given if there are none.

    They are sought with the error of a good model, and compared and fitted with the actual one.

    Parameters
    ----------
    good : the event, compared with the error of a good model
    """
    weighing = replace(case.weighing, data=good)
    weighing, sought = stepwise(weighing, _again(weighing, found), rough=False)
    closer = [c for c in sought if within_noise(good, c.chosen)][:_MAX_JUDGED]
    actual = Compositions(replace(weighing, data=case.data))
    again = [actual.coordinate_fit(c.chosen) for c in closer]
    return ranked([fitted for fitted in again if fitted is not None]) or found


def with_open_places(case: Case, found: list[Candidate]) -> list[Candidate]:
    """Return explanations with places and sizes as the error of the section moments and the other cause leave them.

    The error of a model is relative to a typical displacement or moment. A stretch near a free end, where all moments
    are small, has a larger share of it than the measured shifts show. Evidence and p value remain: the error follows
    from the fitted stretch. A body and another cause have the posterior of both places together (`along_ridges`).
    """
    worth = found[0].log_evidence + float(np.log(WORTH_NAMING))
    return ranked([_with_open_places(case, c) if c.log_evidence >= worth else c for c in found])


def _with_open_places(case: Case, candidate: Candidate) -> Candidate:
    weighing, fitted = case.weighing, candidate
    parts = [(p.hypotheses, p) for p in candidate.parts]
    typical = sum(cause.typical_shift(part) for cause, part in parts if isinstance(cause, LocalStiffness))
    if typical > np.abs(case.data.log_ratio).mean():
        data = compare(case.reference, case.event, circumstances=case.data.circumstances, typical_shift=typical)
        coarser = replace(case.weighing, data=data)
        again = Compositions(coarser).coordinate_fit(candidate.chosen)
        if again is not None:
            weighing, fitted = coarser, again
    names = " and ".join(weighing.label(name) for name in fitted.names)
    ridge = weighing.faults.attempt(names, partial(along_ridges, weighing, fitted)) or fitted
    gained = ridge.log_evidence - fitted.log_evidence
    return replace(candidate, chosen=ridge.chosen, parts=ridge.parts, log_evidence=candidate.log_evidence + gained)


def with_unlisted_bodies(case: Case, found: list[Candidate]) -> list[Candidate]:
    """Return explanations of a file with deviations of its parameters by bodies that it lacks, unless they name a mass.

    The deviation of a connection that a cause of its own changed too is that of both together.
    """
    if not case.reference.of_file:
        return found
    worth = found[0].log_evidence + float(np.log(WORTH_NAMING))
    return [_with_unlisted_bodies(case, c) if c.log_evidence >= worth else c for c in found]


def _with_unlisted_bodies(case: Case, candidate: Candidate) -> Candidate:
    of_the_file = [c.cause for c in candidate.chosen if isinstance(c.cause, ModelParameters)]
    if not of_the_file:
        return candidate
    covariance, by_bodies = covariance_with_unlisted(case.reference, case.data, candidate.chosen)
    covariance = covariance + by_bodies * _MASSES.isdisjoint(candidate.names)
    ends = np.cumsum([len(c.theta) for c in candidate.chosen])
    columns = [np.arange(end - len(c.theta), end) for c, end in zip(candidate.chosen, ends, strict=True)]
    of_file = next(own for own, c in zip(columns, candidate.chosen, strict=True) if c.cause is of_the_file[0])
    parts = []
    for own, chosen, part in zip(columns, candidate.chosen, candidate.parts, strict=True):
        if isinstance(chosen.cause, Springs):
            unit = np.eye(len(covariance))[own]
            unit[:, of_file] += chosen.cause.same_springs(chosen.row, of_the_file[0].knobs)
            own_covariance = unit @ covariance @ unit.T
        elif isinstance(chosen.cause, ModelParameters):
            own_covariance = covariance[np.ix_(own, own)]
        else:
            parts.append(part)
            continue
        whole = part.covariance.copy()
        whole[part.best] = own_covariance
        parts.append(replace(part, covariance=whole))
    return replace(candidate, parts=tuple(parts))


def with_learned_error(
    reference: Reference, event: ModalMean, known: Circumstances, best: Candidate
) -> tuple[Reference, float]:
    """Return the reference with half the variance assumed for a structure file's model, if that is more probable.

    How well the modes of a model agree with those of its structure, once its parameters are fitted, is not known
    beforehand. With too large an error, larger changes remain without significance.

    Parameters
    ----------
    reference : with the assumed error
    known : circumstances of the event
    best : explanation

    Returns
    -------
    Reference
        The same if the smaller error is less probable.
    float
        Log evidence of the explanation with it, of its alternative alone.
    """

    def evidence(one: Reference) -> float:
        data = compare(one, event, circumstances=known)
        found = fit(data, fixed(data, best.chosen))
        return -np.inf if found.p_value < MIN_P else found.log_evidence + data.log_det_of_shapes

    both = (reference, reference.with_own_error(_LESS))
    return max(((one, evidence(one)) for one in both), key=lambda found: found[1])


def judged(case: Case, found: list[Candidate], data: Comparison) -> tuple[Case, list[Candidate]]:
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
    weighing, judged = relaxed_beside(*stepwise(weighing, again, rough=False))
    evidence, searched = (
        judged[0].log_evidence + data.log_det_of_shapes,
        found[0].log_evidence + case.data.log_det_of_shapes,
    )
    if evidence < searched + _LOG_ODDS_ROUGH:
        return case, found
    return replace(case, data=data, weighing=weighing), judged


def _again(weighing: EvidenceComparison, found: list[Candidate]) -> list[Candidate]:
    """Return the best of a search, fitted to other data.

    Two common forms (bodies) are also fitted next to a rare cause (a distributed mass), unless one fits well. Next to a
    relaxed cause that may be two others, they are fitted as well as other starting causes.
    """
    several = Compositions(weighing)
    near = [c for c in found if c.log_evidence > found[0].log_evidence - _WORTH_JUDGING][:_MAX_JUDGED]
    if is_hidden(near[0]):
        near += [c for c in found if not is_hidden(c) and c not in near][: N_SEEDS - 1]
    again = ranked([fitted for fitted in (_fitted_again(several, c) for c in near) if fitted is not None])
    free = bool(again) and is_relaxed_doubtful(weighing, again[0])
    if free:
        (name,) = again[0].names
        others = [c for c in found if name not in c.names and not is_hidden(c) and c not in near][: N_SEEDS - 1]
        again += [fitted for fitted in (several.coordinate_fit(c.chosen) for c in others) if fitted is not None]
    rare = any(len(c.names) == 1 and CATALOGUE[c.names[0]].common_form for c in again)
    if free or (rare and not _explains_alone(weighing, again[0])):
        again += several.at_once(weighing.common_forms, known=again)
    return ranked(again)


def _fitted_again(several: Compositions, found: Candidate) -> Candidate | None:
    """Return an explanation fitted to other data; from its parameters, where a fit that begins without them is worse.

    Where modes cross on the way, a fit that allows for less error may end before them.
    """
    fitted = several.coordinate_fit(found.chosen)
    data = several.weighing.data
    known = fit(data, fixed(data, found.chosen))
    if fitted is not None and fitted.chi_square < known.chi_square[0] + _LOST:
        return fitted
    return several.fit_from(found) or fitted


def _explains_alone(weighing: EvidenceComparison, best: Candidate) -> bool:
    """Return whether one common form (a body) fits, and a second one would have next to no effect, to first order."""
    if best.p_value < WELL or len(best.names) > 1 or best.names[0] not in weighing.common_forms:
        return False
    promises = Compositions(replace(weighing, allowed=weighing.common_forms)).rank_by_linear_prediction([best])
    return not promises or promises[0].log_evidence < best.log_evidence - _NO_EFFECT


def _worth_adding(weighing: EvidenceComparison) -> float:
    """Return the predicted gain of log evidence above which another cause is tried despite a good fit.

    The error of a mesh is one and the same in all modes, which may imitate a small cause: then it must be larger.
    """
    return MUCH if weighing.data.mesh_error.any() else _WORTH_ADDING


def stepwise(
    weighing: EvidenceComparison, found: list[Candidate], *, rough: bool
) -> tuple[EvidenceComparison, list[Candidate]]:
    """Return single causes and, if a further one promises a large gain, combinations while the evidence grows.

    Before a third cause is sought, the relaxed form of one of two is tried.

    Parameters
    ----------
    rough : whether it is sufficient that the result is no misfit, whatever a further cause would gain
    """
    if not found:  # no chosen cause has an effect
        return weighing, found
    start = len(found[0].chosen) if not rough and Compositions(weighing).of_the_file_alone(found[0]) else 1
    for number in range(start, _MAX + bool(weighing.of_the_file)):
        as_many = [c for c in found if len(c.chosen) == number]
        if not as_many and number < len(found[0].chosen):
            continue  # the best is continued where none of its parts is left
        seeds = as_many[:N_SEEDS]
        seeds += [c for c in as_many[N_SEEDS:] if sorted(c.names) == common(seeds[0].names)]
        doubted = _is_doubtful(found[0]) or is_hidden(found[0]) or is_relaxed_doubtful(weighing, found[0])
        if not seeds or len(found[0].chosen) < number or (rough and not _is_doubtful(found[0])):
            break
        if len(found[0].chosen) > number and not doubted:
            break
        several = Compositions(weighing)
        promises = several.rank_by_linear_prediction(seeds if doubted else seeds[:1])
        least = 0.0 if several.of_the_file_alone(found[0]) else _worth_adding(weighing)
        if not promises or (not doubted and promises[0].log_evidence < found[0].log_evidence + least):
            break
        more = several.together(promises)
        if number == 1 and not any(c.p_value >= WELL for c in more) and not weighing.of_the_file:
            more += [c for c in several.at_once(known=more) if not any(_as_good(m, c) for m in more)]
            if all(map(_is_doubtful, more)):
                more += several.further(promises, more)
        if number == 1:
            more += several.later(promises, more)
        more = [c for c in more if c.earned(found)]
        found = ranked([*found, *more])
        if _is_doubtful(found[0]):
            weighing, found = relaxed_beside(weighing, found)
    return weighing, found


def _is_doubtful(found: Candidate) -> bool:
    """Return whether one cause more is tried, whatever its predicted gain: several that do not fit are refused."""
    return found.p_value < (DOUBTFUL if len(found.chosen) == 1 else _MIN_P_TOGETHER)


def with_two_bodies(
    plain: EvidenceComparison, search: EvidenceComparison, singles: Sequence[Candidate], found: list[Candidate]
) -> tuple[EvidenceComparison, list[Candidate]]:
    """Try two bodies and another cause, where no explanation fits; they replace the given ones if more probable.

    Parameters
    ----------
    plain : the causes in their plain forms
    search : those of the given explanations
    """
    if not found or not _is_doubtful(found[0]) or plain.of_the_file:
        return search, found
    more = [c for c in Compositions(plain).with_two_bodies(singles) if c.earned(found)]
    every = ranked([*found, *more])
    return (plain if every[0] in more else search), every


def exchanged(weighing: EvidenceComparison, found: list[Candidate]) -> list[Candidate]:
    """Return explanations by three and more causes, those included with one cause exchanged, while these are better."""
    several = Compositions(weighing)
    while len(found[0].chosen) >= _EXCHANGED:
        better, others = list(found), [other for one in _begun(found) for other in several.exchanged(one)]
        for one in ranked(others):  # several exchanges may lead to the same causes
            if one.earned(found) and not any(_as_good(other, one) for other in better):
                better.append(one)
        better = ranked(better)
        if better[0] is found[0]:
            return better
        found = better
    return found


def _begun(found: Sequence[Candidate]) -> list[Candidate]:
    """Return the explanations from which causes are exchanged: the best, and that with common forms of its rare causes.

    The latter is only nearly as probable where a further cause imitates a second body: then only an exchange from it
    leads to two bodies.
    """
    best, plain = found[0], common(found[0].names)
    nearly = [c for c in found if sorted(c.names) == plain and c.log_evidence > best.log_evidence - _NEARLY]
    return [best] if plain == sorted(best.names) else [best, *nearly[:1]]


def evenly_refined(weighing: EvidenceComparison, found: list[Candidate]) -> list[Candidate]:
    """Return explanations, those by several causes that are nearly as probable as the best one refined like it.

    A search refines its best fit only: with the log evidence of their first fit, others appear less probable than they
    are. Refined, two of them may be one, which counts once.
    """
    least = found[0].log_evidence - _NEARLY
    near = [c for c in found if c.log_evidence > least and len(c.chosen) > 1]
    if all(c is found[0] for c in near):
        return found
    several = Compositions(weighing)
    again = [(c, several.converged_fit(c.chosen)) for c in near]
    kept: list[Candidate] = []
    for one in ranked([c if new is None or new.log_evidence < c.log_evidence else new for c, new in again]):
        if not any(_is_same(weighing.data, one, other) for other in kept):
            kept.append(one)
    return ranked([*kept, *(c for c in found if c not in near)])


def _is_same(data: Comparison, one: Candidate, other: Candidate) -> bool:
    """Return whether two explanations are one: the same causes at the same places with the same prediction."""
    return (
        sorted(one.names) == sorted(other.names)
        and all(map(_is_near, _placed(one), _placed(other)))
        and separation(data, one, other) < _SAME_PREDICTION
    )


def _placed(candidate: Candidate) -> list[tuple[str, FloatArray, float]]:
    """Return the causes with place and its standard deviation [m], by name and place; without a place at the origin."""
    found = []
    for part in candidate.parts:
        where = part.hypotheses.where(part)
        position = (where and where.position) or (0.0, 0.0, 0.0)
        found.append((part.hypotheses.name, position, (where and where.position_std) or 0.0))
    return [(name, np.array(position), std) for name, position, std in sorted(found)]


def _is_near(one: tuple[str, FloatArray, float], other: tuple[str, FloatArray, float]) -> bool:
    """Return whether two places are the same within their standard deviations."""
    return bool(np.linalg.norm(one[1] - other[1]) <= _SAME_PLACE * np.hypot(one[2], other[2]) + _ROUNDING)


def _as_good(one: Candidate, other: Candidate) -> bool:
    """Return whether one contains the causes of another and is not worse: most often it is the same."""
    return sorted(one.names) == sorted(other.names) and one.log_evidence > other.log_evidence - _SAME
