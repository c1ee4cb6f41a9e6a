"""Measured modes that the baseline lacks and the model has: data for the parameters of causes that are found.

A change may excite a mode that was not measured before, such as a twist that an eccentric body couples to bending.
Until the causes are known, its counterpart in the model is unknown. Its frequency is then compared with the model's
own, whose error counts.
"""

import numpy as np

from daq import IndexArray
from oma import mac_matrix
from updater.causes import SelectedCause, effect_of
from updater.inference import Comparison, reanalyse
from updater.modal_data import ModalMean
from updater.reference import FREQUENCY_STD

_NEAR = 0.03  # ln f between measured and predicted modes
_ALIKE = 0.8  # MAC, likewise


def with_further_modes(
    data: Comparison, event: ModalMean, every: ModalMean, chosen: tuple[SelectedCause, ...]
) -> Comparison:
    """Return data with the measured modes that the baseline lacks and the model has, once causes act on it.

    Parameters
    ----------
    data : the event compared with the baseline
    event : (n_tracks,) in the order of the baseline's tracks
    every : (n_modes,) all modes measured, in any order
    chosen : causes that are found
    """
    if data.circumstances.trend is not None or not np.isfinite(every.shape).all():
        return data
    others = every.only(np.flatnonzero(~np.isin(every.log_frequency, event.log_frequency)))
    measured, modes = _answers(data, chosen, others.at(data.channels))
    if not len(measured):
        return data
    log_ratio = others.log_frequency[measured] - np.log(data.frequency[modes])
    return data.with_frequencies(modes, log_ratio, np.hypot(others.log_frequency_std[measured], FREQUENCY_STD))


def _answers(data: Comparison, chosen: tuple[SelectedCause, ...], others: ModalMean) -> tuple[IndexArray, IndexArray]:
    """Return modes measured (n,) and the modes of the reference (n,) that have become these by the causes."""
    changed = reanalyse(data, effect_of(chosen))
    value, vector, weighed = changed.value[0], changed.vector[0], changed.weighed[0]
    n_modes = len(data.frequency)
    log_frequency = -0.5 * np.log(value) - np.log(2 * np.pi)
    mac = mac_matrix(others.shape, (data.at_channels @ vector[:n_modes]).T)
    alike = (mac > _ALIKE) & (np.abs(others.log_frequency[:, None] - log_frequency) < _NEAR)
    alike[:, changed.pick[0]] = False
    found = np.argmax(np.where(alike, mac, -1.0), axis=1)
    measured = np.flatnonzero(alike.any(1))
    modes = np.argmax((vector * weighed)[:n_modes, found[measured]], axis=0)
    fresh = ~np.isin(modes, data.paired) & (np.bincount(modes, minlength=n_modes)[modes] == 1)
    return measured[fresh], modes[fresh]
