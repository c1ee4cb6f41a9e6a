"""Distances of windows from a law: tails tamed, modes that are missing left out."""

import numpy as np
import numpy.typing as npt

from daq import FloatArray


def normal_score(t: FloatArray, freedom: FloatArray) -> FloatArray:
    """Return the normal deviates that are as improbable as Student deviates of unit variance.

    A tail heavier than the normal one thus costs no false alarms. Wallace's approximation is small by less than 2 %
    from five degrees of freedom on.

    Parameters
    ----------
    t : deviations over their standard deviation
    freedom : degrees of freedom, > 2, broadcast against `t`

    References
    ----------
    Wallace, D. L. (1959). Bounds on normal approximations to Student's and the chi-square distributions. Annals of
    Mathematical Statistics 30, 1121-1130, eq. 2.
    """
    squared = t**2 * freedom / (freedom - 2) / freedom
    size = np.sqrt(freedom * np.log1p(squared)) * (8 * freedom + 1) / (8 * freedom + 3)
    return np.asarray(np.copysign(size, t))


def distance(deviation: FloatArray, covariance: FloatArray) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """Return the squared Mahalanobis distance of the modes that are there, and their number.

    Parameters
    ----------
    deviation : (..., n_tracks), NaN where a window lacks a mode
    covariance : (..., n_tracks, n_tracks)
    """
    seen = np.isfinite(deviation)
    both = seen[..., :, None] & seen[..., None, :]
    known = np.where(both, covariance, np.eye(deviation.shape[-1]))
    there = np.where(seen, deviation, 0.0)
    squared = (there * np.linalg.solve(known, there[..., None])[..., 0]).sum(-1)
    return squared, seen.sum(-1)
