"""Relaxed forms of causes: the same with more parameters, where that is much likelier.

A stretch has one loss of stiffness; relaxed, it has one about either axis of its section and one in twist. Two other
causes may explain what the additional parameters do, so that the plain form is tried again in combinations.
"""

from dataclasses import replace

from updater.causes import CATALOGUE, SelectedCause, has_unobserved_mode
from updater.diagnosis.combinations import Compositions
from updater.diagnosis.weighing import DOUBTFUL, MUCH, WELL, Candidate, EvidenceComparison, ranked

_MIN_SHARE = 0.5  # of the misfit of a cause alone, that its relaxed form must explain to replace it
_FAR = 10.0  # times the misfit of the likeliest cause: the relaxed form of a cause with more is not tried alone
_MEDIOCRE = 0.1  # p value of a fit under which a relaxed cause with a body is tried: one of ten right fits has less
_WITH_BODY = 2  # causes that change frequencies
_RIVAL = 60.0  # of log evidence below the best of the plain form: its relaxed one is not tried


def relaxed_alone(search: EvidenceComparison, singles: list[Candidate]) -> tuple[EvidenceComparison, list[Candidate]]:
    """Replace the likeliest cause that has a relaxed form by it, if it explains half of the misfit.

    Less may be due to another cause: then the relaxed form is tried in combinations. It is not tried where another
    cause fits well, unless that may absorb what the relaxed form explains, or where another one fits far better. A
    crack that opens and closes by the signals is most often in one plane: then it is always tried.
    """
    plain = next((c for c in singles if CATALOGUE[c.names[0]].relaxed), None)
    if plain is None or (search.nothing.p_value >= WELL and not search.data.circumstances.opening):
        return search, singles
    rival = next((c for c in singles if not is_hidden(c)), plain)
    if not search.data.circumstances.opening:
        if rival.p_value >= WELL and plain.log_evidence < rival.log_evidence - _RIVAL:
            return search, singles
        if plain.misfit > _FAR * rival.misfit > 0:
            return search, singles
    relaxed = _relaxed(search, plain.names[0])
    found = _fitted(relaxed, plain)
    if found is None or found.log_evidence < plain.log_evidence + MUCH + _MIN_SHARE * plain.misfit / 2:
        return search, singles
    return relaxed, ranked([found, *(c for c in singles if c is not plain)])


def with_relaxed_form(search: EvidenceComparison, single: Candidate) -> Candidate:
    """Return a single cause in its relaxed form, where that is likelier."""
    if search.instead or not CATALOGUE[single.names[0]].relaxed:
        return single
    found = _fitted(_relaxed(search, single.names[0]), single)
    return single if found is None or found.log_evidence < single.log_evidence else found


def _fitted(relaxed: EvidenceComparison, plain: Candidate) -> Candidate | None:
    """Return the relaxed form of a single cause; None if it has none here, or fails."""
    first = next(iter(relaxed.first_fits(plain.names)), None)
    return None if first is None else relaxed.refined(first) or first


def relaxed_beside(search: EvidenceComparison, found: list[Candidate]) -> tuple[EvidenceComparison, list[Candidate]]:
    """Relax a cause in the best combination that has it, or add it relaxed to another cause, if much likelier.

    It is not tried where the causes fit well.
    """
    considered = () if search.instead or not found or found[0].p_value >= WELL else search.causes
    for name in (name for name in considered if CATALOGUE[name].relaxed):
        relaxed = _relaxed(search, name)
        if relaxed.cause(name) is None:  # groups of external matrices have no other form
            continue
        several = Compositions(relaxed)
        fitted = [several.coordinate_fit(chosen) for chosen in _combined(relaxed, name, found)]
        other = max((c for c in fitted if c is not None), key=lambda c: c.log_evidence, default=None)
        if other is None:
            continue
        alike = [c for c in found if sorted(c.names) == sorted(other.names)]
        if other.log_evidence >= max(c.log_evidence for c in alike or found) + MUCH:
            return relaxed, ranked([other, *(c for c in found if c not in alike[:1])])
    return search, found


