"""Diagnosis of the windows of a running monitor."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from daq import IndexArray
from monitor.analysis.event import Conditions, Event, event_of
from monitor.analysis.explanation import with_breathing
from monitor.analysis.window import Window
from monitor.results.comparison import ChannelHealth, DiscrepancyResult
from monitor.results.correlation import discrepancy_result
from monitor.text.sensors import health_result
from oma.windows import common_tones
from updater import (
    Circumstances,
    DiagnosisResult,
    ModalDataError,
    PairingError,
    Reference,
    diagnose,
    sensor_health,
    stack_tracks,
)
from updater.modal_data import Signals, SynchronizedWindows, choose_tracks


def conditions_of(windows: Sequence[Window]) -> Conditions:
    """Return the conditions in windows of the monitor."""
    there = {c for window in windows for c in window.estimate.channels}  # repaired at worst
    return Conditions(
        temperature=np.array([window.temperature for window in windows]),
        rms=np.array([window.rms for window in windows]),
        tones=common_tones([window.harmonics for window in windows]),
        left_out={c: fault for window in windows for c, fault in window.left_out.items() if c not in there},
    )


def explain_windows(
    reference: Reference,
    before: Conditions,
    now: Conditions,
    windows: SynchronizedWindows,
    signals: Signals | None = None,
) -> tuple[DiagnosisResult, Event]:
    """Diagnose windows since the baseline; return the diagnosis and the event that was diagnosed.

    Parameters
    ----------
    reference : learned from the baseline
    before, now : conditions in the baseline's windows, and in these
    windows : modes of these, their devices' delays removed
    signals : of a window of the baseline's state, and of the last of these

    Raises
    ------
    ModalDataError
        If fewer than three modes can be compared.
    """
    _, kept, tracks = choose_tracks(windows.estimates)
    if not len(kept):
        raise ModalDataError("no mode is in most of the windows")
    event = event_of(reference, windows, tracks, now, before)
    event = replace(event, circumstances=replace(event.circumstances, signals=signals))
    found = diagnose(reference, event.modes, every=event.measured, circumstances=event.circumstances)
    if signals:
        found = with_breathing(found, reference, event.modes, signals)
    return found, event


def compare_windows(reference: Reference, event: Event, explained: DiagnosisResult) -> DiscrepancyResult | None:
    """Compare the measured modes of a diagnosed event with simulated ones; None where too little can be compared."""
    try:
        compared = discrepancy_result(reference, event.measured, explained)
    except (PairingError, ModalDataError):
        return None  # enough to diagnose, not to draw
    return compared.model_copy(update={"places": ()})  # the answer has them


def sensors_seen(
    reference: Reference, windows: SynchronizedWindows, tracks: Sequence[IndexArray]
) -> dict[str, ChannelHealth]:
    """Return gain, polarity and delay of each channel in windows since the baseline; empty where too little is common.

    Parameters
    ----------
    windows : as for `explain_windows`
    tracks : for each window (n_tracks,) indices into its modes in the order of the baseline's tracks, or -1
    """
    delayed = windows.with_new_delays(reference.delays) or windows.estimates
    event = reference.mean_of(stack_tracks(delayed, tracks))
    try:
        return health_result(
            sensor_health(reference, event, Circumstances(devices=windows.devices, wander=windows.delays.wander))
        )
    except ModalDataError:
        return {}
