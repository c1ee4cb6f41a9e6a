"""Frequencies of many windows over time as a figure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from oma.tracking.long_term import LongTermTracker
from oma.tracking.track_state import Tracks
from oma.types import ModalEstimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_tracks(estimates: Sequence[ModalEstimate]) -> "Figure":
    """Draw the frequencies of windows over time, one colour per tracked mode (`LongTermTracker`); rare ones are grey.

    Parameters
    ----------
    estimates : of one window each, in any order

    Raises
    ------
    ValueError
        If there is no estimate.
    """
    from oma.plots import tracks_figure  # matplotlib is loaded only for a figure

    if not estimates:
        raise ValueError("estimates: expected at least one window with modes, found none")
    ordered = sorted(estimates, key=lambda estimate: estimate.start)
    tracker, identity = LongTermTracker(), []
    tracks: Tracks | None = None
    for estimate in ordered:
        followed = tracker.follow(tracks, estimate)
        tracks = followed.tracks
        identity.append(followed.identity)
    start = ordered[0].start
    return tracks_figure(
        np.concatenate([np.full(e.n_modes, (e.start + e.end) / 2 - start) for e in ordered]),
        np.concatenate([e.frequency for e in ordered]),
        np.concatenate(identity),
        ordered[-1].end - start,
        len(ordered),
        tracker.confirm,
    )
