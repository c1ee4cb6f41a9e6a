"""The smallest change of all frequencies alike that a window could have told as a jump."""

from dataclasses import replace

import numpy as np

from daq import FloatArray
from monitor.detection.detector import Judged, Watched
from monitor.detection.law import BoolArray, Law
from monitor.detection.scores import distance, tamed

_SIZES = np.geomspace(1e-6, 1.0, 241)  # of log frequencies, between which is interpolated
_MUCH = 3.0  # times as large as where the law is sure


def least_unsure(watched: Watched, judged: Judged) -> float | None:
    """Return the smallest change that would have put a window over the jump's limit, if the law hides smaller ones.

    Parameters
    ----------
    watched : by which it was judged, from `judge`, of one site
    judged : one window

    Returns
    -------
    float or None
        Of all log frequencies alike, the window being otherwise where the law predicts. None where the temperature is
        read and it is less than three times what it would be, long after the baseline, if the law were sure of itself,
        or no mode was seen.
    """
    law = watched.law
    sure = replace(law, unknown=np.zeros_like(law.unknown))
    measured = judged.terms.copy()
    measured[..., 2:, :] = 0.0
    seen = np.isfinite(judged.whitened[-1])
    if not seen.any():
        return None
    least = _least(law, np.array([watched.age]), judged, judged.terms, seen)
    if_sure = _least(
        sure, None, judged, measured, seen
    )  # and all had come that is feared, which makes a young law's mean unsure
    return least if judged.carried[-1] or least > _MUCH * if_sure else None


def _least(law: Law, age: FloatArray | None, judged: Judged, terms: FloatArray, seen: BoolArray) -> float:
    covariance = law.lasting(terms, age)[-1] + law.fast * judged.variance[-1] * np.eye(len(law.scale))
    moved: FloatArray = np.where(seen, _SIZES[:, None] / law.scale, np.nan)
    squared, n = distance(tamed(moved, covariance, law.tail), covariance)
    return float(np.exp(np.interp(np.log(judged.limit[0, -1]), np.log(squared / n), np.log(_SIZES))))
