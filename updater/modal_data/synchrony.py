"""Channels that are not synchronous, from the phases of identified modes."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from daq import FloatArray, Recording
from oma import ModalEstimate, mpc
from oma.spectral import channel_delays
from updater.modal_data.device_delays import estimate_delays, remove_delays

LOW_MPC = 0.7  #: modal phase collinearity below which a shape is marked [-]
_MIN_MODES = 4  # for delays that leave something to check them by
_SIGMAS = 4.0  # of a delay that is reported
_MIN_DELAY_SECONDS = 5e-5
_MIN_MPC_GAIN = 0.02  # of the median: delays that explain less are those of channels that share hardly a mode
_BIAS_SECONDS = 1.5e-5  # between channels that hardly move in the same modes, whatever the scatter of the modes


@dataclass(frozen=True, kw_only=True)
class Asynchrony:
    """Delays of channels that explain why shapes are not real."""

    delays: Mapping[str, tuple[float, float]]
    """Channel -> delay against the median channel and its standard deviation, of those that differ from it [s]."""
    mpc: float  #: median of the modes as measured [-]
    mpc_synchronous: float  #: the same with delays removed, for each mode by the delays of the other modes [-]


def asynchrony(recording: Recording, estimate: ModalEstimate) -> Asynchrony | None:
    """Return the channels' delays if modes show any; None if shapes are real enough or no delays explain them.

    Delays are sought in the cross spectra (`oma.spectral.channel_delays`), each channel by itself, and then fitted
    to the phases of the modes. Their standard deviations come from leaving out one mode after the other (Efron 1982:
    jackknife), and they count only if they make the modes left out real.

    Parameters
    ----------
    recording : one window
    estimate : its modes, or their mean over windows
    """
    before = mpc(estimate.shape)
    if estimate.n_modes < _MIN_MODES or len(estimate.channels) < 3 or not (before < LOW_MPC).any():
        return None
    found = channel_delays(recording)
    start = np.array([found.get(channel, 0.0) for channel in estimate.channels])
    delay = _fitted(estimate, start)
    without, after = [], []
    for i in range(estimate.n_modes):
        left = np.arange(estimate.n_modes) == i
        fitted = _fitted(estimate[~left], start)
        without.append(fitted)
        after.append(float(mpc(_without(estimate[left], fitted).shape)[0]))
    n = estimate.n_modes
    variance = (n - 1) / n * np.sum((np.array(without) - np.mean(without, axis=0)) ** 2, axis=0)
    std = np.hypot(np.sqrt(variance), _BIAS_SECONDS)
    late = {
        name: (float(value), float(error))
        for name, value, error in zip(estimate.channels, delay, std, strict=True)
        if abs(value) > max(_SIGMAS * error, _MIN_DELAY_SECONDS)
    }
    if not late or np.median(after) < max(LOW_MPC, float(np.median(before)) + _MIN_MPC_GAIN):
        return None
    return Asynchrony(delays=late, mpc=float(np.median(before)), mpc_synchronous=float(np.median(after)))


def _fitted(estimate: ModalEstimate, start: FloatArray) -> FloatArray:
    """Return the delays near `start` that make shapes most real, against the median channel (n_channels,) [s]."""
    each = {channel: channel for channel in estimate.channels}
    rest = estimate_delays(_without(estimate, start), each)
    delay = start + [rest[channel] for channel in estimate.channels]
    return np.asarray(delay - np.sort(delay)[(len(delay) - 1) // 2])


def _without(estimate: ModalEstimate, delay: FloatArray) -> ModalEstimate:
    """Return the estimate without delays of its channels."""
    each = {channel: channel for channel in estimate.channels}
    return remove_delays(estimate, each, dict(zip(estimate.channels, delay.tolist(), strict=True)))
