"""Event: the modes and circumstances of some windows, as a diagnosis compares them with a reference.

The live alarm and `diagnose` both use this function.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from oma import ChannelFault
from updater import Circumstances, ModalMean, Reference, stack_tracks
from updater.modal_data import Effort, SynchronizedWindows, is_steady, tone_ratios, trend_of
from updater.reference import matched_and_new, matched_surely

THERMOMETER_STD = 0.5  # K, of the mean of a log
_MIN_WINDOWS = 3  # in which new modes are looked for: in fewer, one may be an error of identification


@dataclass(frozen=True, eq=False, kw_only=True)
class Conditions:
    """Conditions during some windows, and results of identification other than modes."""

    temperature: FloatArray  #: (n_windows,) [degC], NaN where no device has a sensor
    rms: FloatArray  #: (n_windows,) of the acceleration, over all channels [m/s2]
    tones: FloatArray  #: (n_tones,) steady in most of the windows [Hz]
    left_out: Mapping[str, ChannelFault]  #: faults of the channels that are in no window's shapes


@dataclass(frozen=True, eq=False, kw_only=True)
class Event:
    """Event to be explained."""

    measured: ModalMean  #: (n_modes,) all modes of the windows
    modes: ModalMean  #: (n_tracks,) those that are surely paired with the reference's, delays beyond its own included
    circumstances: Circumstances


def event_of(
    reference: Reference,
    windows: SynchronizedWindows,
    tracks: Sequence[IndexArray],
    now: Conditions,
    before: Conditions | None,
) -> Event:
    """Return the modes of windows in the order of the baseline's, and their circumstances.

    Parameters
    ----------
    reference : of the structure before the change, or as in its file
    windows : modes of each window, the delays of their devices removed
    tracks : for each window (n_modes,) indices into its modes, or -1
    now, before : conditions in these windows, and in the baseline's if there are any
    """
    modes = stack_tracks(windows.estimates, tracks)
    measured = reference.mean_of(modes)
    delayed = windows.with_new_delays(reference.delays)
    late = reference.mean_of(stack_tracks(delayed, tracks)) if delayed else None
    found, new = matched_and_new(reference, measured)
    there = {channel for estimate in windows.estimates for channel in estimate.channels}
    hours = sum(estimate.end - estimate.start for estimate in windows.estimates) * 1e-9 / 3600
    known = {*there, *(before.left_out if before else ())}
    return Event(
        measured=measured,
        modes=matched_surely(reference, measured, late),
        circumstances=Circumstances(
            warmer=_mean(now.temperature) - _mean(before.temperature) if before else float("nan"),
            warmer_std=THERMOMETER_STD * 2**0.5,
            tones=tone_ratios(before.tones, now.tones) if before else np.empty(0),
            extra=measured.only(new) if len(new) and len(tracks) >= _MIN_WINDOWS else None,
            trend=trend_of(modes.tracks(found), now.rms, (reference.windows, before.rms) if before else None),
            devices=windows.devices,
            wander=windows.delays.wander,
            faults={channel: fault for channel, fault in now.left_out.items() if channel not in known},
            effort=Effort(record=hours) if hours else Effort(),
            steady=is_steady(modes, reference.scatter, now.rms, now.temperature),
        ),
    )


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")
