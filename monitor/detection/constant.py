"""Uncertainty of the law's constant: it grows with time and by accepted changes."""

from dataclasses import replace

import numpy as np

from daq import FloatArray
from monitor.detection.temperature_law import UNOBSERVED_STD, Law

_YEAR = 365.25 * 86400.0  # s, in which the constant wanders by `UNOBSERVED_STD`


def less_sure(law: Law, variance: FloatArray) -> Law:
    """Return a law with the same coefficients and additional variance of its constant (..., n_tracks), whitened."""
    common = law.common
    along = (common**2 * variance).sum(-1)
    unknown = law.unknown.copy()
    unknown[..., 0, 0, 0] += along
    unknown[..., 1, 0, 0] += (variance.sum(-1) - along) / max(variance.shape[-1] - 1, 1)
    information = np.asarray(np.linalg.inv(unknown), dtype=np.float64)
    alike = (law.coefficient @ common[..., :, None]) * common[..., None, :]
    moment = information[..., 0, :, :] @ alike + information[..., 1, :, :] @ (law.coefficient - alike)
    return replace(law, unknown=unknown, sums=replace(law.sums, information=information, moment=moment))


def wandered(law: Law, seconds: float) -> Law:
    """Return the law after a time in which its constant has wandered (random walk).

    Without that the constant is the mean over all windows since the baseline, and lags behind a slow drift by half of
    the movement since then.
    """
    return less_sure(law, seconds / _YEAR * (UNOBSERVED_STD / law.scale) ** 2)
