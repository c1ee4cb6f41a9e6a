"""Other places of a cause: definition of another place, and the next best place of a fit."""

import numpy as np

from updater.causes.base import Cause, Placed
from updater.fit import Fit
from updater.structure import Structure

_FAR = 0.05  # of the structure's largest extent, from where on a place is another one
_ASIDE = 4  # times as far on the same member: nearer alternatives are one broad maximum's


def another_place(structure: Structure) -> float:
    """Return how far apart places are two [m]."""
    ends = np.array([end for member in structure.member for end in (member.point(0.0), member.point(member.length))])
    return _FAR * float(np.linalg.norm(np.ptp(ends, axis=0)))


def next_place(part: Fit[Cause], within: float) -> int | None:
    """Return the best alternative at another place than the best one, None if none is nearly as likely.

    Parameters
    ----------
    part : fit of one cause
    within : of log density under the best
    """
    cause = part.hypotheses
    if not isinstance(cause, Placed):
        return None
    log = part.log_density + cause.log_prior
    points = cause.points(part)
    away = np.linalg.norm(points - points[part.best], axis=1)
    far = away > _ASIDE * another_place(cause.reference.calibration.structure)
    likely = np.flatnonzero(far & (log > log[part.best] - within))
    return int(likely[np.argmax(log[likely])]) if len(likely) else None
