"""Tracked modes of simulated sites, without shapes."""

import numpy as np

from daq import FloatArray
from tests.examiner.sites import SiteWindows
from updater import TrackedModes


def tracked(log_frequency: FloatArray, std: FloatArray) -> TrackedModes:
    none = np.full((*log_frequency.shape, 1), np.nan)
    return TrackedModes(
        channels=("a",),
        log_frequency=log_frequency,
        log_frequency_std=std,
        damping=none[..., 0],
        damping_std=none[..., 0],
        shape=none,
        shape_std=none,
        imaginary=none,
    )


def modes_of(windows: SiteWindows, site: int) -> TrackedModes:
    return tracked(np.log(windows.frequency[site]), windows.frequency_std[site] / windows.frequency[site])
