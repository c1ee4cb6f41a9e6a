"""Baseline: modes, model and detector learned from its windows."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from daq import IndexArray
from monitor.analysis.event import Conditions
from monitor.analysis.window import Window
from monitor.results.windows import Novelty, Unsure
from monitor.settings import Settings
from monitor.watch.accepted_change import AcceptedChange
from monitor.watch.detector import Detector, DetectorState, first_state
from monitor.watch.explanation import conditions_of
from oma import ModalEstimate, Tracker
from updater import (
    MassUpdater,
    ModalMean,
    PairingError,
    Reference,
    Structure,
    learn_reference,
    mean_modes,
    parse_structure,
    stack_tracks,
)
from updater.modal_data import (
    BaselineModes,
    SynchronizedWindows,
    choose_tracks,
    doubles_since,
    learn_baseline_modes,
    remove_device_delays,
)

_LEAST_WITH_MODEL = 3  # modes that a model is calibrated to


class Identified(Protocol):
    """A window of a baseline: an identification, or its kept part."""

    @property
    def estimate(self) -> ModalEstimate:
        """Modes."""

    @property
    def delays(self) -> Mapping[str, float]:
        """Delays that have been removed already: device -> delay [s]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LearnedModel:
    """Model of the structure file, learned from the measured modes of a baseline."""

    reference: Reference
    updater: MassUpdater


@dataclass(frozen=True, eq=False, kw_only=True)
class LearnedBaseline:
    """Learnt baseline, with everything needed to watch."""

    baseline: tuple[Window, ...]
    devices: Mapping[str, str]  #: device of each channel
    accepted: tuple[AcceptedChange, ...]  #: changes of the structure since, in order
    before: Conditions  #: conditions of the windows from which the modes are learned
    tracker: Tracker
    watched: IndexArray  #: (n_watched,) tracks of the modes below, in their order: all but hidden ones
    modes: BaselineModes  #: measured modes that are watched
    model: LearnedModel | None  #: model with the same modes; None for a site without a structure file
    detector: Detector

    def modes_of(self, estimate: ModalEstimate) -> IndexArray:
        """Return which modes of a window are the watched ones (n_watched,), -1 where one is missing."""
        return self.tracker.assign(estimate)[self.watched]

    def mean_of(self, windows: Sequence[Window]) -> ModalMean:
        """Return the mean of the watched modes in windows; a track that has the mode of another one has none.

        Where a change brings two modes together, one of them may be identified twice.
        """
        estimates = [window.synchronized for window in windows]
        tracks = np.array([self.modes_of(estimate) for estimate in estimates])
        mean = self.modes.scatter.mean(stack_tracks(estimates, list(tracks)))
        doubled = doubles_since(self.modes.mean, mean)
        if not len(doubled):
            return mean
        tracks[:, doubled] = -1
        return self.modes.scatter.mean(stack_tracks(estimates, list(tracks)))

    def judge(self, window: Window) -> Novelty:
        """Judge a window, which the detectors remember."""
        track = np.full(self.tracker.reference.n_modes, -1)
        track[self.watched] = self.modes_of(window.synchronized)
        score = self.detector.evaluate(window, track)
        least = self.detector.least
        return score if least is None else score.model_copy(update={"unsure": self._unsure(window, least)})

    def _unsure(self, window: Window, least: float) -> Unsure:
        known = [w.temperature for w in self.baseline if math.isfinite(w.temperature)] or [math.nan]
        return Unsure(
            least_percent=100 * math.expm1(least),
            temperature=window.temperature,
            coldest=min(known),
            warmest=max(known),
            silent_hours=self.detector.silent_hours,
        )

    @property
    def learnt(self) -> int:
        """End of the baseline's last window [ns UTC]."""
        return self.baseline[-1].end


