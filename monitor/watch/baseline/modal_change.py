"""Change of the measured modes since the baseline, stated without a model.

References
----------
Satterthwaite, F. E. (1946). An approximate distribution of estimates of variance components. Biometrics Bulletin 2(6),
110-114: chi-square of a shape whose components' errors are correlated.
"""

from collections.abc import Sequence
from typing import get_args

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray
from monitor.analysis.window import Window
from monitor.results.windows import ModalChange, ModalQuantity, ModeChange
from monitor.watch.baseline.learned_baseline import LearnedBaseline
from oma import mac_matrix
from updater import ModalMean

_CHANCE = 0.01  # probability that anything is stated to have changed where nothing has: of all modes together
_QUANTITIES: tuple[ModalQuantity, ...] = get_args(ModalQuantity)


def modal_change(learned: LearnedBaseline, windows: Sequence[Window]) -> ModalChange:
    """Compare the modes of windows with those of the baseline.

    Frequencies are compared with those that the detectors expect at the temperature of the windows, damping and shapes
    with their means in the baseline. A quantity has changed if its deviation is larger than chance makes any of them in
    one of 100 unchanged structures.

    Parameters
    ----------
    learned : baseline by which the change was found
    windows : the last ones, all above the limit
    """
    base, event = learned.modes.mean, learned.mean_of(windows)
    shift = learned.detector.shift(len(windows))
    moved, std = shift.log_frequency[learned.watched], shift.std[learned.watched]
    damping, damping_std = event.damping - base.damping, np.hypot(event.damping_std, base.damping_std)
    mac, p_shape = _shapes(base, event, learned.modes.scatter.shape_overdispersion)
    p_values = np.array(
        [2 * scipy.stats.norm.sf(np.abs(moved / std)), 2 * scipy.stats.norm.sf(np.abs(damping / damping_std)), p_shape]
    )
    changed = p_values < _CHANCE / max(1, np.isfinite(p_values).sum())
    return ModalChange(
        n_windows=len(windows),
        modes=[
            ModeChange(
                id=int(learned.watched[k]) + 1,
                frequency=float(np.exp(base.log_frequency[k])),
                shift_percent=float(100 * np.expm1(moved[k])),
                shift_std_percent=float(100 * std[k]),
                damping=float(base.damping[k]),
                damping_shift=float(damping[k]),
                damping_shift_std=float(damping_std[k]),
                mac=float(mac[k]),
                changed=[name for name, over in zip(_QUANTITIES, changed[:, k], strict=True) if over],
            )
            for k in range(len(moved))
        ],
    )


def _shapes(base: ModalMean, event: ModalMean, overdispersion: float) -> tuple[FloatArray, FloatArray]:
    """Return MAC and probability of a larger deviation by chance (n_tracks,); NaN where shapes are not measured.

    Parameters
    ----------
    overdispersion : number of correlated components of a shape's error (see `Scatter`)
    """
    common = tuple(channel for channel in base.channels if channel in event.channels)
    if len(common) < 2:  # a single channel has no shape
        unknown = np.full(len(base.log_frequency), np.nan)
        return unknown, unknown
    before, now = base.at(common), event.at(common)
    sign = np.sign(np.sum(before.shape * now.shape, axis=1, keepdims=True))
    variance = before.shape_std**2 + now.shape_std**2
    measured = (variance > 0).all(1)
    squares = ((sign * now.shape - before.shape) ** 2 / np.where(variance > 0, variance, np.nan)).sum(1)
    freedom = (len(common) - 1) / overdispersion
    p_value = np.where(measured, scipy.stats.chi2.sf(squares / overdispersion, freedom), np.nan)
    return np.where(measured, np.diag(mac_matrix(before.shape, now.shape)), np.nan), p_value
