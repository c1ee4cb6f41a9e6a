"""What a watch says of windows since a change: increments, a diagnosis, and a mass where that is all it is."""

from collections.abc import Mapping, Sequence
from typing import Any

from monitor.describe import increment_result, mass_answer
from monitor.discrepancy import ChannelHealth
from monitor.explaining import conditions_of, explain_windows, sensors_seen
from monitor.lateness import InTime
from monitor.learning import Watch
from monitor.results import MassIncrements
from monitor.window import Window
from monitor.words import is_one_mass
from updater import ModalDataError, ModalMean, PairingError, Structure, locate_and_sharpen, stack_tracks


def in_time_of(windows: Sequence[Window], devices: Mapping[str, str]) -> InTime:
    """Return windows with what their devices (of each channel) were late by."""
    return InTime(tuple(w.in_time for w in windows), devices, tuple(w.removed for w in windows))


def answer(watch: Watch, pure: Sequence[Window], devices: Mapping[str, str], structure: Structure) -> dict[str, Any]:
    """Return the fields of a `WindowResult` that explain a change; none without windows.

    A mass is claimed only where the diagnosis says that one mass, and nothing else, explains them.

    Parameters
    ----------
    watch : by which the change was found
    pure : windows over the limit that begin after the first one: that one may hold both states
    devices : of each channel
    structure : of the site
    """
    if not pure:
        return {}
    tracks = [watch.modes_of(window.in_time) for window in pure]
    event = watch.reference.mean_of(stack_tracks([w.in_time for w in pure], tracks))
    found: dict[str, Any] = {"increments": _increments(watch, event, len(pure))}
    now, lateness = conditions_of(pure), in_time_of(pure, devices)
    try:
        explained, beside = explain_windows(watch.reference, watch.before, now, lateness)
    except ModalDataError:
        return found  # fewer than three modes left to compare: there is an alarm, but no cause
    found |= {"diagnosis": explained.diagnosis, "discrepancy": beside}
    if is_one_mass(explained.diagnosis):
        change, outlook = locate_and_sharpen(watch.reference, event)
        found["answer"] = mass_answer(structure, change, len(pure), outlook.said)
    return found


def sensors(watch: Watch, calm: Sequence[Window], devices: Mapping[str, str]) -> dict[str, ChannelHealth]:
    """Return how each channel fares in calm windows; of one that died among them a window holds half."""
    tracks = [watch.modes_of(window.in_time) for window in calm]
    found = sensors_seen(watch.reference, in_time_of(calm, devices), tracks)
    return {channel: health for channel, health in found.items() if channel in calm[-1].in_time.channels}


def _increments(watch: Watch, event: ModalMean, n_windows: int) -> MassIncrements | None:
    try:
        return increment_result(watch.updater.update(event), n_windows)
    except (PairingError, ModalDataError):
        return None  # no modes left to compare, or a channel is missing: there is an alarm, but no increments
