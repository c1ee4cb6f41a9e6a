"""Error of expanded mode shapes where there is no sensor.

Each sensor in turn is left out of the expansion of the measured modes (eqs 9 to 12). The difference between its
measured component and the expanded one is the error at a place without a sensor.
"""

import numpy as np

from daq import FloatArray
from updater.reference import Reference, channel_rows, first_stage


def shape_error(reference: Reference) -> FloatArray:
    """Return the root mean square error (n_modes,) of a mode's shape over that of the shape, both at the sensors [-].

    For modes without a measured counterpart it is the median of the others.

    Parameters
    ----------
    reference : with measured shapes of at least 3 channels
    """
    baseline, paired = reference.baseline, reference.paired
    channels = baseline.channels
    rows = channel_rows(reference.model, channels)
    error = np.empty((len(paired), len(channels)))
    for i in range(len(channels)):
        others = np.delete(np.arange(len(channels)), i)
        modes = first_stage(
            reference.model, reference.calibration.modes, paired, baseline.at(tuple(channels[k] for k in others))
        )
        expanded, measured = (rows @ modes.shape[:, paired]).T, baseline.shape
        scale = (measured * expanded)[:, others].sum(1) / (measured[:, others] ** 2).sum(1)
        error[:, i] = expanded[:, i] - scale * measured[:, i]
    size = ((rows @ reference.shape[:, paired]) ** 2).sum(0)
    share = np.sqrt((error**2).sum(1) / size)
    every = np.full(len(reference.frequency), float(np.median(share)))
    every[paired] = share
    return every
