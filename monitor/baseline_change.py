"""Change of the structure within the windows of a live baseline."""

from collections.abc import Sequence

import numpy as np

from monitor.stretches import utc
from monitor.window import Window
from updater import ChangePoint, TrackedModes, find_change

MAX_RESTARTS = 3  #: of learning; then a baseline that contains a change is accepted, which is reported


def change_in_baseline(windows: Sequence[Window], modes: TrackedModes) -> tuple[int, str] | None:
    """Return the first window after the last change within a live baseline, and a sentence; None without a change.

    Parameters
    ----------
    windows : of the baseline
    modes : (n_windows, n_tracks) of these
    """
    change = find_change(
        modes,
        1e-9 * np.array([window.start - windows[0].start for window in windows]),
        np.array([window.temperature for window in windows]),
        np.array([window.rms for window in windows]),
    )
    if change is None:
        return None
    first = change.first if change.stop == len(windows) else change.stop
    back = ", and back" if change.first and change.stop < len(windows) else ""
    size, std = _largest(change)
    return first, (
        f"the structure changed within the baseline at {utc(windows[change.first or first].start)}{back}: "
        f"frequencies moved by up to {100 * size:+.2g} ± {100 * std:.1g} %; "
        f"learning begins anew with the {len(windows) - first} windows since"
    )


def _largest(change: ChangePoint) -> tuple[float, float]:
    k = int(np.nanargmax(np.abs(change.shift)))
    sign = 1.0 if change.first else -1.0  # a change that the first windows are before
    return sign * float(change.shift[k]), float(change.shift_std[k])
