"""Windows of measured modes of the frames with a block at the joint, and the errors of a file's modes."""

from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from daq import FloatArray
from monitor.analysis.observation import Observation, follow
from oma import WindowQuality
from oma.windows import Windows
from tests.support.portals.block_specimens import Specimen
from tests.support.updater.frames import noisy_estimates
from updater import Structure, build_model

SECONDS, START = 100.0, 1_767_225_600_000_000_000
FREQUENCY_STD, SHAPE_STD = 2e-3, 0.02  #: of a window: relative, and of unit norm


def measured_modes(
    specimen: Specimen,
    frequency: FloatArray,
    shape: FloatArray,
    random: np.random.Generator,
    *,
    first: int = 0,
    n: int = 5,
    better: float = 1.0,
) -> Observation:
    """Return windows of modes (n_modes,) [Hz] and (n_modes, n_channels).

    Parameters
    ----------
    first, n : number of the first window, and number of windows
    better : factor on the standard deviations of the errors
    """
    channels, std = specimen.file.channels, better * FREQUENCY_STD
    exact = noisy_estimates(frequency, shape, channels, n, random, std=std, shape_std=better * SHAPE_STD)
    starts = [START + round((first + k) * SECONDS * 1e9) for k in range(n)]
    estimates = tuple(
        replace(one, frequency_std=std * frequency, start=start, end=start + round(SECONDS * 1e9))
        for one, start in zip(exact, starts, strict=True)
    )
    windows = Windows(
        estimates=estimates,
        harmonics=np.empty(0),
        channels=dict.fromkeys(channels, "ok"),
        quality=(WindowQuality(complete=1.0, rms_variation=0.0, cycles=1000.0),) * n,
        problems=(),
        start=estimates[0].start,
        end=estimates[-1].end,
        rate=1000.0,
    )
    return follow(windows, dict.fromkeys(channels, "daq"), [(e.start, float("nan"), 0.01) for e in estimates])


def prediction_errors(structure: Structure, frequency: FloatArray, shape: FloatArray) -> FloatArray:
    """Return the errors (n_modes,) [%] of a structure's frequencies, paired by shape and frequency."""
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = model.modes(40)
    own = (model.sensor_rows @ modes.shape).T
    size = np.linalg.norm(own, axis=1)
    seen = size > 1e-3 * size.max()
    mac = (shape @ (own[seen] / size[seen, None]).T) ** 2
    apart = np.log(modes.frequency[seen] / frequency[:, None])
    measured, paired = linear_sum_assignment(1 - mac + 2 * np.abs(apart))
    return np.asarray(100 * apart[measured, paired])