def learn_baseline(
    structure: Structure | None,
    baseline: Sequence[Window],
    settings: Settings,
    known: DetectorState | None = None,
    accepted: Sequence[AcceptedChange] = (),
) -> LearnedBaseline:
    """Learn from baseline windows, and from those of changes that were accepted since.

    Parameters
    ----------
    structure : of the site; None if it has none: the measured modes alone are learned
    baseline : its windows
    settings : of the site
    known : later state of the detector, if these windows were learned from before, with a structure or without one
    accepted : changes of the structure, in order

    Raises
    ------
    PairingError
        If fewer than three modes (without a structure: none) can be tracked, or one that an accepted change does not
        hide has no partner in the model.
    """
    first = state = _first_state(structure, baseline, settings.device_of, known)
    for change in accepted:
        structure = parse_structure(change.structure) if structure and change.structure else structure
        state = _changed_state(structure, change.windows, state, np.setdiff1d(first.watched, change.hides))
    reference = state.reference
    return LearnedBaseline(
        baseline=tuple(baseline),
        devices=settings.device_of,
        accepted=tuple(accepted),
        before=conditions_of(accepted[-1].windows if accepted else baseline),
        tracker=state.tracker,
        watched=state.watched,
        modes=state.modes,
        model=LearnedModel(reference=reference, updater=MassUpdater(reference)) if reference else None,
        detector=Detector(known or first_state(state.modes.windows, baseline, settings), settings),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _State:
    """State of a structure: modes to track, and those of them that are watched."""

    tracker: Tracker
    watched: IndexArray  #: (n_watched,) tracks
    modes: BaselineModes
    reference: Reference | None


def _first_state(
    structure: Structure | None, found: Sequence[Identified], devices: Mapping[str, str], known: DetectorState | None
) -> _State:
    """Learn the state of the baseline.

    A detector that was learned without a structure has tracks for all measured modes. They keep their numbers, and
    those without a partner in the model are hidden.
    """
    if structure is None:
        tracker, modes = learn_tracked_modes(found, devices)
        return _State(tracker=tracker, watched=np.arange(len(modes.mean.n)), modes=modes, reference=None)
    tracker, reference = learn_tracked_reference(structure, found, devices)
    watched = np.arange(len(reference.paired))
    if known is not None and known.n_tracks != len(watched):
        tracker, watched = learn_tracked_modes(found, devices)[0], reference.calibration.tracks
    return _State(tracker=tracker, watched=watched, modes=reference.baseline_modes, reference=reference)


def learn_tracked_modes(found: Sequence[Identified], devices: Mapping[str, str]) -> tuple[Tracker, BaselineModes]:
    """Choose the modes to track and learn them, without a model; otherwise as `learn_tracked_reference`.

    Raises
    ------
    PairingError
        If no mode is in 70 % of the windows.
    """
    lateness = _synchronized(found, devices)
    seed, often, tracks = _often(lateness.estimates, least=1)
    stacked = stack_tracks(lateness.estimates, tracks)
    modes = learn_baseline_modes(stacked, lateness.delays)
    return Tracker(reference=_at_mean(seed[often], mean_modes(stacked), np.arange(len(often)))), modes


def learn_tracked_reference(
    structure: Structure, found: Sequence[Identified], devices: Mapping[str, str]
) -> tuple[Tracker, Reference]:
    """Choose the modes to track and learn the reference, the devices' delays first.

    The window with the most modes names the tracks; those present in 70 % of the windows and paired with a model mode
    stay.

    Raises
    ------
    PairingError
        If fewer than three stay.
    """
    lateness = _synchronized(found, devices)
    estimates = list(lateness.estimates)
    seed, often, tracks = _often(estimates, least=_LEAST_WITH_MODEL)
    reference = learn_reference(structure, estimates, tracks, lateness.delays)
    chosen = reference.calibration.tracks
    kept = often[chosen]
    mean = mean_modes(stack_tracks(estimates, [track[chosen] for track in tracks]))
    return Tracker(reference=_at_mean(seed[kept], mean, np.arange(len(kept)))), reference


def _synchronized(found: Sequence[Identified], devices: Mapping[str, str]) -> SynchronizedWindows:
    return remove_device_delays([f.estimate for f in found], [f.delays for f in found], devices)


def _often(estimates: Sequence[ModalEstimate], *, least: int) -> tuple[ModalEstimate, IndexArray, list[IndexArray]]:
    """Return the modes of `choose_tracks`, if there are enough."""
    seed, often, tracks = choose_tracks(estimates)
    if len(often) < least:
        raise PairingError(f"only {len(often)} modes in 70 % of the windows, at least {least} are needed")
    return seed, often, tracks


def _changed_state(
    structure: Structure | None, windows: Sequence[Window], before: _State, watched: IndexArray
) -> _State:
    """Learn the state of a structure after a change; its modes keep their identities.

    Parameters
    ----------
    structure : with the change written in, as far as it is known; None: the measured modes alone are learned
    windows : since the change
    before : state before it; devices' delays are kept
    watched : (n_watched,) tracks that the windows show; where others were is remembered

    Raises
    ------
    PairingError
        If fewer than three (without a structure: none) are watched, or one has no partner in the model any more.
    """
    tracker, least = before.tracker, _LEAST_WITH_MODEL if structure else 1
    if len(watched) < least:
        seen = f"only mode {', '.join(map(str, watched + 1))}" if len(watched) else "none"
        raise PairingError(
            f"{seen} of {tracker.reference.n_modes} identified since the change, at least {least} are needed for "
            "monitoring: check the sensors. The alarm stays active until they are identified again; "
            "it can be acknowledged"
        )
    estimates = [window.synchronized for window in windows]
    tracks = [tracker.assign(estimate)[watched] for estimate in estimates]
    reference = learn_reference(structure, estimates, tracks, before.modes.delays) if structure else None
    lost = np.delete(watched, reference.calibration.tracks if reference else np.arange(len(watched)))
    if len(lost):
        raise PairingError(f"mode {', '.join(map(str, lost + 1))} no longer matches any mode of the model")
    modes = (
        reference.baseline_modes
        if reference
        else learn_baseline_modes(stack_tracks(estimates, tracks), before.modes.delays)
    )
    tracker = Tracker(reference=_at_mean(tracker.reference, modes.mean, watched))
    return _State(tracker=tracker, watched=watched, modes=modes, reference=reference)


def _at_mean(estimate: ModalEstimate, mean: ModalMean, rows: IndexArray) -> ModalEstimate:
    """Return modes with the frequencies, damping and shapes of a mean of some (n_rows,); the others as they are."""
    shape = np.zeros((estimate.n_modes, len(mean.channels)), complex)
    shape_std = np.zeros(shape.shape)
    for column, channel in enumerate(mean.channels):
        if channel in estimate.channels:
            shape[:, column] = estimate.shape[:, estimate.channels.index(channel)]
            shape_std[:, column] = estimate.shape_std[:, estimate.channels.index(channel)]
    frequency, damping = estimate.frequency.copy(), estimate.damping.copy()
    frequency[rows], damping[rows] = np.exp(mean.log_frequency), mean.damping
    shape[rows], shape_std[rows] = mean.shape, mean.shape_std
    return replace(
        estimate, channels=mean.channels, frequency=frequency, damping=damping, shape=shape, shape_std=shape_std
    )
