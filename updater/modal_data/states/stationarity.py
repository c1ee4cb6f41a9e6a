"""Test that windows are of one state: a structure that changes during the record has no mean."""

import numpy as np

from daq import FloatArray
from updater.modal_data.scatter import Scatter
from updater.modal_data.tracked import TrackedModes

_FAR = 3.0  # standard deviations from the median of the windows
_LARGEST_FACTOR = 3.0  # of real over stated deviations: where the same windows taught it, a slide did
_MAX_SOFTENING = 0.1  # ln f over the rms relative to its mean: a multiple of the softening of buildings in earthquakes
_MAX_WARMING = 4e-3  # of ln f a kelvin: ten times steel's, for asphalt that stiffens and bearings that jam
_MAX_FAR = 0.25  # of all modes in all windows: identification itself errs grossly in a few per cent


def far_share(windows: TrackedModes, scatter: Scatter, rms: FloatArray, temperature: FloatArray) -> float:
    """Return the share of modes in windows whose log frequency lies over 3 deviations from its window median.

    By counts, not by squares, so that a few wrongly identified modes do not count as a change. Changes with amplitude
    or temperature are not changes of state, within limits: in a few windows any drift correlates with something.

    Parameters
    ----------
    windows : (n_windows, n_tracks) of the event
    scatter : of windows while nothing changes
    rms : (n_windows,) [m/s2]
    temperature : (n_windows,) [degC]; ignored, as rms, where it is not known in every window
    """
    n = len(windows.log_frequency)
    known = [
        ((values - values.mean()) / np.ptp(values), most * np.ptp(values))
        for values, most in ((rms / np.mean(rms), _MAX_SOFTENING), (temperature, _MAX_WARMING))
        if np.isfinite(values).all() and np.ptp(values) > 0
    ]
    design = np.column_stack([np.ones(n), *(values for values, _ in known)])
    most = np.array([limit for _, limit in known])
    factor = min(scatter.frequency_factor, _LARGEST_FACTOR)
    far = seen = 0
    for value, std in zip(windows.log_frequency.T, windows.log_frequency_std.T, strict=True):
        here = np.isfinite(value)
        if here.sum() < design.shape[1] + 2:
            continue
        slope = np.clip(np.linalg.lstsq(design[here], value[here], rcond=None)[0][1:], -most, most)
        rest = value[here] - design[here, 1:] @ slope
        z = (rest - np.median(rest)) / (factor * std[here])
        far += int((np.abs(z) > _FAR).sum())
        seen += int(here.sum())
    return far / seen if seen else 0.0


def is_steady(windows: TrackedModes, scatter: Scatter, rms: FloatArray, temperature: FloatArray) -> bool:
    """Return whether windows scatter like those of one state.

    Parameters
    ----------
    windows : (n_windows, n_tracks)
    scatter : factors on the stated standard deviations
    rms : (n_windows,) of the acceleration [m/s2]
    temperature : (n_windows,) [degC]
    """
    return far_share(windows, scatter, rms, temperature) <= _MAX_FAR
