"""From the windows of a baseline to what a watch needs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from monitor.explaining import Seen, seen_in
from monitor.fusion import choose_tracks
from monitor.lateness import in_time
from monitor.novelty import Detector, DetectorState, first_state
from monitor.settings import Settings
from monitor.window import Window
from oma import ModalEstimate, Tracker
from updater import MassUpdater, PairingError, Reference, Structure, learn_reference, mean_modes, stack_tracks


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

    learnt: int  #: end of the baseline's last window [ns UTC]
    baseline: tuple[Window, ...]
    before: Seen  #: what went with these
    tracker: Tracker
    reference: Reference
    updater: MassUpdater
    detector: Detector


def learn_watch(
    structure: Structure,
    baseline: Sequence[Window],
    devices: Mapping[str, str],
    settings: Settings,
    known: DetectorState | None = None,
) -> Watch:
    """Learn from baseline windows.

    Parameters
    ----------
    structure : of the site
    baseline : its windows
    devices : of each channel
    settings : of the site
    known : what judging has come to since, if these windows were learnt from before

    Raises
    ------
    PairingError
        If fewer than three modes can be tracked.
    """
    tracker, reference = learn_baseline(structure, baseline, devices)
    return Watch(
        learnt=baseline[-1].end,
        baseline=tuple(baseline),
        before=seen_in(baseline),
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
    fields = {name: getattr(seed, name)[kept] for name in _MODAL_FIELDS}
    fields |= {"frequency": np.exp(mean.log_frequency), "damping": mean.damping, "shape": mean.shape.astype(complex)}
    tracker = Tracker(reference=replace(seed, channels=mean.channels, **fields))
    return tracker, reference


_MODAL_FIELDS = ("frequency_std", "damping_std", "shape_std", "support", "law_ratio")
