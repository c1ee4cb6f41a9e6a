"""Removed bodies that the structure file lacks: they were on while the baseline was measured.

The model was then calibrated to modes with the body and without its mass. The diagnosis is made once more with a model
that has the body, until the mass that is taken off is the mass that it has.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from updater.baseline import with_bodies_on
from updater.causes import AddedMass, SelectedCause
from updater.diagnosis.case import Case, DiagnosisResult
from updater.diagnosis.combinations import Compositions
from updater.diagnosis.weighing import Candidate
from updater.inference import compare
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
        data = compare(loaded, case.event, circumstances=case.data.circumstances)
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
