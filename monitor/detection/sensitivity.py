"""The smallest changes that the detectors find: of all frequencies alike, and of one mode alone."""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray
from monitor.detection.detectors import GUARD, WEIGHTS, LawState, ScoredWindows
from monitor.detection.run_length import averaged
from monitor.detection.scores import CLIP, distance, tamed
from monitor.detection.temperature_law import BoolArray, Law

_SIZES = np.geomspace(1e-6, 1.0, 241)  # of log frequencies, between which is interpolated
_MUCH = 3.0  # times as large as where the law is sure


@dataclass(frozen=True, eq=False, kw_only=True)
class Detectable:
    """Smallest lasting changes that bring a detector to its limit if errors are zero, as log frequencies."""

    alike: float  #: change of all modes alike
    each: FloatArray  #: (n_tracks,) of one mode alone; infinite where no detector finds it


def detectable_change(watched: LawState, judged: ScoredWindows) -> Detectable:
    """Return the smallest lasting changes that would be found in the conditions of the last window.

    All modes being identified, the change enters the averages for `GUARD` windows, after which the law begins to learn
    it. One mode alone enters averages clipped, so that a larger change of one must be a jump.

    Parameters
    ----------
    watched : by which it was judged, from `judge`, of one site
    judged : windows
    """
    law, p = watched.law, len(watched.law.scale)
    lasting, variance = law.lasting(judged.terms[-1:])[0], law.fast * judged.variance[-1]
    covariance = lasting + variance * np.eye(p)
    alone_std = 1 / np.sqrt(np.diagonal(np.linalg.inv(covariance)))
    changes = np.vstack([np.ones(p), np.eye(p)]) / law.scale  # (1 + p, p), whitened
    found = [_jump(changes, covariance, law, float(judged.limit[0, -1]))]
    for weight, limit in zip(WEIGHTS, judged.limit[1:, -1], strict=True):
        fast = averaged(weight, watched.watching.overlap)[0] * variance
        squared = distance(changes, lasting + fast * np.eye(p))[0] / p
        size = np.sqrt(limit / squared) / (1 - (1 - weight) ** GUARD)
        size[1:] = np.where(size[1:] <= CLIP * alone_std * law.scale, size[1:], np.inf)
        found.append(size)
    least = np.min(found, axis=0)
    return Detectable(alike=float(least[0]), each=least[1:])


def least_unsure(watched: LawState, judged: ScoredWindows) -> float | None:
    """Return the smallest change that would have put a window over the jump's limit, if the law hides smaller ones.

    Parameters
    ----------
    watched : by which it was judged, from `judge`, of one site
    judged : one window

    Returns
    -------
    float or None
        For a change of all log frequencies alike, in a window with the predicted values otherwise. None if the
        temperature is read and the change is less than three times that of a certain law, long after the baseline, or
        if there are no modes.
    """
    law = watched.law
    sure = replace(law, unknown=np.zeros_like(law.unknown))
    measured = judged.terms.copy()
    measured[..., 2:4, :] = 0.0
    seen = np.isfinite(judged.whitened[-1])
    if not seen.any():
        return None
    least = _least(law, np.array([watched.age]), judged, judged.terms, seen)
    if_sure = _least(
        sure, None, judged, measured, seen
    )  # with all unobserved movements, which make the mean of a young law uncertain
    return least if judged.carried[-1] or least > _MUCH * if_sure else None


def _least(law: Law, age: FloatArray | None, judged: ScoredWindows, terms: FloatArray, seen: BoolArray) -> float:
    covariance = law.lasting(terms, age)[-1] + law.fast * judged.variance[-1] * np.eye(len(law.scale))
    found = _jump(np.where(seen, 1 / law.scale, np.nan)[None], covariance, law, float(judged.limit[0, -1]))
    return min(float(found[0]), float(_SIZES[-1]))


def _jump(changes: FloatArray, covariance: FloatArray, law: Law, limit: float) -> FloatArray:
    """Return the factors (n,) that bring whitened changes (n, n_tracks) to the limit of the jump; infinite if none."""
    squared, n = distance(tamed(_SIZES[:, None] * changes[:, None], covariance, law.tail), covariance)
    level, sizes = np.log(squared / n), np.log(_SIZES)
    return np.asarray(np.exp([np.interp(np.log(limit), own, sizes, right=np.inf) for own in level]))