def unrelaxed_beside(
    plain: EvidenceComparison, search: EvidenceComparison, found: list[Candidate]
) -> tuple[EvidenceComparison, list[Candidate]]:
    """Return to the plain form if another cause explains the part that the additional parameters had to explain."""
    best = found[0] if found else None
    for name in search.instead:
        if best is None or len(best.chosen) == 1 or best.names.count(name) != 1:
            continue
        other = Compositions(plain).likely_fit(_last(best.chosen, name), best.log_evidence)
        if other is not None and best.log_evidence < other.log_evidence + MUCH:
            return plain, ranked([other, *(c for c in found if c is not best)])
    return search, found


def relaxed_with_body(search: EvidenceComparison, found: list[Candidate]) -> tuple[EvidenceComparison, list[Candidate]]:
    """Add a relaxed cause with a body, where the best fit is mediocre or may absorb other effects, if much likelier.

    The search cannot begin from a relaxed cause that is at a wrong place without the body, nor from the plain form.
    """
    several = Compositions(search)
    if not found or (found[0].p_value >= _MEDIOCRE and not is_hidden(found[0])):
        return search, found
    if search.of_the_file or several.most_drifting < _WITH_BODY:
        return search, found
    for name in (name for name in search.causes if CATALOGUE[name].relaxed):
        relaxed = search if name in search.instead else _relaxed(search, name)
        form = relaxed.cause(name)
        for body in (relaxed.cause(one) for one in search.common_forms):
            if form is None or body is None or (relaxed is search and {name, body.name} == {*found[0].names}):
                continue
            both = (SelectedCause.begun(form), SelectedCause.begun(body))
            fitted = Compositions(relaxed).converged_fit(both, found[:1])
            if fitted is None or fitted.log_evidence < found[0].log_evidence + MUCH:
                continue
            if fitted.earned(found):
                return relaxed, ranked([fitted, *found])
    return search, found


def is_relaxed_doubtful(weighing: EvidenceComparison, found: Candidate) -> bool:
    """Return whether it is one relaxed cause with a mediocre fit: it has as many parameters as two causes."""
    return len(found.chosen) == 1 and found.names[0] in weighing.instead and found.p_value < WELL


def is_hidden(found: Candidate) -> bool:
    """Return whether it has an oscillator with an unmeasured mode, which may absorb other effects."""
    return any(has_unobserved_mode(c.cause) for c in found.chosen)


def _relaxed(search: EvidenceComparison, name: str) -> EvidenceComparison:
    form = CATALOGUE[name].relaxed
    assert form is not None
    return replace(search, instead={name: form})


def _last(chosen: tuple[SelectedCause, ...], name: str) -> tuple[SelectedCause, ...]:
    """Return causes with one of a name last: it is fitted first."""
    return tuple(sorted(chosen, key=lambda c: c.cause.name == name))


def _combined(relaxed: EvidenceComparison, name: str, found: list[Candidate]) -> list[tuple[SelectedCause, ...]]:
    """Return combinations with a relaxed cause, which comes last.

    If one cause alone does not fit, nor several, and none of these is the one that can be relaxed, it is tried together
    with the best.
    """
    best = next((c for c in found if len(c.chosen) > 1 and c.names.count(name) == 1), None)
    tried = []
    if best is not None and best.log_evidence >= found[0].log_evidence - _RIVAL:
        tried.append(_last(best.chosen, name))
    alone = next((c for c in found if len(c.chosen) == 1 and not is_hidden(c)), None)
    form = relaxed.cause(name)
    if alone is None or form is None or alone.names == (name,):
        return tried
    if alone.p_value < DOUBTFUL and found[0].p_value < WELL and name not in found[0].names:
        tried.append((*alone.chosen, SelectedCause.begun(form)))
    return tried
