"""What the monitor asks on every change, before it claims a mass: the diagnosis, with all that its windows know."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from monitor.beside import discrepancy_result
from monitor.diagnosing import THERMOMETER_STD
from monitor.discrepancy import ChannelHealth, DiscrepancyResult
from monitor.fusion import choose_tracks, common_tones
from monitor.lateness import InTime
from monitor.sensors_said import health_result
from monitor.window import Window
from oma import ChannelFault, ModalEstimate
from updater import (
    Circumstances,
    Explained,
    ModalDataError,
    ModalMean,
    PairingError,
    Reference,
    diagnose,
    matched_and_new,
    sensor_health,
    stack_tracks,
    tone_ratios,
    trend_of,
)

_LEAST_WINDOWS = 3  # from which modes that the baseline has not are looked for


@dataclass(frozen=True, eq=False, kw_only=True)
class Seen:
    """What goes with the modes of some windows."""

    temperature: FloatArray  #: (n_windows,) [degC], NaN where no device has a sensor
    rms: FloatArray  #: (n_windows,) of the acceleration, over all channels [m/s2]
    tones: FloatArray  #: (n_tones,) steady in most of the windows [Hz]
    left_out: Mapping[str, ChannelFault]  #: of channels that none of them gave shapes of


def seen_in(windows: Sequence[Window]) -> Seen:
    """Return what goes with the modes of windows."""
    there = {c for window in windows for c in window.estimate.channels}  # mended at worst
    return Seen(
        temperature=np.array([window.temperature for window in windows]),
        rms=np.array([window.rms for window in windows]),
        tones=common_tones([window.harmonics for window in windows]),
        left_out={c: fault for window in windows for c, fault in window.left_out.items() if c not in there},
    )


def explain_windows(
    reference: Reference, before: Seen, now: Seen, windows: InTime, tracks: Sequence[IndexArray]
) -> tuple[Explained, DiscrepancyResult | None]:
    """Diagnose what windows show since the baseline, delays beyond its own put back, and set them beside it.

    Parameters
    ----------
    reference : learnt from the baseline
    before, now : what went with the baseline's windows, and with these
    windows : modes of these, their devices' delays removed
    tracks : of each window (n_tracks,) indices into its modes in the order of the baseline's tracks, or -1

    Raises
    ------
    ValueError
        If fewer than three modes can be compared.
    """
    estimates = windows.estimates
    modes, heard = stack_tracks(estimates, tracks), windows.heard(reference.delays) or estimates
    measured, extra = _all_modes(reference, reference.mean_of(modes), estimates)
    there = {c for e in heard for c in e.channels}
    circumstances = Circumstances(
        warmer=_mean(now.temperature) - _mean(before.temperature),
        warmer_std=THERMOMETER_STD * 2**0.5,
        tones=tone_ratios(before.tones, now.tones),
        extra=extra,
        trend=trend_of(modes, now.rms, (reference.windows, before.rms)),
        devices=windows.devices,
        wander=windows.delays.wander,
        faults={c: f for c, f in now.left_out.items() if c not in there and c not in before.left_out},
    )
    event = reference.mean_of(stack_tracks(heard, tracks))
    found = diagnose(reference, event, circumstances=circumstances)
    try:
        beside = discrepancy_result(reference, measured, found).model_copy(update={"places": ()})  # the answer has them
    except (PairingError, ModalDataError):
        beside = None  # what can be compared is enough to diagnose, not to draw
    return found, beside


def sensors_seen(reference: Reference, windows: InTime, tracks: Sequence[IndexArray]) -> dict[str, ChannelHealth]:
    """Return how each channel fares in windows since the baseline; arguments as for `explain_windows`.

    Nothing, where there is too little in common with the baseline.
    """
    heard = windows.heard(reference.delays) or windows.estimates
    event = reference.mean_of(stack_tracks(heard, tracks))
    try:
        return health_result(
            sensor_health(reference, event, Circumstances(devices=windows.devices, wander=windows.delays.wander))
        )
    except ModalDataError:
        return {}


def _all_modes(
    reference: Reference, event: ModalMean, estimates: Sequence[ModalEstimate]
) -> tuple[ModalMean, ModalMean | None]:
    """Return an event's modes with those that the baseline has not, and these alone; none from too few windows."""
    if len(estimates) < _LEAST_WINDOWS:
        return event, None
    _, kept, tracks = choose_tracks(estimates)
    if not len(kept):
        return event, None
    every = reference.mean_of(stack_tracks(estimates, tracks))
    if every.channels != reference.baseline.channels:
        return event, None
    _, new = matched_and_new(reference, every)
    return (every, every.only(new)) if len(new) else (event, None)


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")
