"""How late devices and channels are: taken out of modes window by window, put back where it is news.

Shapes are compared as if all devices were in time, so that a clock's wander spoils none. What a device was late by in
all is kept beside them: less what it was late by before, it is evidence.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from oma import ModalEstimate
from updater import NO_DELAYS, DeviceDelays, estimate_delays, learn_delays, remove_delays

Delays = Mapping[str, float]


@dataclass(frozen=True, eq=False)
class InTime:
    """Windows without their devices' delays."""

    estimates: tuple[ModalEstimate, ...]
    devices: Mapping[str, str] = field(default_factory=dict)  #: of each channel
    removed: tuple[Delays, ...] = ()  #: of each window: device -> taken out of it in all [s]
    delays: DeviceDelays = NO_DELAYS  #: in all, that the windows share

    def heard(self, known: DeviceDelays) -> tuple[ModalEstimate, ...] | None:
        """Return the windows with what devices are late by beyond known constants; None if none of these is known.

        The mean over the windows is put back, not each window's wander about it.
        """
        news = {
            d: float(np.mean([r[d] for r in self.removed])) - late for d, late in known.seconds.items() if self._has(d)
        }
        if not news:
            return None
        back = dict.fromkeys(self.devices.values(), 0.0) | {d: -late for d, late in news.items()}
        return tuple(remove_delays(e, self.devices, back) for e in self.estimates)

    def _has(self, device: str) -> bool:
        return bool(self.removed) and all(device in window for window in self.removed)


NOT_LATE = InTime(())


def in_time(estimates: Sequence[ModalEstimate], removed: Sequence[Delays], devices: Mapping[str, str]) -> InTime:
    """Take devices' delays out of the windows of one state.

    Identification has removed what it saw of them in each window; here all windows lose the same first, the median.

    Parameters
    ----------
    estimates, removed : of each window: modes, and device -> what has been taken out of them already [s]
    devices : of each channel
    """
    typical = {d: float(np.median([r.get(d, 0.0) for r in removed])) for d in sorted(set(devices.values()))}
    alike = [
        remove_delays(e, devices, {d: late - r.get(d, 0.0) for d, late in typical.items()})
        for e, r in zip(estimates, removed, strict=True)
    ]
    shared = learn_delays(alike, devices)
    late = [estimate_delays(e, devices, shared) for e in alike]
    return InTime(
        estimates=tuple(remove_delays(e, devices, tau) for e, tau in zip(alike, late, strict=True)),
        devices=devices,
        removed=tuple({d: typical[d] + seconds for d, seconds in tau.items()} for tau in late),
        delays=shared.beyond({d: -late for d, late in typical.items()}),
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
