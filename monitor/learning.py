"""From the windows of a baseline to what a watch needs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from monitor.accepted import Accepted
from monitor.explaining import Seen, seen_in
from monitor.fusion import choose_tracks
from monitor.lateness import in_time
from monitor.novelty import Detector, DetectorState, first_state
from monitor.settings import Settings
from monitor.window import Window
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


class Identified(Protocol):
    """A window of a baseline: an identification, or what is kept of one."""

    @property
    def estimate(self) -> ModalEstimate:
        """Modes."""

    @property
    def delays(self) -> Mapping[str, float]:
        """What has been taken out of them already: device -> delay [s]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Watch:
    """What watching needs once a baseline is learnt."""

    baseline: tuple[Window, ...]
    accepted: tuple[Accepted, ...]  #: changes of the structure since, in order
    before: Seen  #: what went with the windows that the reference is learnt from
    tracker: Tracker
    reference: Reference
    updater: MassUpdater
    detector: Detector

    @property
    def learnt(self) -> int:
        """End of the baseline's last window [ns UTC]."""
        return self.baseline[-1].end


def learn_watch(
    structure: Structure,
    baseline: Sequence[Window],
    devices: Mapping[str, str],
    settings: Settings,
    known: DetectorState | None = None,
    accepted: Sequence[Accepted] = (),
) -> Watch:
    """Learn from baseline windows, and from those of changes that were accepted since.

    Parameters
    ----------
    structure : of the site
    baseline : its windows
    devices : of each channel
    settings : of the site
    known : what judging has come to since, if these windows were learnt from before
    accepted : changes of the structure, in order

    Raises
    ------
    PairingError
        If fewer than three modes can be tracked, or a mode is lost by an accepted change.
    """
    tracker, reference = learn_baseline(structure, baseline, devices)
    for change in accepted:
        structure = parse_structure(change.structure) if change.structure else structure
        tracker, reference = learn_changed(structure, change.windows, tracker, reference)
    return Watch(
        baseline=tuple(baseline),
        accepted=tuple(accepted),
        before=seen_in(accepted[-1].windows if accepted else baseline),
        tracker=tracker,
        reference=reference,
        updater=MassUpdater(reference),
        detector=Detector(known or first_state(reference.windows, baseline, settings), settings),
    )


def learn_baseline(
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
    lateness = in_time([f.estimate for f in found], [f.delays for f in found], devices)
    estimates = list(lateness.estimates)
    seed, often, tracks = choose_tracks(estimates)
    if len(often) < 3:
        raise PairingError(f"only {len(often)} modes are seen in 70 % of the windows, at least 3 are needed")
    reference = learn_reference(structure, estimates, tracks, lateness.delays)
    chosen = reference.calibration.tracks
    kept = often[chosen]
    mean = mean_modes(stack_tracks(estimates, [track[chosen] for track in tracks]))
    return Tracker(reference=_at_mean(seed[kept], mean)), reference


def learn_changed(
    structure: Structure, windows: Sequence[Window], tracker: Tracker, reference: Reference
) -> tuple[Tracker, Reference]:
    """Learn what a structure is after a change; its modes keep their identities.

    Parameters
    ----------
    structure : with the change written in, as far as it is known
    windows : since the change
    tracker, reference : of before it; devices' delays stay what they were

    Raises
    ------
    PairingError
        If a mode is in none of the windows, or has no partner in the model any more.
    """
    estimates = [window.in_time for window in windows]
    tracks = [tracker.assign(estimate) for estimate in estimates]
    lost = np.flatnonzero((np.array(tracks) < 0).all(0))
    if len(lost):
        raise PairingError(f"mode {', '.join(map(str, lost + 1))} is not seen since the change")
    learnt = learn_reference(structure, estimates, tracks, reference.delays)
    lost = np.setdiff1d(np.arange(len(tracks[0])), learnt.calibration.tracks)
    if len(lost):
        raise PairingError(f"mode {', '.join(map(str, lost + 1))} answers to no mode of the model since the change")
    return Tracker(reference=_at_mean(tracker.reference, learnt.baseline)), learnt


def _at_mean(estimate: ModalEstimate, mean: ModalMean) -> ModalEstimate:
    """Return modes with the frequencies, damping and shapes of a mean."""
    return replace(
        estimate,
        channels=mean.channels,
        frequency=np.exp(mean.log_frequency),
        damping=mean.damping,
        shape=mean.shape.astype(complex),
        shape_std=mean.shape_std,
    )
