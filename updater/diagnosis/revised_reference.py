"""Explanations by a revised reference, where the explanation of a change shows that the first one was wrong.

Removed bodies that the structure file lacks were on while the baseline was measured: the model was calibrated to modes
with the body and without its mass. The diagnosis is made once more with a model that has the body, until the mass that
is taken off is the mass that it has.

The stiffness of a connection may have been calibrated to another error of the file, such as a body that it lacks. A
change of it then corrects the calibration. The diagnosis is made once more with the stiffness after that change in the
reference too, if that makes baseline and event together more probable.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from updater.baseline import with_bodies_on, with_springs_at
from updater.causes import AddedMass, SelectedCause, Springs
from updater.diagnosis.case import Case, DiagnosisResult
from updater.diagnosis.combinations import Compositions
from updater.diagnosis.weighing import Candidate
from updater.inference import compare
from updater.quantities import FREQUENCY_STD
from updater.reference import Calibration, Reference
from updater.structure import Body, size

_MAX_ROUNDS, _MASS_CONVERGED = 12, 0.01  # until the mass of a removed body changes by no more than this share ...
_PLACE_CONVERGED = 2e-3  # ... and its place by no more than this share of the structure's size


def with_removed_bodies(
    case: Case, best: Candidate, diagnosed: Callable[[Reference], DiagnosisResult]
) -> DiagnosisResult | None:
    """Return the explanation by a model that had removed bodies, which the structure file lacks, in the baseline.

    None where no such body was removed, or where that model does not explain the event by its removal.

    Parameters
    ----------
    best : the explanation by the model without the bodies
    diagnosed : explains the same event with another reference
    """
    if case.bare is not None or case.reference.nominal is not None or not case.reference.calibration.fitted:
        return None
    unlisted = [c.cause.unlisted(c.row, c.theta) for c in best.chosen if isinstance(c.cause, AddedMass)]
    bodies = [body for body in unlisted if body is not None]
    loaded, chosen = None, best.chosen
    for _ in range(_MAX_ROUNDS if bodies else 0):
        loaded = with_bodies_on(case.reference, bodies, shaped=bool(case.data.shaped.any()))
        if loaded is None:
            return None
        data = compare(loaded, case.event, circumstances=case.of_other_references)
        fitted = _likelier_alone(Compositions(replace(case.weighing, reference=loaded, data=data)), chosen)
        removed = [body for _, body in removed_bodies(fitted.chosen)] if fitted else []
        if fitted is None or len(removed) != len(bodies):
            return None
        chosen, before = fitted.chosen, sorted(bodies, key=attrgetter("at"))
        bodies = sorted(removed, key=attrgetter("at"))
        if all(_same(a, b, size(loaded.structure)) for a, b in zip(bodies, before, strict=True)):
            break
    found = diagnosed(loaded) if loaded else None
    return found if found and found.removed else None


def with_unchanged_springs(
    case: Case, best: Candidate, diagnosed: Callable[[Reference], DiagnosisResult]
) -> DiagnosisResult | None:
    """Return the explanation by a reference in which a connection is as after its change, which then is none.

    None where no connection changed in addition to another cause, or where baseline and event together are more
    probable with the change.

    Parameters
    ----------
    best : the explanation by the first reference
    diagnosed : explains the same event with another reference
    """
    reference = case.reference
    if case.bare is not None or reference.nominal is not None or not reference.calibration.fitted:
        return None
    known = {knob.key: knob for knob in reference.calibration.knobs}
    most = best.log_evidence + case.data.log_det_of_shapes + _log_likelihood(reference)
    revised, held = None, dict[str, float]()
    for one in best.chosen if len(best.chosen) > 1 else ():
        springs = one.cause.flexibility(one.row, one.theta) if isinstance(one.cause, Springs) else {}
        other = None
        if springs and all(k in known and known[k].lower <= value <= known[k].upper for k, value in springs.items()):
            other = with_springs_at(reference, springs, shaped=bool(case.data.shaped.any()))
        if other is None:
            continue
        data = compare(other, case.event, circumstances=case.of_other_references)
        several = Compositions(replace(case.weighing, reference=other, data=data))
        fitted = several.coordinate_fit(tuple(c for c in best.chosen if c is not one))
        log = -np.inf if fitted is None else fitted.log_evidence + data.log_det_of_shapes + _log_likelihood(other)
        if log > most:
            most, revised, held = log, other, springs
    if revised is None:
        return None
    found = diagnosed(revised)
    return replace(found, calibration=found.calibration or revised.calibration, springs=(*sorted(held), *found.springs))


def _log_likelihood(reference: Reference) -> float:
    """Return the log likelihood of the baseline's frequencies, but for a constant.

    The error of the model is unknown: at least that of a good one, with a prior uniform in its logarithm above.
    """
    calibration = reference.calibration
    off = np.log(calibration.modes.frequency[reference.paired]) - reference.baseline.log_frequency
    return -0.5 * len(off) * float(np.log(np.mean(off**2) + FREQUENCY_STD**2))


def removed_bodies(chosen: Sequence[SelectedCause]) -> list[tuple[SelectedCause, Body]]:
    """Return the causes that take off bodies which the model of the reference has, and these."""
    bodies = [(c, c.cause.removed(c.row, c.theta)) for c in chosen if isinstance(c.cause, AddedMass)]
    return [(c, body) for c, body in bodies if body is not None]


def is_lacked(bare: Calibration, loaded: Calibration, body: Body) -> bool:
    """Return whether the body of a loaded model that is nearest to a removed one is not in the structure file."""
    apart = [float(np.linalg.norm(np.subtract(one.at, body.at))) for one in loaded.structure.body]
    return int(np.argmin(apart)) >= len(bare.structure.body)


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
