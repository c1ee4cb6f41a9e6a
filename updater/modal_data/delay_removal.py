"""Delays of devices and channels: removed from modes window by window, restored where they are news.

Shapes are compared as if all devices were in time, so that a clock's wander spoils none. What a device was late by in
all is kept beside them: less what it was late by before, it is evidence.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from oma import ModalEstimate
from updater.modal_data.device_delays import NO_DELAYS, DeviceDelays, estimate_delays, learn_delays, remove_delays

Delays = Mapping[str, float]
_NEWS = 3.0  # times what is not known of a device's delay, from where on it is news


@dataclass(frozen=True, eq=False)
class SynchronizedWindows:
    """Windows without their devices' delays."""

    estimates: tuple[ModalEstimate, ...]
    devices: Mapping[str, str] = field(default_factory=dict)  #: of each channel
    removed: tuple[Delays, ...] = ()  #: of each window: device -> taken out of it in all [s]
    delays: DeviceDelays = NO_DELAYS  #: in all, that the windows share

    def heard(self, known: DeviceDelays) -> tuple[ModalEstimate, ...] | None:
        """Return the windows with what devices are late by beyond known constants; None if none of them is.

        The mean over the windows is put back, not each window's wander about it; and only where that wander does not
        explain it for every device: the noise of a host's clock is no evidence, but would spoil the shapes.
        """
        news, astray = self._beyond(known), known.astray(self.delays.wander)
        if all(abs(late) <= _NEWS * astray[device] for device, late in news.items()):
            return None
        back = dict.fromkeys(self.devices.values(), 0.0) | {d: -late for d, late in news.items()}
        return tuple(remove_delays(e, self.devices, back) for e in self.estimates)

    def _beyond(self, known: DeviceDelays) -> dict[str, float]:
        """Return what each device is late by beyond its constant [s], the mean over the windows."""
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
    estimates, removed : of each window: modes, and device -> what has been taken out of them already [s]
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
    """Return a window's modes, and what has been removed from them, as if known delays of channels were none.

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
