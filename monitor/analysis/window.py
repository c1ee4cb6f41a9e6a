"""Identified window, reduced to the part that is saved for a restart."""

from collections.abc import Mapping
from dataclasses import dataclass

from daq import FloatArray, Recording
from monitor.analysis.observation import root_mean_square
from oma import ChannelFault, Identification, ModalEstimate
from updater import estimate_delays, remove_delays
from updater.modal_data import DeviceDelays, without_known


@dataclass(frozen=True, eq=False, kw_only=True)
class Window:
    """One window's modes and circumstances; its signals are in the log only."""

    index: int  #: counted from 0, over restarts
    start: int  #: [ns UTC]
    end: int  #: [ns UTC]
    temperature: float  #: mean over the devices [degC], NaN if none has a sensor
    rms: float  #: rms of the acceleration, over all channels [m/s2]
    harmonics: FloatArray  #: (n_harmonics,) tones [Hz]
    left_out: Mapping[str, ChannelFault]  #: channels that are not in the estimate
    estimate: ModalEstimate  #: modes as identified, with known delays of channels removed
    delays: Mapping[str, float]  #: device -> taken out of `estimate` [s]
    synchronized: ModalEstimate  #: the same with known delays of the devices removed
    removed: Mapping[str, float]  #: device -> total delay removed [s]


def window_of(
    index: int,
    recording: Recording,
    found: Identification,
    devices: Mapping[str, str],
    late: Mapping[str, float],
    known: DeviceDelays,
) -> Window:
    """Return the part of a window that is kept.

    Parameters
    ----------
    index : its number
    recording, found : its signals, and their identification
    devices : of each channel
    late : channel -> known delay, of the structure file [s]
    known : delays of the devices that the baseline has shown
    """
    estimate, seen = without_known(found.estimate, found.delays, devices, late)
    tau = estimate_delays(estimate, devices, known.beyond(seen))
    return Window(
        index=index,
        start=recording.start,
        end=recording.end,
        temperature=float(recording.temperature),
        rms=root_mean_square(recording),
        harmonics=found.harmonics,
        left_out=found.left_out,
        estimate=estimate,
        delays=dict(seen),
        synchronized=remove_delays(estimate, devices, tau),
        removed={device: seen[device] + t for device, t in tau.items()},
    )
