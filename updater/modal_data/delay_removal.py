"""Delays of devices and channels: removed from modes window by window, restored where they are news.

Shapes are compared as if all devices were synchronous, so that variations of a clock do not disturb them. The total
delay of a device is stored with them: minus its earlier delay, it is evidence.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from oma import ModalEstimate
from updater.modal_data.device_delays import NO_DELAYS, DeviceDelays, estimate_delays, learn_delays, remove_delays

Delays = Mapping[str, float]
_NEWS = 3.0  # times the uncertainty of a device's delay, above which a delay is new


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
        mean = {d: float(np.mean([r[d] for r in self.removed])) for d in known.seconds if self._has(d)}
        return {d: late - known.seconds[d] for d, late in mean.items()}

    def _has(self, device: str) -> bool:
        return bool(self.removed) and all(device in window for window in self.removed)


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
