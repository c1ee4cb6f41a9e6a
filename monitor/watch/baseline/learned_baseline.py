"""Baseline: reference and detector learned from its windows."""

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
from updater.modal_data import choose_tracks, remove_device_delays


class Identified(Protocol):
    """A window of a baseline: an identification, or its kept part."""

    @property
    def estimate(self) -> ModalEstimate:
        """Modes."""

    @property
    def delays(self) -> Mapping[str, float]:
        """Delays that have been removed already: device -> delay [s]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LearnedBaseline:
    """Learnt baseline, with everything needed to watch."""

    baseline: tuple[Window, ...]
    devices: Mapping[str, str]  #: device of each channel
    accepted: tuple[AcceptedChange, ...]  #: changes of the structure since, in order
    before: Conditions  #: conditions of the windows from which the reference is learned
    tracker: Tracker
    watched: IndexArray  #: (n_watched,) tracks whose modes the reference has, in its order: all but hidden ones
    reference: Reference
    updater: MassUpdater
    detector: Detector

    def modes_of(self, estimate: ModalEstimate) -> IndexArray:
        """Return which modes of a window are the reference's (n_watched,), -1 where one is missing."""
        return self.tracker.assign(estimate)[self.watched]

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
    structure: Structure,
    baseline: Sequence[Window],
    settings: Settings,
    known: DetectorState | None = None,
    accepted: Sequence[AcceptedChange] = (),
) -> LearnedBaseline:
    """Learn from baseline windows, and from those of changes that were accepted since.

    Parameters
    ----------
    structure : of the site
    baseline : its windows
    settings : of the site
    known : later state of the detector, if these windows were learned from before
    accepted : changes of the structure, in order

    Raises
    ------
    PairingError
        If fewer than three modes can be tracked, or one that an accepted change does not hide has no partner in the
        model.
    """
    tracker, reference = learn_tracked_reference(structure, baseline, settings.device_of)
    watched = np.arange(len(reference.paired))
    for change in accepted:
        structure = parse_structure(change.structure) if change.structure else structure
        watched = np.setdiff1d(np.arange(tracker.reference.n_modes), change.hides)
        tracker, reference = learn_changed(structure, change.windows, tracker, reference, watched)
    return LearnedBaseline(
        baseline=tuple(baseline),
        devices=settings.device_of,
        accepted=tuple(accepted),
        before=conditions_of(accepted[-1].windows if accepted else baseline),
        tracker=tracker,
        watched=watched,
        reference=reference,
        updater=MassUpdater(reference),
        detector=Detector(known or first_state(reference.windows, baseline, settings), settings),
    )


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
    lateness = remove_device_delays([f.estimate for f in found], [f.delays for f in found], devices)
    estimates = list(lateness.estimates)
    seed, often, tracks = choose_tracks(estimates)
    if len(often) < 3:
        raise PairingError(f"only {len(often)} modes in 70 % of the windows, at least 3 are needed")
    reference = learn_reference(structure, estimates, tracks, lateness.delays)
    chosen = reference.calibration.tracks
    kept = often[chosen]
    mean = mean_modes(stack_tracks(estimates, [track[chosen] for track in tracks]))
    return Tracker(reference=_at_mean(seed[kept], mean, np.arange(len(kept)))), reference


def learn_changed(
    structure: Structure, windows: Sequence[Window], tracker: Tracker, reference: Reference, watched: IndexArray
) -> tuple[Tracker, Reference]:
    """Learn the state of a structure after a change; its modes keep their identities.

    Parameters
    ----------
    structure : with the change written in, as far as it is known
    windows : since the change
    tracker, reference : before it; devices' delays are kept
    watched : (n_watched,) tracks that the windows show; where others were is remembered

    Raises
    ------
    PairingError
        If fewer than three are watched, or one has no partner in the model any more.
    """
    if len(watched) < 3:
        seen = f"only mode {', '.join(map(str, watched + 1))}" if len(watched) else "none"
        raise PairingError(
            f"{seen} of {tracker.reference.n_modes} identified since the change, at least 3 are needed for "
            "monitoring: check the sensors. The alarm stays active until they are identified again; "
            "it can be acknowledged"
        )
    estimates = [window.synchronized for window in windows]
    tracks = [tracker.assign(estimate)[watched] for estimate in estimates]
    learnt = learn_reference(structure, estimates, tracks, reference.delays)
    lost = np.delete(watched, learnt.calibration.tracks)
    if len(lost):
        raise PairingError(f"mode {', '.join(map(str, lost + 1))} no longer matches any mode of the model")
    return Tracker(reference=_at_mean(tracker.reference, learnt.baseline, watched)), learnt


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
