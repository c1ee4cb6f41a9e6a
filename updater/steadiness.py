"""Whether windows are of one state: something that slides, thaws or works loose while it is recorded has no mean."""

import numpy as np

from daq import FloatArray
from updater.statistics import Scatter, TrackedModes

_FAR = 3.0  # standard deviations from the median of the windows
_LARGEST_FACTOR = 3.0  # of real over stated deviations: where the same windows taught it, a slide did
_MOST_FAR = 0.25  # of all modes in all windows: identification itself errs grossly in a few per cent


def far_share(windows: TrackedModes, scatter: Scatter, *regressors: FloatArray) -> float:
    """Return the share of modes in windows whose log frequency lies over 3 deviations from its window median.

    By counts, not by squares, so that a few modes that were identified wrongly do not count as a change.

    Parameters
    ----------
    windows : (n_windows, n_tracks) of the event
    scatter : of windows while nothing changes
    regressors : (n_windows,) temperature or amplitude, whose linear effect on each mode is no change of state; ignored
        where one is not known in every window
    """
    n = len(windows.log_frequency)
    known = [r for r in regressors if np.isfinite(r).all() and np.ptp(r) > 0]
    design = np.column_stack([np.ones(n), *((r - r.mean()) / np.ptp(r) for r in known)])
    factor = min(scatter.frequency_factor, _LARGEST_FACTOR)
    far = seen = 0
    for value, std in zip(windows.log_frequency.T, windows.log_frequency_std.T, strict=True):
        here = np.isfinite(value)
        if here.sum() < design.shape[1] + 2:
            continue
        slope = np.linalg.lstsq(design[here], value[here], rcond=None)[0]
        rest = value[here] - design[here, 1:] @ slope[1:]
        z = (rest - np.median(rest)) / (factor * std[here])
        far += int((np.abs(z) > _FAR).sum())
        seen += int(here.sum())
    return far / seen if seen else 0.0


def is_steady(windows: TrackedModes, scatter: Scatter, *regressors: FloatArray) -> bool:
    """Tell whether windows scatter as those of one state do; parameters as for `far_share`."""
    return far_share(windows, scatter, *regressors) <= _MOST_FAR
