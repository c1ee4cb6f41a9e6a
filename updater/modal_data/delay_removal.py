"""Delays of devices and channels: found in phases of modes, removed window by window, restored where they are news.

Shapes are compared as if all devices were synchronous, so that variations of a clock do not disturb them. The total
delay of a device is stored with them: minus its earlier delay, it is evidence.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from daq import FloatArray, Recording
from oma import ModalEstimate, mpc
from oma.spectral import channel_delays
from updater.modal_data.device_delays import NO_DELAYS, DeviceDelays, estimate_delays, learn_delays, remove_delays

Delays = Mapping[str, float]
_NEWS = 3.0  # times the uncertainty of a device's delay, above which a delay is new
LOW_MPC = 0.7  #: modal phase collinearity below which a shape is marked [-]
_MIN_MODES = 4  # for delays that leave something to check them by
_SIGMAS = 4.0  # of a delay that is reported
_MIN_DELAY_SECONDS = 5e-5
_MIN_MPC_GAIN = 0.02  # of the median: delays that explain less are those of channels that share hardly a mode
_BIAS_SECONDS = 1.5e-5  # between channels that hardly move in the same modes, whatever the scatter of the modes


@dataclass(frozen=True, eq=False)
class SynchronizedWindows:
    """Windows without their devices' delays."""

    estimates: tuple[ModalEstimate, ...]
    devices: Mapping[str, str] = field(default_factory=dict)  #: device of each channel
    removed: tuple[Delays, ...] = ()  #: per window: device -> total delay removed from it [s]
    delays: DeviceDelays = NO_DELAYS  #: common total delays of the windows

    def with_new_delays(self, known: DeviceDelays) -> tuple[ModalEstimate, ...] | None:
        """Return the windows with the delays beyond known constants; None if there are none.

        The mean over the windows is put back, not each window's wander about it; and only where that wander does not
        explain it for every device: the noise of a host's clock is no evidence, but would spoil the shapes.
        """
        news, astray = self._beyond(known), known.astray(self.delays.wander)
        if all(abs(late) <= _NEWS * astray[device] for device, late in news.items()):
            return None
        back = dict.fromkeys(self.devices.values(), 0.0) | {d: -late for d, late in news.items()}
        return tuple(remove_delays(e, self.devices, back) for e in self.estimates)

    def _beyond(self, known: DeviceDelays) -> dict[str, float]:
        """Return the delay of each device beyond its constant [s], the mean over the windows."""
        common = [d for d in known.seconds if self.removed and all(d in window for window in self.removed)]
        mean = {d: float(np.mean([window[d] for window in self.removed])) for d in common}
        return {d: late - known.seconds[d] for d, late in mean.items()}


NOTHING_REMOVED = SynchronizedWindows(())


def remove_device_delays(
    estimates: Sequence[ModalEstimate], removed: Sequence[Delays], devices: Mapping[str, str]
) -> SynchronizedWindows:
    """Take devices' delays out of the windows of one state.

    Parameters
    ----------
    estimates, removed : per window: modes, and device -> delay removed from them already [s]
    devices : of each channel
    """
    shared = learn_delays(estimates, devices, removed)
    late = [estimate_delays(e, devices, shared.beyond(r)) for e, r in zip(estimates, removed, strict=True)]
    return SynchronizedWindows(
        estimates=tuple(remove_delays(e, devices, tau) for e, tau in zip(estimates, late, strict=True)),
        devices=devices,
        removed=tuple({d: r.get(d, 0.0) + tau[d] for d in tau} for r, tau in zip(removed, late, strict=True)),
        delays=shared,
    )


def without_known(
    estimate: ModalEstimate, removed: Delays, devices: Mapping[str, str], late: Delays
) -> tuple[ModalEstimate, Delays]:
    """Return a window's modes, and the delays removed from them, as if known delays of channels were zero.

    Parameters
    ----------
    removed : device -> taken out of the modes already [s]
    devices : of each channel
    late : channel -> known delay, of the structure file [s]
    """
    if not any(late.values()):
        return estimate, removed
    members = {d: [c for c in estimate.channels if devices[c] == d] for d in sorted(set(devices.values()))}
    common = {d: float(np.mean([late.get(c, 0.0) for c in names])) if names else 0.0 for d, names in members.items()}
    rest = {c: late.get(c, 0.0) - common[devices[c]] for c in estimate.channels}
    own = remove_delays(estimate, {c: c for c in estimate.channels}, rest)
    return own, {d: removed.get(d, 0.0) - common[d] for d in common}


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
