"""Acceptance of a change as the new reference; temperature law and scatter are kept."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monitor.analysis.window import Window
from monitor.detection import Shift
from monitor.optional import run_optional
from monitor.settings import Settings
from monitor.text.causes import change_text
from monitor.text.modal_change import modal_change_text
from monitor.watch.accepted_change import AcceptanceRequest, AcceptedChange
from monitor.watch.answer import diagnosis_of
from monitor.watch.baseline.learned_baseline import LearnedBaseline, learn_baseline
from monitor.watch.baseline.modal_change import modal_change
from updater import ModalDataError, PairingError, Structure, UpdaterError, dump_structure, stack_tracks
from updater.modal_data import MIN_PRESENCE
from updater.structure import without_empty_segments

MIN_WINDOWS = 5  #: windows since the change for a new reference: the minimum of a baseline


class CannotAcceptError(Exception):
    """There is a reason why a change cannot become the reference."""


def accept_change(
    structure: Structure | None,
    learned: LearnedBaseline,
    changed_windows: Sequence[Window],
    settings: Settings,
    wanted: AcceptanceRequest,
    raised: int,
) -> LearnedBaseline:
    """Return the new state of monitoring.

    If the diagnosis explains the change, its causes are written into the structure first: a mass is not mistaken for a
    softer material. Otherwise the one-step update's first stage includes the change.
    Without a structure the change is stated as that of the measured modes.

    Parameters
    ----------
    structure : of the site; None if it has none
    learned : by which the change was found
    changed_windows : windows since the change, at least `MIN_WINDOWS`
    settings : of the site
    wanted : person and cause of the acceptance
    raised : when the alarm was [ns UTC]

    Raises
    ------
    CannotAcceptError
        Saying why.
    """
    text, found = _explained(learned, changed_windows)
    known, shift = learned.detector.moved(len(changed_windows))
    change = AcceptedChange(
        time=changed_windows[-1].end,
        raised=raised,
        cause=wanted.cause,
        by=wanted.by,
        found=found,
        structure=text,
        windows=tuple(changed_windows),
        shift=shift,
    )
    last: Exception | None = None
    for tried in (change, replace(change, structure="")) if text else (change,):
        try:
            return learn_baseline(structure, learned.baseline, settings, known, (*learned.accepted, tried))
        except (UpdaterError, np.linalg.LinAlgError) as error:
            last = error
    raise CannotAcceptError(str(last)) from last


def restore_hidden_modes(
    structure: Structure | None,
    learned: LearnedBaseline,
    calm: Sequence[Window],
    settings: Settings,
) -> LearnedBaseline | None:
    """Return a watch of modes too that the last accepted change hid and most windows show again; None without such.

    Their frequencies are those of now: they were not watched meanwhile.

    Parameters
    ----------
    structure : of the site; None if it has none
    learned : as it is
    calm : the last windows, none over the limit, as many as a baseline has
    settings : of the site
    """
    if not learned.accepted:
        return None
    *before, last = learned.accepted
    tracks = [learned.tracker.assign(window.synchronized) for window in calm]
    again = [track for track in last.hides if np.mean([modes[track] >= 0 for modes in tracks]) >= MIN_PRESENCE]
    if not again:
        return None
    modes = stack_tracks([window.synchronized for window in calm], tracks)
    known, now = learned.detector.seen_again(modes, np.array(again))
    shift = Shift(
        log_frequency=np.where(np.isin(np.arange(len(now.std)), again), now.log_frequency, last.shift.log_frequency),
        std=np.where(np.isnan(now.std), last.shift.std, now.std),
    )
    change = replace(last, windows=tuple(calm), shift=shift)
    try:
        return learn_baseline(structure, learned.baseline, settings, known, (*before, change))
    except (PairingError, ModalDataError):
        return None  # it has no partner in the model: it stays hidden


def undo_last(structure: Structure | None, learned: LearnedBaseline, settings: Settings) -> LearnedBaseline:
    """Return the state before the last acceptance, with all later learning of scatter."""
    *before, last = learned.accepted
    return learn_baseline(structure, learned.baseline, settings, learned.detector.moved_back(last.shift), before)


def _explained(learned: LearnedBaseline, changed_windows: Sequence[Window]) -> tuple[str, str]:
    """Return the structure with the causes of the change, empty if there is no explanation, and its text."""
    model = learned.model
    if model is None:
        change = run_optional("the comparison of modes", lambda: modal_change(learned, changed_windows))
        return "", modal_change_text(change) if change else "not explained"
    both = run_optional("the diagnosis of the accepted change", lambda: diagnosis_of(learned, model, changed_windows))
    if both is None:
        return "", "not explained"
    found, _ = both
    extended = found.extended if found.diagnosis.verdict == "explained" else None
    if extended is None:
        return "", change_text(found.diagnosis)
    return dump_structure(without_empty_segments(extended, model.reference.structure)), change_text(found.diagnosis)
