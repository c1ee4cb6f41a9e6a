"""Results for the windows since a change: increments, a diagnosis, and a mass where that is the only cause."""

from collections.abc import Sequence
from typing import Any

from monitor.analysis.event import Event
from monitor.analysis.window import Window, synchronized_windows
from monitor.optional import OptionalWork
from monitor.results.comparison import ChannelHealth
from monitor.results.convert import increment_result, mass_answer
from monitor.results.windows import MassAnswer, MassIncrements
from monitor.text.causes import failed_text, forecast_text
from monitor.text.diagnosis import diagnosis_answer
from monitor.text.verdicts import is_one_mass
from monitor.watch.baseline.learned_baseline import LearnedBaseline, LearnedModel
from monitor.watch.baseline.modal_change import modal_change
from monitor.watch.explanation import compare_windows, conditions_of, explain_windows, sensors_seen
from updater import (
    DiagnosisResult,
    ModalDataError,
    ModalMean,
    PairingError,
    Reference,
    Structure,
    locate_mass_with_forecast,
)
from updater.modal_data import Signals


def answer(
    learned: LearnedBaseline,
    changed_windows: Sequence[Window],
    structure: Structure | None,
    extras: OptionalWork,
    signals: Signals | None,
) -> dict[str, Any]:
    """Return the fields of a `WindowResult` that explain a change; none without windows.

    A mass is claimed only if the diagnosis has one mass, and no other cause. A fault in one part affects only that
    part. Without a structure the change is stated as that of the measured modes.

    Parameters
    ----------
    learned : by which the change was found
    changed_windows : windows over the limit that begin after the first one: that one may hold both states
    structure : of the site; None if it has none
    extras : collects failures
    signals : of a window before the change, and of the last one
    """
    if not changed_windows:
        return {}
    if learned.model is None or structure is None:
        return {"change": extras.found("the comparison of modes", lambda: modal_change(learned, changed_windows))}
    return _explanation(learned, learned.model, changed_windows, structure, extras, signals)


def _explanation(
    learned: LearnedBaseline,
    model: LearnedModel,
    changed_windows: Sequence[Window],
    structure: Structure,
    extras: OptionalWork,
    signals: Signals | None,
) -> dict[str, Any]:
    """Return the fields that explain a change by a model."""
    reference = model.reference
    modes = learned.mean_of(changed_windows)
    found: dict[str, Any] = {}
    found["increments"] = extras.found("the one-step update", lambda: _increments(model, modes, len(changed_windows)))
    both = extras.found("the diagnosis", lambda: diagnosis_of(learned, model, changed_windows, signals))
    if both is None:
        return found
    explained, event = both
    for failed in explained.diagnosis.failed:
        extras.note(failed_text(failed))
    found["diagnosis"] = diagnosis_answer(explained)
    found["discrepancy"] = extras.found(
        "the comparison with simulated modes", lambda: compare_windows(reference, event, explained)
    )
    if is_one_mass(explained.diagnosis):
        found["answer"] = extras.found(
            "the location of the mass", lambda: _location(reference, modes, structure, len(changed_windows))
        )
    return found


def diagnosis_of(
    learned: LearnedBaseline,
    model: LearnedModel,
    changed_windows: Sequence[Window],
    signals: Signals | None = None,
) -> tuple[DiagnosisResult, Event] | None:
    """Return the diagnosis of windows; None where fewer than three modes are left to compare."""
    try:
        return explain_windows(
            model.reference,
            learned.before,
            conditions_of(changed_windows),
            synchronized_windows(changed_windows, learned.devices),
            signals,
        )
    except ModalDataError:
        return None  # there is an alarm, but no cause


def _location(reference: Reference, modes: ModalMean, structure: Structure, n_windows: int) -> MassAnswer:
    change, outlook = locate_mass_with_forecast(reference, modes)
    return mass_answer(structure, change, n_windows, forecast_text(outlook, change.mass_std))


def sensors(learned: LearnedBaseline, calm: Sequence[Window]) -> dict[str, ChannelHealth]:
    """Return the health of each channel in calm windows, by the model; of one that died a window holds half."""
    if learned.model is None:
        return {}
    tracks = [learned.modes_of(window.synchronized) for window in calm]
    found = sensors_seen(learned.model.reference, synchronized_windows(calm, learned.devices), tracks)
    return {channel: health for channel, health in found.items() if channel in calm[-1].synchronized.channels}


def _increments(model: LearnedModel, event: ModalMean, n_windows: int) -> MassIncrements | None:
    try:
        return increment_result(model.updater.update(event), n_windows)
    except (PairingError, ModalDataError):
        return None  # no modes left to compare, or a channel is missing: there is an alarm, but no increments
